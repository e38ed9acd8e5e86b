"""Interiors as people live in them: furniture of wood, fabric and metal, tables and chairs on legs,
worktops, and things on top of them, which a camera in a hand sees from above.

They are added to a random world by a generator of their own, so that the world is the same without.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from navcore.geometry.transform import Matrix, Pose2, camera_mount
from sim.dataset import palette
from sim.dataset.scene import BACKGROUND, Material, Rng, Scene, SolidObject, Spot, Top
from sim.dataset.tables import Table, random_chair, random_table, random_thing
from sim.models.items import ITEM_SIZES, item_extent, item_shapes, item_solids
from sim.models.solids import Solid

COVERED_SHARE = 0.75
"""Share of the background objects that are of a material instead of one colour."""
COVERED_ITEMS = {"book": 0.6, "box": 0.6, "bottle": 0.5, "cup": 0.4}
"""The same of items, of which most are printed."""
PRINTED_SHARE = 0.7
"""Share of the covered items that are printed, as packages are."""
ON_TOP = ("cup", "cup", "bottle", "book", "book", "keyboard", "box")
"""Kinds of items on a table; a cup and a book are twice as frequent."""
HAND_HELD_SHARE = 0.4
"""Share of the images from a hand."""
HIGHEST_M = 2.0
"""Largest height of a hand."""
_AWAY_LOG_M = (math.log(0.5), math.log(2.6))
"""Range of the distance of a hand from what it looks at, as logarithms."""
CROWDED = 0.75
"""Radius that a table needs, as a share of half its diagonal: furniture may touch."""
CHAIR_RADIUS_M = 0.28
"""Radius of the disc that a chair needs."""
THING_CELL_M = 0.34
"""Side of the part of a table that one thing has for itself."""


def lived_in(scene: Scene, rng: Rng, *, materials: int, packages: int) -> Scene:
    """Return the scene with materials, and with tables and chairs and things on them; a scene that
    looks like the simulator stays as it is. `materials`, `packages`: numbers of those of the
    renderer."""
    if scene.like_simulator:
        return scene
    objects, blocked, tops = list(scene.objects), list(scene.blocked), list(scene.tops)
    for _ in range(int(rng.integers(0, 4))):
        table = random_table(rng)
        radius_m = CROWDED * math.hypot(*table.half_m)
        at = _free_spot(scene, blocked, rng, radius_m)
        if at is None:
            continue
        pose = Pose2(x_m=at[0], y_m=at[1], yaw_rad=float(rng.uniform(-math.pi, math.pi)))
        objects.append(SolidObject(label=BACKGROUND, solids=table.solids, pose=pose))
        blocked.append(Spot(x_m=at[0], y_m=at[1], radius_m=radius_m))
        tops.append(Top(x_m=at[0], y_m=at[1], radius_m=min(table.half_m), height_m=table.height_m))
        objects += _things_on_top(rng, pose, table)
        objects += _chairs_around(scene, blocked, rng, pose, table)
    covered = tuple(_covered(item, rng, materials, packages) for item in objects)
    return replace(scene, objects=covered, blocked=tuple(blocked), tops=tuple(tops))


def hand_held_view(scene: Scene, rng: Rng) -> Matrix | None:
    """Return T_map_camera of a camera in a hand that looks at a table or an object, or None for the
    view of the robot."""
    if scene.like_simulator or rng.random() > HAND_HELD_SHARE:
        return None
    on_floor = [Top(x_m=s.x_m, y_m=s.y_m, radius_m=s.radius_m, height_m=0.0) for s in scene.targets]
    tops = scene.tops if scene.tops and rng.random() < 0.8 else on_floor
    if not tops:
        return None
    for _ in range(10):
        top = tops[rng.integers(len(tops))]
        aside, turn = top.radius_m * rng.uniform(0.0, 1.0), rng.uniform(-math.pi, math.pi)
        away, bearing = math.exp(rng.uniform(*_AWAY_LOG_M)), rng.uniform(-math.pi, math.pi)
        down = float(rng.uniform(0.1, 0.9))
        level_m = away * math.cos(down)
        x = top.x_m + aside * math.cos(turn) - level_m * math.cos(bearing)
        y = top.y_m + aside * math.sin(turn) - level_m * math.sin(bearing)
        if abs(x) < scene.reach_m[0] and abs(y) < scene.reach_m[1]:
            break
    else:
        return None
    body = Pose2(x_m=x, y_m=y, yaw_rad=bearing + float(rng.normal(0, 0.15)))
    mount = camera_mount(
        x_m=0.0,
        y_m=0.0,
        z_m=min(top.height_m + away * math.sin(down), HIGHEST_M),
        pitch_down_rad=down + float(rng.normal(0, 0.1)),
    )
    roll = float(rng.normal(0, 0.06))
    about_axis = np.eye(4)
    about_axis[:2, :2] = [[math.cos(roll), -math.sin(roll)], [math.sin(roll), math.cos(roll)]]
    return np.asarray(body.matrix() @ mount @ about_axis)


def _free_spot(
    scene: Scene, blocked: list[Spot], rng: Rng, radius_m: float
) -> tuple[float, float] | None:
    """Return a place near a target of the camera where a disc is clear of everything."""
    for _ in range(40):
        if scene.targets:
            spot = scene.targets[rng.integers(len(scene.targets))]
            away, turn = rng.uniform(0.4, 4.0), rng.uniform(-math.pi, math.pi)
            x, y = spot.x_m + away * math.cos(turn), spot.y_m + away * math.sin(turn)
        else:
            x, y = (rng.uniform(-1, 1) * reach for reach in scene.reach_m)
        inside = (
            abs(x) + radius_m < scene.reach_m[0] + 0.3
            and abs(y) + radius_m < scene.reach_m[1] + 0.3
        )
        if inside and _clear((*blocked, *scene.targets), x, y, radius_m):
            return float(x), float(y)
    return None


def _clear(spots: tuple[Spot, ...], x: float, y: float, radius_m: float) -> bool:
    return all(math.hypot(x - s.x_m, y - s.y_m) > radius_m + s.radius_m for s in spots)


def _chairs_around(
    scene: Scene, blocked: list[Spot], rng: Rng, pose: Pose2, table: Table
) -> list[SolidObject]:
    """Return chairs that face the table, where there is room, and block their places."""
    chairs = []
    others = [spot for spot in blocked if (spot.x_m, spot.y_m) != (pose.x_m, pose.y_m)]
    for side in rng.permutation(4)[: int(rng.integers(0, 5))].tolist():
        away = table.half_m[side % 2] + rng.uniform(0.2, 0.45)
        yaw = pose.yaw_rad + side * (math.pi / 2)
        x, y = pose.x_m + away * math.cos(yaw), pose.y_m + away * math.sin(yaw)
        within = abs(x) <= scene.reach_m[0] and abs(y) <= scene.reach_m[1]
        if not within or not _clear((*others, *scene.targets), x, y, CHAIR_RADIUS_M):
            continue
        facing = Pose2(x_m=x, y_m=y, yaw_rad=yaw + math.pi + float(rng.normal(0, 0.3)))
        chairs.append(SolidObject(label=BACKGROUND, solids=random_chair(rng), pose=facing))
        spot = Spot(x_m=x, y_m=y, radius_m=CHAIR_RADIUS_M)
        others.append(spot)
        blocked.append(spot)
    return chairs


def _things_on_top(rng: Rng, pose: Pose2, table: Table) -> list[SolidObject]:
    """Return items and other things on a table, each in a cell of its own."""
    (half_x, half_y), things = table.half_m, []
    rows, cols = (max(1, int(2 * half / THING_CELL_M)) for half in table.half_m)
    order = rng.permutation(rows * cols)
    for cell in order[: int(rng.integers(0, min(7, rows * cols) + 1))].tolist():
        row, col = divmod(cell, cols)
        local_x = (2 * (row + 0.5) / rows - 1) * half_x + rng.uniform(-0.04, 0.04)
        local_y = (2 * (col + 0.5) / cols - 1) * half_y + rng.uniform(-0.04, 0.04)
        x, y = pose.to_parent(np.array([[local_x, local_y]]))[0].tolist()
        label, solids = _item(rng) if rng.random() < 0.6 else (BACKGROUND, random_thing(rng))
        at = Pose2(x_m=x, y_m=y, yaw_rad=float(rng.uniform(-math.pi, math.pi)))
        things.append(SolidObject(label=label, solids=_raised(solids, table.height_m), pose=at))
    return things


def _raised(solids: tuple[Solid, ...], by_m: float) -> tuple[Solid, ...]:
    return tuple(
        replace(solid, centre_m=(*solid.centre_m[:2], solid.centre_m[2] + by_m)) for solid in solids
    )


def _item(rng: Rng) -> tuple[str, tuple[Solid, ...]]:
    """Return class and solids of a beware object as people put it on a table."""
    kind = str(rng.choice(ON_TOP))
    shape = str(rng.choice(item_shapes(kind)))
    x, y, z = (float(side * rng.uniform(0.85, 1.15)) for side in ITEM_SIZES[kind])
    longest = max(item_extent(kind, (x, y, z), shape)[:2])
    if kind != "keyboard":  # which is as long as it is
        x, y, z = (side * 0.3 / max(0.3, longest) for side in (x, y, z))
    if kind in ("cup", "bottle"):
        y = x
    if kind == "book":  # down to a magazine
        z = float(rng.uniform(0.004, 0.05))
    return kind, item_solids(kind, (x, y, z), palette.item(rng, kind), shape)


def _covered(item: SolidObject, rng: Rng, materials: int, packages: int) -> SolidObject:
    """Return an object with the solids of one of its colours of a material, or printed."""
    own = item.label == BACKGROUND
    if rng.random() > (COVERED_SHARE if own else COVERED_ITEMS.get(item.label, 0.0)):
        return item
    printed = not own and rng.random() < PRINTED_SHARE
    first, last = (materials, materials + packages) if printed else (0, materials)
    sides_m = (0.25, 1.2) if own else (0.1, 0.5)
    level = int(255 * rng.uniform(0.6, 1.0))
    return replace(
        item,
        material=Material(
            texture=int(rng.integers(first, last)),
            side_m=float(rng.uniform(*sides_m)),
            covers=item.solids[rng.integers(len(item.solids))].colour,
            tint=(level, level, level),
        ),
    )
