"""The way of a driver without faults who sees no more than the robot: what a way through an unknown
world can be held against.

He follows the paper's rule that unknown is free and plans the shortest path in full at every
picture, as the navigator does. He sees at once and without error whatever stands in his view,
drives exactly along the path, and nobody walks in his way. Where even he drives into dead ends,
better driving does not bring the way nearer to that of somebody who knows the map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Pose2, wrap_angle
from navcore.grid.cell_mask import CellMask
from navcore.grid.free_space import FREE
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.grid.inflation import InflatedGrid
from navcore.grid.nearest import nearest_free
from navcore.planning.path import NoPath
from navcore.planning.replanner import Replanner
from navcore.planning.route import TAUT_M
from navcore.planning.string_pulling import shortcut

STEP_M, TURN_RAD = 0.1, 0.15
"""How far he drives and turns from one picture to the next: 1 m/s and 1.5 rad/s at 10 Hz."""
ON_THE_SPOT_RAD = 0.6
"""He turns where he stands if the way leads so far aside."""
RELIEF_M = 0.6
"""A start may be so far inside what is inflated."""
MOST_PICTURES = 100_000
"""No way through a map that can be had is as long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorModel:
    """What is in view."""

    ahead_m: float
    """How far in front of the robot's middle the camera is."""
    angle_rad: float
    """Of view, across."""
    range_m: float
    """Nothing farther is seen."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrueGrids:
    """What truly stands and lies there; bool (rows, cols) each."""

    tall: BoolGrid
    """Hides what is behind it."""
    low: BoolGrid
    """Things and markings that one sees over."""
    known: BoolGrid
    """Where he must not be and knows it from the beginning: zones."""


def ideal_way_m(
    true: TrueGrids,
    spec: GridSpec,
    start: Pose2,
    goals: Sequence[tuple[float, float]],
    *,
    eyes: SensorModel,
    inflation_m: float,
) -> float | None:
    """Length of his way from the start through all goals in metres; None where there is none."""
    driver = _Driver(true, spec, eyes, inflation_m)
    here, way_m = start, 0.0
    for goal in goals:
        arrived = driver.drive(here, goal)
        if arrived is None:
            return None
        here, way_m = arrived[0], way_m + arrived[1]
    return way_m


class _Driver:
    """What he has seen so far, and the shortest path over it."""

    def __init__(
        self, true: TrueGrids, spec: GridSpec, eyes: SensorModel, inflation_m: float
    ) -> None:
        self._true, self._spec, self._eyes = true, spec, eyes
        self._seen, self._radius = true.known.copy(), math.ceil(inflation_m / spec.resolution_m)
        self._grid = InflatedGrid(spec.rows, spec.cols)
        self._grid.update({self._radius: true.known})
        self._replanner = Replanner(self._grid.space)

    def drive(self, here: Pose2, goal: tuple[float, float]) -> tuple[Pose2, float] | None:
        """Where he stands in the end and how long his way was; None where he finds none."""
        way_m = 0.0
        for _ in range(MOST_PICTURES):
            self._look(here)
            ahead = self._corner_ahead(here, goal)
            if ahead is None:
                return None
            away_m, towards = (
                here.distance_to(*ahead),
                math.atan2(ahead[1] - here.y_m, ahead[0] - here.x_m),
            )
            if away_m < 1e-6:
                return here, way_m
            turn = wrap_angle(towards - here.yaw_rad)
            step_m = min(STEP_M, away_m) if abs(turn) <= ON_THE_SPOT_RAD else 0.0
            way_m += step_m
            here = Pose2(
                x_m=here.x_m + step_m * math.cos(towards),
                y_m=here.y_m + step_m * math.sin(towards),
                yaw_rad=here.yaw_rad + max(-TURN_RAD, min(TURN_RAD, turn)),
            )
        return None

    def _look(self, here: Pose2) -> None:
        spec, eyes = self._spec, self._eyes
        x_m, y_m = (
            here.x_m + eyes.ahead_m * math.cos(here.yaw_rad),
            here.y_m + eyes.ahead_m * math.sin(here.yaw_rad),
        )
        row, col = (
            (y_m - spec.origin_y_m) / spec.resolution_m,
            (x_m - spec.origin_x_m) / spec.resolution_m,
        )
        reach = eyes.range_m / spec.resolution_m
        new = _newly_seen(
            self._true.tall,
            self._true.low,
            self._seen,
            row,
            col,
            here.yaw_rad,
            eyes.angle_rad / 2,
            reach,
        )
        if len(new):
            self._grid.set_cells(self._radius, new, True)

    def _corner_ahead(self, here: Pose2, goal: tuple[float, float]) -> tuple[float, float] | None:
        """(x, y) the next corner of the shortest way, or the goal; None without a way."""
        spec, space = self._spec, self._grid.space
        cell, end = spec.cell(here.x_m, here.y_m), spec.cell(*goal)
        if cell == end:
            return goal
        if not (space.contains(cell) and space.is_free(cell)):
            plane = CellMask.copied(space.across[FREE], spec.rows, spec.cols)
            way_out = nearest_free(plane, cell, RELIEF_M / spec.resolution_m)
            return None if way_out is None or way_out == cell else spec.centre(*way_out)
        path = self._replanner.plan(cell, end)
        if isinstance(path, NoPath):
            return None
        corners = shortcut(
            path.cells, space.across[FREE], stretch=math.ceil(TAUT_M / spec.resolution_m)
        )
        return goal if len(corners) < 3 else spec.centre(*corners[1].tolist())


@numba.njit(cache=True, nogil=True)
def _newly_seen(
    tall: BoolGrid,
    low: BoolGrid,
    seen: BoolGrid,
    row: float,
    col: float,
    yaw: float,
    half_angle: float,
    reach: float,
) -> npt.NDArray[np.int64]:
    """(N, 2) cells of what stands or lies in view and was not seen before; they are seen now."""
    rows, cols = tall.shape
    found, count = np.empty((int(4 * (reach + 1) ** 2), 2), dtype=np.int64), 0
    rays = int(4 * half_angle * reach) + 1
    for ray in range(rays):
        angle = yaw - half_angle + ray * 2 * half_angle / rays
        for step in range(int(2 * reach)):
            i, j = (
                math.floor(row + 0.5 * step * math.sin(angle)),
                math.floor(col + 0.5 * step * math.cos(angle)),
            )
            if not (0 <= i < rows and 0 <= j < cols):
                break
            if (tall[i, j] or low[i, j]) and not seen[i, j]:
                seen[i, j] = True
                found[count, 0], found[count, 1] = i, j
                count += 1
            if tall[i, j]:
                break
    return found[:count]
