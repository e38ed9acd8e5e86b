"""Furnishes rooms, each seed in its own way: along the walls, and on islands, with room for a robot
to pass between them.

A group is what belongs together, as a desk and its chair. Whatever the seed, doors stay clear and
no two groups are so near to each other that they could close a way: what stands at the same wall
apart, which leaves none.
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

WAY_M = 1.4
"""Room between groups, and between an island and a wall."""
DOOR_M = 1.5
"""Nothing stands nearer to the middle of a door."""
KEEP_OFF_M = 1.3
"""Nor to the start, a goal, a picture, anybody's way, an item or a marking."""
WALL_M = 0.07
"""What stands at a wall is so far from its middle line."""
BESIDE_M = 0.15
"""Room between neighbours at one wall."""
TRIES = 30

Part = tuple[FurnitureKind, float, float, float]
"""Kind, x and y in the group's frame in metres, yaw in degrees. A group at a wall has it behind it:
x points into the room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Furniture that belongs together, about the middle of its floor."""

    parts: tuple[Part, ...]
    """What it is of."""
    floor_m: tuple[float, float]
    """Depth along x and width along y that it takes up."""
    island: bool = False
    """Whether it stands away from all walls."""
    sizes_m: Mapping[FurnitureKind, tuple[float, float, float]] = field(default_factory=dict)
    """Of what has not its usual size."""


def _alone(kind: FurnitureKind, yaw_deg: float = 0.0) -> Group:
    depth, width, _ = FURNITURE_SIZES[kind]
    return Group(parts=((kind, 0.0, 0.0, yaw_deg),), floor_m=(depth, width))


_DESK = Group(parts=(("desk", -0.45, 0.0, 180.0), ("chair", 0.45, 0.0, 180.0)), floor_m=(1.65, 1.5))
_SHELF, _CABINET, _PLANT, _BIN = _alone("shelf"), _alone("cabinet"), _alone("plant"), _alone("bin")
_SOFA, _ARMCHAIR, _BOX = _alone("sofa"), _alone("armchair"), _alone("box")
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
_KINDS: Mapping[RoomKind, Sequence[tuple[Group, int, int]]] = {
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
"""What each kind of room holds: a group, and how many at least and at most, where they fit."""


def furnish(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The scenario with the furniture of all its rooms."""
    keep_out = _keep_out(scenario)
    furniture = [piece for room in scenario.rooms for piece in _furnished(room, keep_out, rng)]
    return replace(scenario, furniture=(*scenario.furniture, *furniture))


def _furnished(room: Room, keep_out: shapely.Geometry, rng: np.random.Generator) -> list[Furniture]:
    floor = shapely.box(*room.corners[0], *room.corners[1])
    closed = shapely.intersection(keep_out, floor)
    standing: list[tuple[shapely.Geometry, int]] = []
    pieces = []
    for group, least, most in _KINDS[room.kind]:
        for _ in range(int(rng.integers(least, most + 1))):
            for _ in range(TRIES):
                x, y, yaw_deg, wall = _somewhere(room, group, rng)
                place = affinity.translate(
                    affinity.rotate(_floor(group), yaw_deg, origin=(0, 0)), x, y
                )
                if _fits(place, wall, floor, closed, standing):
                    standing.append((place, wall))
                    pieces += _placed(group, x, y, yaw_deg)
                    break
    return pieces


def _somewhere(
    room: Room, group: Group, rng: np.random.Generator
) -> tuple[float, float, float, int]:
    """x, y, yaw and number of the wall, -1 for an island, of a random place in a room."""
    (x0, y0), (x1, y1) = room.corners
    depth, width = group.floor_m
    if group.island:
        x, y = (float(rng.uniform(low, high)) for low, high in ((x0, x1), (y0, y1)))
        return x, y, 90.0 * int(rng.integers(4)), -1
    wall, off = int(rng.integers(4)), WALL_M + depth / 2
    along_x = wall in (1, 3)
    low, high = (x0, x1) if along_x else (y0, y1)
    along = float(rng.uniform(low + width / 2 + WALL_M, high - width / 2 - WALL_M))
    # The walls in the west, south, east and north; x of the group points away from each.
    spots = (
        (x0 + off, along, 0.0),
        (along, y0 + off, 90.0),
        (x1 - off, along, 180.0),
        (along, y1 - off, 270.0),
    )
    return (*spots[wall], wall)


def _fits(
    place: shapely.Geometry,
    wall: int,
    floor: shapely.Polygon,
    closed: shapely.Geometry,
    standing: Sequence[tuple[shapely.Geometry, int]],
) -> bool:
    if shapely.intersects(place, closed) or not shapely.contains(floor, place):
        return False
    if wall < 0 and shapely.distance(floor.exterior, place) < WAY_M:
        return False
    return all(
        shapely.distance(other, place) > (BESIDE_M if wall == beside >= 0 else WAY_M)
        for other, beside in standing
    )


def _placed(group: Group, x: float, y: float, yaw_deg: float) -> list[Furniture]:
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    return [
        Furniture(
            kind=kind,
            at=(round(x + cos * along - sin * aside, 4), round(y + sin * along + cos * aside, 4)),
            yaw_deg=math.remainder(yaw_deg + turn_deg, 360.0),
            size_m=group.sizes_m.get(kind),
        )
        for kind, along, aside, turn_deg in group.parts
    ]


def _floor(group: Group) -> shapely.Geometry:
    depth, width = group.floor_m
    return shapely.box(-depth / 2, -width / 2, depth / 2, width / 2)


def _keep_out(scenario: Scenario) -> shapely.Geometry:
    """Where no furniture may stand: before doors, and around all that the file places but walls."""
    spots = [(spot, DOOR_M) for spot in doors(scenario)]
    spots += [
        (spot, KEEP_OFF_M)
        for spot in (scenario.start[:2], *scenario.goals, *(sheet.at for sheet in scenario.prints))
    ]
    shapes = [shapely.Point(spot).buffer(room_m) for spot, room_m in spots]
    ways = [
        person.points if len(person.points) > 1 else person.points * 2 for person in scenario.people
    ]
    shapes += [shapely.LineString(way).buffer(KEEP_OFF_M) for way in ways]
    things = (*items(scenario), *(thing for thing in obstacles(scenario) if thing.name != "wall"))
    shapes += [
        shapely.Polygon(outline).buffer(WAY_M) for thing in things for outline in thing.outlines()
    ]
    shapes += [shapely.Polygon(marking.polygon).buffer(WAY_M) for marking in scenario.markings]
    return shapely.union_all(shapes)
