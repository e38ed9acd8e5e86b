"""Layout of a scenario: each object with its key in the file, its pose and its solids."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from navcore.geometry.polyline import metres_along
from navcore.geometry.transform import Pose2
from sim.models.solids import Polygon, Solid
from sim.scenario.schema import Scenario, Wall

OVERHEAD_M = 0.8
"""Height above which solids are out of reach of the robot."""
ORIGIN = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedObject:
    """An object that stands or lies in the world."""

    key: str
    """Key in the scenario file, e.g. `furniture[3]`."""
    name: str
    """Kind of the object."""
    pose: Pose2
    """T_map_object."""
    solids: tuple[Solid, ...]
    """Solids in the frame of the object."""

    def outlines(self) -> tuple[Polygon, ...]:
        """Return the convex outlines in the map frame of all parts that the robot could touch."""
        return tuple(
            self.pose.to_parent(solid.outline())
            for solid in self.solids
            if solid.bottom_m < OVERHEAD_M
        )


def obstacles(scenario: Scenario) -> tuple[PlacedObject, ...]:
    """Return walls and furniture."""
    walls = (
        PlacedObject(key=f"walls[{i}]", name="wall", pose=ORIGIN, solids=_wall(wall))
        for i, wall in enumerate(scenario.walls)
    )
    furniture = (
        PlacedObject(
            key=f"furniture[{i}]",
            name=piece.kind,
            pose=_pose(piece.at, piece.yaw_deg),
            solids=piece.solids(),
        )
        for i, piece in enumerate(scenario.furniture)
    )
    return (*walls, *furniture)


def items(scenario: Scenario) -> tuple[PlacedObject, ...]:
    """Return the items on the floor."""
    return tuple(
        PlacedObject(
            key=f"items[{i}]",
            name=item.kind,
            pose=_pose(item.at, item.yaw_deg),
            solids=item.solids(),
        )
        for i, item in enumerate(scenario.items)
    )


def _pose(at: tuple[float, float], yaw_deg: float) -> Pose2:
    return Pose2(x_m=at[0], y_m=at[1], yaw_rad=math.radians(yaw_deg))


def _wall(wall: Wall) -> tuple[Solid, ...]:
    """Return a box for each straight piece of wall between doors; it extends round a corner by half
    its thickness, but not into a door."""
    last, closed = len(wall.points) - 2, wall.points[0] == wall.points[-1]
    boxes, from_m = [], 0.0
    for i, ((x0, y0), (x1, y1)) in enumerate(pairwise(wall.points)):
        length, reach = math.hypot(x1 - x0, y1 - y0), wall.thickness_m / 2
        first = -reach if i > 0 or closed else 0.0
        end = length + (reach if i < last or closed else 0.0)
        for begin, stop in _between_doors(wall, first, end, from_m):
            along = (begin + stop) / 2 / length
            boxes.append(
                Solid(
                    kind="box",
                    size_m=(stop - begin, wall.thickness_m, wall.height_m),
                    centre_m=(x0 + along * (x1 - x0), y0 + along * (y1 - y0), wall.height_m / 2),
                    colour=wall.colour,
                    yaw_rad=math.atan2(y1 - y0, x1 - x0),
                )
            )
        from_m += length
    return tuple(boxes)


def _between_doors(
    wall: Wall, first: float, end: float, from_m: float
) -> list[tuple[float, float]]:
    """Return what the doors leave of the straight piece from `first` to `end`, which begins
    `from_m` along the run."""
    ends = [first]
    for door in sorted(door - from_m for door in wall.doors_m):
        if first < door < end:
            ends += [door - wall.door_m / 2, door + wall.door_m / 2]
    ends.append(end)
    return [(a, b) for a, b in zip(ends[::2], ends[1::2], strict=True) if b > a]


def doors(scenario: Scenario) -> tuple[tuple[float, float], ...]:
    """Return x, y of the middle of every door of the walls."""
    return tuple(door for wall in scenario.walls for door in _doors_of(wall))


def _doors_of(wall: Wall) -> list[tuple[float, float]]:
    points = np.array(wall.points, dtype=np.float64)
    along = metres_along(points)
    return [
        (float(np.interp(d, along, points[:, 0])), float(np.interp(d, along, points[:, 1])))
        for d in wall.doors_m
    ]
