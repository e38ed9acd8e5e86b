"""Ground that a robot cannot drive on: edges higher than its largest step, slopes beyond its limit,
and bumps higher than its largest step.

Each edge is judged by itself: a flight of steps that are all lower than the limit is floor.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.robot.profile import RobotProfile
from sim.models.ground import Ground
from sim.models.raised_ground import RaisedGround
from sim.models.solids import Polygon, rectangle
from sim.scenario.schema import Scenario

EDGE_M = 0.01
"""Half of the width of the strip that stands for an edge: more than the gap that the physics engine
keeps between a body and what it is pressed against."""
SAMPLE_M = 0.05
"""Distance between two heights along the side of a raised part."""
BESIDE_M = 1e-3
"""Distance from the side of a raised part at which the heights inside and outside are taken."""
HILL_CELL_M = 0.5
"""Side of the cells in which the slope of hills is judged; the shortest wave is 5 m long."""
ROUNDING = 1e-6
"""Excess of a height in metres or of a slope that is none."""

Kind = Literal["edge", "steep slope", "rough ground"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UntraversableGround:
    """All ground of a world that is untraversable for one reason."""

    kind: Kind
    """The reason, as in reports."""
    outlines: tuple[Polygon, ...]
    """(N, 2) outlines in metres of the map frame."""


def untraversable_ground(
    scenario: Scenario, robot: RobotProfile
) -> tuple[UntraversableGround, ...]:
    """Return the ground beyond `max_step_m` and `max_slope` of a robot, by kind; empty where it can
    drive everywhere."""
    ground = Ground(scenario.relief, scenario.raised)
    by_kind: dict[Kind, list[Polygon]] = {
        "edge": list(_edges(ground, robot.max_step_m)),
        "steep slope": [
            *_top_sides(ground.raised, [_is_steep(part, robot) for part in ground.raised]),
            *_steep_hills(scenario, ground, robot.max_slope),
        ],
        "rough ground": list(
            _top_sides(
                ground.raised,
                [part.bumps_m > robot.max_step_m + ROUNDING for part in ground.raised],
            )
        ),
    }
    return tuple(
        UntraversableGround(kind=kind, outlines=tuple(outlines))
        for kind, outlines in by_kind.items()
        if outlines
    )


def _edges(ground: Ground, max_step_m: float) -> Iterator[Polygon]:
    """Yield strips along the sides of raised parts where the height changes by more than a step."""
    for part in ground.raised:
        corners = part.outline()
        for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            along = end - begin
            length_m = float(np.hypot(*along))
            outward = BESIDE_M / length_m * np.array([along[1], -along[0]])
            count = math.ceil(length_m / SAMPLE_M)
            middles = begin + (np.arange(count)[:, None] + 0.5) / count * along
            steps_m = ground.heights(middles + outward) - ground.heights(middles - outward)
            for first, last in _runs(np.abs(steps_m) > max_step_m + ROUNDING):
                middle = begin + (first + last) / 2 / count * along
                strip = rectangle((last - first) / count * length_m + 2 * EDGE_M, 2 * EDGE_M)
                yaw_rad = math.atan2(along[1], along[0])
                yield Pose2(x_m=middle[0], y_m=middle[1], yaw_rad=yaw_rad).to_parent(strip)


def _is_steep(part: RaisedGround, robot: RobotProfile) -> bool:
    """Return whether a part rises by more than a step, and more steeply than the limit."""
    rise_m = abs(part.height_m[1] - part.height_m[0])
    return rise_m > max(robot.max_step_m, robot.max_slope * part.size_m[0]) + ROUNDING


def _top_sides(parts: Sequence[RaisedGround], chosen: Sequence[bool]) -> Iterator[Polygon]:
    """Yield the outlines of the chosen parts without what other parts cover."""
    for part in (part for part, is_chosen in zip(parts, chosen, strict=True) if is_chosen):
        top: BaseGeometry = shapely.Polygon(part.outline())
        for other in parts:
            if other is not part and _is_below(part, other):
                top = shapely.difference(top, shapely.Polygon(other.outline()))
        for piece in shapely.get_parts(top):
            if piece.area > 0:
                yield shapely.get_coordinates(piece.exterior)[:-1]


def _is_below(part: RaisedGround, other: RaisedGround) -> bool:
    """Return whether a part is nowhere higher than another where they overlap, and somewhere
    lower, without bumps."""
    both = shapely.intersection(shapely.Polygon(part.outline()), shapely.Polygon(other.outline()))
    if not both.area > 0:
        return False
    # Both tops are planes, and the overlap is convex: its corners tell.
    low, high = (
        dataclasses.replace(one, bumps_m=0.0).heights(
            one.pose.from_parent(shapely.get_coordinates(both))
        )
        for one in (part, other)
    )
    return bool((low <= high + ROUNDING).all() and (low < high - ROUNDING).any())


def _steep_hills(scenario: Scenario, ground: Ground, max_slope: float) -> Iterator[Polygon]:
    """Yield boxes around the cells in which hills are too steep."""
    if scenario.relief is None or scenario.relief.slope <= max_slope:
        return
    spec = GridSpec.centred(size_m=scenario.size_m, resolution_m=HILL_CELL_M)
    for row in range(spec.rows):
        cells = np.column_stack([np.full(spec.cols, row), np.arange(spec.cols)])
        centres = spec.centres(cells)
        steep = np.hypot(*ground.slopes(centres).T) > max_slope + ROUNDING
        for first, last in _runs(steep):
            middle = (centres[first] + centres[last - 1]) / 2
            yield rectangle((last - first) * HILL_CELL_M, HILL_CELL_M) + middle


def _runs(mask: npt.NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield first and end of each run of True."""
    changes = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    yield from ((first, end) for first, end in changes.reshape(-1, 2).tolist())
