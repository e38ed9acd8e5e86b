"""Random worlds: a room, a corridor, a hall or open ground, its furniture, and the objects on its
floor."""

from __future__ import annotations

import math

from navcore.geometry.transform import Pose2
from sim.dataset import palette
from sim.dataset.item_placement import ItemPlacer
from sim.dataset.scene import BACKGROUND, Decal, Rng, Scene, ScenePlan, SolidObject, Spot
from sim.models.furniture import FURNITURE_COLOURS, FURNITURE_SIZES, furniture_solids
from sim.models.solids import Colour, Solid, box
from sim.rendering.light import DAYLIGHT, Light
from sim.scenario.schema import FLOOR_COLOUR, WALL_COLOUR, WALL_HEIGHT_M

LIKE_SIMULATOR = 0.3
"""Share of worlds that are coloured, lit and rendered exactly like scenarios."""
GROUND_HALF_M = 30.0
"""Half the side of the ground outdoors."""


def random_scene(rng: Rng, *, patterns: tuple[int, int], prints: int) -> Scene:
    """Return one world. `patterns`: number of indoor and outdoor patterns of the renderer;
    `prints`: number of its prints."""
    plan = _random_plan(rng)
    _add_ground(plan, patterns)
    if plan.walled:
        _build_walls(plan)
    focus = tuple(float(rng.uniform(-1, 1) * max(0.3, half - 1.6)) for half in plan.half_m)
    ItemPlacer(plan, focus=(focus[0], focus[1]), patterns=patterns, prints=prints).place_all()
    _furnish(plan)
    return Scene(
        objects=tuple(plan.objects),
        decals=tuple(plan.decals),
        posters=tuple(plan.posters),
        targets=tuple(plan.targets),
        blocked=tuple(plan.blocked),
        reach_m=_reach(plan),
        light=DAYLIGHT if plan.plain else _light(rng),
        sky=None if plan.plain or rng.random() < 0.3 else _sky(rng),
        like_simulator=plan.plain,
    )


def empty_scene(rng: Rng, *, patterns: tuple[int, int]) -> Scene:
    """Return a world with ground, walls and light as of `random_scene`, and nothing in it.

    `patterns`: number of indoor and outdoor patterns of the renderer.
    """
    plan = _random_plan(rng)
    _add_ground(plan, patterns)
    if plan.walled:
        _build_walls(plan)
    return Scene(
        objects=tuple(plan.objects),
        decals=tuple(plan.decals),
        posters=(),
        targets=(),
        blocked=(),
        reach_m=_reach(plan),
        light=DAYLIGHT if plan.plain else _light(rng),
        sky=None if plan.plain or rng.random() < 0.3 else _sky(rng),
        like_simulator=plan.plain,
    )


def _reach(plan: ScenePlan) -> tuple[float, float]:
    """Return the bound of the positions of a robot along x and y, in metres."""
    return min(plan.half_m[0] - 0.35, 8.0), min(plan.half_m[1] - 0.35, 8.0)


def _random_plan(rng: Rng) -> ScenePlan:
    kind = rng.choice(["room", "room", "room", "corridor", "hall", "outdoor"])
    plain = rng.random() < LIKE_SIMULATOR
    if kind == "room":
        half = (float(rng.uniform(2.6, 5.0)), float(rng.uniform(2.6, 5.0)))
    elif kind == "corridor":
        half = (float(rng.uniform(4.0, 8.0)), float(rng.uniform(1.1, 1.8)))
    else:
        half = (float(rng.uniform(6.0, 10.0)), float(rng.uniform(6.0, 10.0)))
    outdoor = kind == "outdoor" and not plain
    return ScenePlan(rng=rng, half_m=half, walled=kind != "outdoor", outdoor=outdoor, plain=plain)


def _add_ground(plan: ScenePlan, patterns: tuple[int, int]) -> None:
    rng = plan.rng
    x, y = (
        (GROUND_HALF_M, GROUND_HALF_M)
        if not plan.walled
        else (plan.half_m[0] + 0.2, plan.half_m[1] + 0.2)
    )
    corners = ((-x, -y), (x, -y), (x, y), (-x, y))
    if plan.plain:
        colour = FLOOR_COLOUR if rng.random() < 0.6 else palette.floor(rng)
        plan.decals.append(Decal(label=BACKGROUND, polygon=corners, colour=colour))
        return
    if plan.outdoor:
        colour = palette.hsv(rng.uniform(60, 120), rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.8))
        colour = colour if rng.random() < 0.6 else palette.floor(rng)
        texture = patterns[0] + int(rng.integers(patterns[1]))
    else:
        colour, texture = palette.floor(rng), int(rng.integers(patterns[0]))
    side_m = float(rng.uniform(1.2, 3.2))
    plan.decals.append(
        Decal(
            label=BACKGROUND, polygon=corners, colour=colour, texture=texture, texture_side_m=side_m
        )
    )


def _build_walls(plan: ScenePlan) -> None:
    rng, (x, y) = plan.rng, plan.half_m
    colour = WALL_COLOUR if plan.plain else palette.wall(rng)
    height = WALL_HEIGHT_M if plan.plain else float(rng.uniform(2.2, 3.2))
    skirting = None if rng.random() < 0.5 else (0.08, palette.any_colour(rng))
    two_tone = (
        None
        if plan.plain or rng.random() < 0.75
        else (float(rng.uniform(0.8, 1.3)), palette.wall(rng))
    )
    for along, across, turn in (
        (x, y, 0.0),
        (x, y, math.pi),
        (y, x, math.pi / 2),
        (y, x, -math.pi / 2),
    ):
        own = colour if rng.random() < 0.85 else palette.wall(rng)
        solids = [box((2 * along + 0.24, 0.12, height), (0.0, across + 0.06), own)]
        strips = [strip for strip in (skirting, two_tone) if strip is not None]
        solids += [
            box((2 * along, 0.02, high), (0.0, across - 0.005), paint) for high, paint in strips
        ]
        if not plan.plain:
            solids += _openings(rng, along, across, height)
        plan.objects.append(_background(tuple(solids), 0.0, 0.0, turn))


def _openings(rng: Rng, along: float, across: float, height: float) -> list[Solid]:
    """Return doors and windows as flat solids on a wall."""
    solids = []
    if rng.random() < 0.5:
        x = float(rng.uniform(-1, 1) * max(0.0, along - 0.6))
        solids.append(
            box((0.95, 0.03, min(2.1, height)), (x, across - 0.01), palette.any_colour(rng))
        )
    if rng.random() < 0.4:
        x = float(rng.uniform(-1, 1) * max(0.0, along - 0.8))
        pane = palette.hsv(rng.uniform(190, 220), rng.uniform(0.0, 0.4), rng.uniform(0.6, 1.0))
        solids.append(box((1.3, 0.03, 1.0), (x, across - 0.012), pane, bottom_m=0.95))
    return solids


def _furnish(plan: ScenePlan) -> None:
    """Place furniture along the walls and some in the open, never on other objects."""
    rng = plan.rng
    density = rng.uniform(0.3, 1.2)
    for _ in range(round(density * (10 if plan.walled else 4))):
        kind = str(rng.choice(list(FURNITURE_SIZES)))
        size, colour = _size(rng, kind), FURNITURE_COLOURS[kind]
        if not plan.plain or rng.random() < 0.3:
            colour = palette.any_colour(rng) if rng.random() < 0.7 else colour
        radius = math.hypot(size[0], size[1]) / 2
        for _ in range(6):
            x, y, yaw = (
                _pose_at_wall(plan, size)
                if plan.walled and rng.random() < 0.75
                else _random_pose(plan)
            )
            if _clear(plan, x, y, radius):
                plan.objects.append(_background(furniture_solids(kind, size, colour), x, y, yaw))
                plan.blocked.append(Spot(x_m=x, y_m=y, radius_m=radius))
                break


def _size(rng: Rng, kind: str) -> tuple[float, float, float]:
    x, y, z = (
        float(side * scale)
        for side, scale in zip(FURNITURE_SIZES[kind], rng.uniform(0.85, 1.2, 3), strict=True)
    )
    if kind == "box":  # larger than any parcel
        x, y, z = (float(side) for side in rng.uniform(0.5, 1.0, 3))
    if kind in ("bin", "cylinder", "plant"):
        y = x
    return x, y, z


def _pose_at_wall(plan: ScenePlan, size: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the x, y and yaw of a random pose with the back to a wall."""
    rng, (x, y) = plan.rng, plan.half_m
    side = int(rng.integers(4))
    turn = side * math.pi / 2
    away, along = (x, y) if side % 2 == 0 else (y, x)
    back, shift = (
        away - size[0] / 2 - 0.04,
        float(rng.uniform(-1, 1) * max(0.0, along - size[1] / 2)),
    )
    cos, sin = math.cos(turn), math.sin(turn)
    return cos * back - sin * shift, sin * back + cos * shift, turn + math.pi


def _random_pose(plan: ScenePlan) -> tuple[float, float, float]:
    rng = plan.rng
    x, y = (float(rng.uniform(-1, 1) * min(half - 0.3, 7.0)) for half in plan.half_m)
    return x, y, float(rng.uniform(-math.pi, math.pi))


def _clear(plan: ScenePlan, x: float, y: float, radius: float) -> bool:
    others = (*plan.blocked, *plan.targets)
    return all(math.hypot(x - s.x_m, y - s.y_m) > 0.9 * radius + s.radius_m for s in others)


def _background(solids: tuple[Solid, ...], x: float, y: float, yaw: float) -> SolidObject:
    return SolidObject(label=BACKGROUND, solids=solids, pose=Pose2(x_m=x, y_m=y, yaw_rad=yaw))


def _light(rng: Rng) -> Light:
    turn, height = rng.uniform(-math.pi, math.pi), rng.uniform(0.5, 1.45)
    away = 1000.0 * math.cos(height)
    from_m = (
        float(away * math.cos(turn)),
        float(away * math.sin(turn)),
        float(1000.0 * math.sin(height)),
    )
    ambient = float(rng.uniform(0.45, 0.85))
    return Light(
        from_m=from_m, ambient=ambient, diffuse=float(rng.uniform(0.15, 1.05 - ambient + 0.1))
    )


def _sky(rng: Rng) -> Colour:
    return palette.hsv(rng.uniform(190, 230), rng.uniform(0.0, 0.5), rng.uniform(0.5, 1.0))
