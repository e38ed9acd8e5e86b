"""Random furnishing of rooms: along the walls and on islands, with passages for a robot between
them.

A group is furniture that belongs together, as a desk and its chair. Whatever the seed, doors stay
clear and no two groups are so near to each other that they could close a path, except neighbours at
one wall, which leave none between them anyway.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely import affinity

from sim.models.furniture import FURNITURE_SIZES
from sim.scenario.layout import doors, items, obstacles
from sim.scenario.scenery import Room, RoomKind
from sim.scenario.schema import Furniture, FurnitureKind, Scenario

PASSAGE_M = 1.4
"""Width of the passages between groups, and between an island and a wall."""
DOOR_CLEARANCE_M = 1.5
"""Clearance around the middle of a door."""
KEEP_CLEAR_M = 1.3
"""Clearance around the start, a goal, a print, and the line of a walker."""
WALL_OFFSET_M = 0.07
"""Distance of furniture from the middle line of its wall."""
NEIGHBOUR_GAP_M = 0.15
"""Gap between neighbours at one wall."""
TRIES = 30
"""Number of random poses that are tried for each group."""

Part = tuple[FurnitureKind, float, float, float]
"""Kind, x and y in the frame of the group in metres, yaw in degrees. A group at a wall has it
behind it: x points into the room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Furniture that belongs together, about the middle of its floor."""

    parts: tuple[Part, ...]
    """Pieces of the group."""
    floor_m: tuple[float, float]
    """Depth along x and width along y of the occupied floor."""
    island: bool = False
    """Whether the group stands away from all walls."""
    sizes_m: Mapping[FurnitureKind, tuple[float, float, float]] = field(default_factory=dict)
    """Sizes of the pieces that differ from their default."""


def _single(kind: FurnitureKind, yaw_deg: float = 0.0) -> Group:
    depth, width, _ = FURNITURE_SIZES[kind]
    return Group(parts=((kind, 0.0, 0.0, yaw_deg),), floor_m=(depth, width))


_DESK = Group(parts=(("desk", -0.45, 0.0, 180.0), ("chair", 0.45, 0.0, 180.0)), floor_m=(1.65, 1.5))
_SHELF, _CABINET, _PLANT, _BIN = (
    _single("shelf"),
    _single("cabinet"),
    _single("plant"),
    _single("bin"),
)
_SOFA, _ARMCHAIR, _BOX = _single("sofa"), _single("armchair"), _single("box")
_MEETING = Group(
    parts=(
        ("table", 0.0, 0.0, 90.0),
        *(("chair", x, side * 1.0, -side * 90.0) for x in (-0.65, 0.65) for side in (1, -1)),
    ),
    floor_m=(2.2, 2.6),
    island=True,
)
_LOW_TABLE = Group(
    parts=(("table", 0.0, 0.0, 0.0), ("sofa", -1.3, 0.0, 0.0), ("armchair", 1.2, 0.0, 180.0)),
    floor_m=(3.4, 1.9),
    island=True,
    sizes_m={"table": (0.7, 1.1, 0.45)},
)
_RACK = Group(
    parts=(("shelf", 0.0, 0.0, 0.0),),
    floor_m=(0.7, 3.0),
    island=True,
    sizes_m={"shelf": (0.7, 3.0, 1.9)},
)
_COLUMN = Group(
    parts=(("cylinder", 0.0, 0.0, 0.0),),
    floor_m=(0.7, 0.7),
    island=True,
    sizes_m={"cylinder": (0.7, 0.7, 2.6)},
)
_ROOM_CONTENTS: Mapping[RoomKind, Sequence[tuple[Group, int, int]]] = {
    "office": (
        (_DESK, 2, 4),
        (_SHELF, 1, 2),
        (_CABINET, 0, 1),
        (_PLANT, 0, 2),
        (_BIN, 0, 1),
        (_ARMCHAIR, 0, 1),
    ),
    "meeting": ((_MEETING, 1, 1), (_CABINET, 1, 2), (_PLANT, 1, 2), (_SHELF, 0, 1)),
    "lounge": (
        (_LOW_TABLE, 1, 2),
        (_SOFA, 1, 3),
        (_ARMCHAIR, 1, 2),
        (_PLANT, 1, 3),
        (_SHELF, 0, 2),
    ),
    "store": ((_RACK, 2, 5), (_SHELF, 2, 4), (_BOX, 3, 7), (_CABINET, 0, 1)),
    "hall": (
        (_COLUMN, 2, 6),
        (_LOW_TABLE, 1, 2),
        (_MEETING, 0, 2),
        (_SOFA, 2, 4),
        (_PLANT, 3, 6),
        (_SHELF, 1, 3),
        (_BIN, 1, 2),
    ),
}
"""Contents of each kind of room: a group, with its least and its largest number where they fit."""


def furnish(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """Return the scenario with the furniture of all its rooms."""
    keep_out = _keep_out(scenario)
    furniture = [piece for room in scenario.rooms for piece in _furnish_room(room, keep_out, rng)]
    return replace(scenario, furniture=(*scenario.furniture, *furniture))


def _furnish_room(
    room: Room, keep_out: shapely.Geometry, rng: np.random.Generator
) -> list[Furniture]:
    floor = shapely.box(*room.corners[0], *room.corners[1])
    closed = shapely.intersection(keep_out, floor)
    standing: list[tuple[shapely.Geometry, int]] = []
    pieces = []
    for group, least, most in _ROOM_CONTENTS[room.kind]:
        for _ in range(int(rng.integers(least, most + 1))):
            for _ in range(TRIES):
                pose = _random_pose(room, group, rng)
                if pose is None:
                    continue
                x, y, yaw_deg, wall = pose
                area = affinity.translate(
                    affinity.rotate(_floor(group), yaw_deg, origin=(0, 0)), x, y
                )
                if _fits(area, wall, floor, closed, standing):
                    standing.append((area, wall))
                    pieces += _furniture_of(group, x, y, yaw_deg)
                    break
    return pieces


def _random_pose(
    room: Room, group: Group, rng: np.random.Generator
) -> tuple[float, float, float, int] | None:
    """Return x, y, yaw and number of the wall, -1 for an island, of a random pose in a room; None
    where the wall is too short for the group."""
    (x0, y0), (x1, y1) = room.corners
    depth, width = group.floor_m
    if group.island:
        x, y = (float(rng.uniform(low, high)) for low, high in ((x0, x1), (y0, y1)))
        return x, y, 90.0 * int(rng.integers(4)), -1
    wall, off = int(rng.integers(4)), WALL_OFFSET_M + depth / 2
    along_x = wall in (1, 3)
    low, high = (x0, x1) if along_x else (y0, y1)
    low, high = low + width / 2 + WALL_OFFSET_M, high - width / 2 - WALL_OFFSET_M
    if low > high:
        return None
    along = float(rng.uniform(low, high))
    # The walls in the west, south, east and north; x of the group points away from each.
    points = (
        (x0 + off, along, 0.0),
        (along, y0 + off, 90.0),
        (x1 - off, along, 180.0),
        (along, y1 - off, 270.0),
    )
    return (*points[wall], wall)


def _fits(
    area: shapely.Geometry,
    wall: int,
    floor: shapely.Polygon,
    closed: shapely.Geometry,
    standing: Sequence[tuple[shapely.Geometry, int]],
) -> bool:
    if shapely.intersects(area, closed) or not shapely.contains(floor, area):
        return False
    if wall < 0 and shapely.distance(floor.exterior, area) < PASSAGE_M:
        return False
    return all(
        shapely.distance(other, area) > (NEIGHBOUR_GAP_M if wall == beside >= 0 else PASSAGE_M)
        for other, beside in standing
    )


def _furniture_of(group: Group, x: float, y: float, yaw_deg: float) -> list[Furniture]:
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    return [
        Furniture(
            kind=kind,
            at=(round(x + cos * along - sin * across, 4), round(y + sin * along + cos * across, 4)),
            yaw_deg=math.remainder(yaw_deg + turn_deg, 360.0),
            size_m=group.sizes_m.get(kind),
        )
        for kind, along, across, turn_deg in group.parts
    ]


def _floor(group: Group) -> shapely.Geometry:
    depth, width = group.floor_m
    return shapely.box(-depth / 2, -width / 2, depth / 2, width / 2)


def _keep_out(scenario: Scenario) -> shapely.Geometry:
    """Return the area that stays free of furniture: before doors, and around everything in the file
    except walls."""
    points = [(door, DOOR_CLEARANCE_M) for door in doors(scenario)]
    points += [
        (point, KEEP_CLEAR_M)
        for point in (scenario.start[:2], *scenario.goals, *(sheet.at for sheet in scenario.prints))
    ]
    shapes = [shapely.Point(point).buffer(clearance_m) for point, clearance_m in points]
    paths = [
        person.points if len(person.points) > 1 else person.points * 2 for person in scenario.people
    ]
    shapes += [shapely.LineString(path).buffer(KEEP_CLEAR_M) for path in paths]
    furniture = (entry for entry in obstacles(scenario) if entry.name != "wall")
    objects = (*items(scenario), *furniture)
    shapes += [
        shapely.Polygon(outline).buffer(PASSAGE_M)
        for entry in objects
        for outline in entry.outlines()
    ]
    shapes += [shapely.Polygon(marking.polygon).buffer(PASSAGE_M) for marking in scenario.markings]
    return shapely.union_all(shapes)
