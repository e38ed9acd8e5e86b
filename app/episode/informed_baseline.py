"""The informed baseline: the path of an ideal driver with the robot's field of view.

The driver follows the paper's rule that unknown is free and plans the whole shortest path at every
frame, as the navigator does. It observes everything in view at once and without error, drives
exactly along the path, and meets no people. Where even this driver enters dead ends, better driving
cannot make the path as short as one that is planned on the known map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.grid.cell_mask import CellMask
from navcore.grid.free_space import FREE
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.grid.inflation import InflatedGrid
from navcore.grid.nearest import nearest_free
from navcore.planning.path import NoPath
from navcore.planning.replanner import Replanner
from navcore.planning.string_pulling import taut_corners

STEP_M, TURN_RAD = 0.1, 0.15
"""Largest motion from one frame to the next, metres and radians: 1 m/s and 1.5 rad/s at 10 Hz."""
TURN_IN_PLACE_RAD = 0.6
"""Heading error above which the driver turns in place, radians."""
MAX_ESCAPE_M = 0.6
"""Largest distance from a start inside the inflation to a free cell, metres."""
MAX_STEPS = 100_000
"""Largest number of frames for one goal; no path on a supported map needs more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorModel:
    """Field of view of the camera."""

    ahead_m: float
    """Distance of the camera in front of the robot's centre, metres."""
    angle_rad: float
    """Horizontal field of view, radians."""
    range_m: float
    """Largest distance that is observed, metres."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrueGrids:
    """The true world, one bool grid (rows, cols) per kind."""

    high: BoolGrid
    """Obstacles that hide what is behind them."""
    low: BoolGrid
    """Objects and markings that the camera sees over."""
    zones: BoolGrid
    """Keep-out zones, which are known from the beginning."""


def ideal_path_m(
    true: TrueGrids,
    spec: GridSpec,
    start: Pose2,
    goals: Sequence[tuple[float, float]],
    *,
    sensor: SensorModel,
    inflation_m: float,
) -> float | None:
    """Return the length in metres of the driver's path from the start through all goals; None where
    there is none."""
    driver = _InformedDriver(true, spec, sensor, inflation_m)
    here, path_m = start, 0.0
    for goal in goals:
        arrived = driver.drive(here, goal)
        if arrived is None:
            return None
        here, path_m = arrived[0], path_m + arrived[1]
    return path_m


class _InformedDriver:
    """The ideal driver: the grid observed so far, and the shortest path on it."""

    def __init__(
        self, true: TrueGrids, spec: GridSpec, sensor: SensorModel, inflation_m: float
    ) -> None:
        self._true, self._spec, self._sensor = true, spec, sensor
        self._seen, self._radius = true.zones.copy(), math.ceil(inflation_m / spec.resolution_m)
        self._grid = InflatedGrid(spec.rows, spec.cols)
        self._grid.update({self._radius: true.zones})
        self._replanner = Replanner(self._grid.space)

    def drive(self, here: Pose2, goal: tuple[float, float]) -> tuple[Pose2, float] | None:
        """Return the final pose and the length of the path in metres; None without a path."""
        path_m = 0.0
        for _ in range(MAX_STEPS):
            self._observe(here)
            ahead = self._next_corner(here, goal)
            if ahead is None:
                return None
            distance_m = here.distance_to(*ahead)
            bearing = math.atan2(ahead[1] - here.y_m, ahead[0] - here.x_m)
            if distance_m < 1e-6:
                return here, path_m
            turn = wrap_angle(bearing - here.yaw_rad)
            step_m = min(STEP_M, distance_m) if abs(turn) <= TURN_IN_PLACE_RAD else 0.0
            path_m += step_m
            here = Pose2(
                x_m=here.x_m + step_m * math.cos(bearing),
                y_m=here.y_m + step_m * math.sin(bearing),
                yaw_rad=here.yaw_rad + max(-TURN_RAD, min(TURN_RAD, turn)),
            )
        return None

    def _observe(self, here: Pose2) -> None:
        spec, sensor = self._spec, self._sensor
        x_m = here.x_m + sensor.ahead_m * math.cos(here.yaw_rad)
        y_m = here.y_m + sensor.ahead_m * math.sin(here.yaw_rad)
        row = (y_m - spec.origin_y_m) / spec.resolution_m
        col = (x_m - spec.origin_x_m) / spec.resolution_m
        reach = sensor.range_m / spec.resolution_m
        new = _newly_seen(
            self._true.high,
            self._true.low,
            self._seen,
            row,
            col,
            here.yaw_rad,
            sensor.angle_rad / 2,
            reach,
        )
        if len(new):
            self._grid.set_cells(self._radius, new, True)

    def _next_corner(self, here: Pose2, goal: tuple[float, float]) -> tuple[float, float] | None:
        """Return (x, y) of the shortest path's next corner, or the goal; None without a path."""
        spec, space = self._spec, self._grid.space
        cell, end = spec.cell(here.x_m, here.y_m), spec.cell(*goal)
        if cell == end:
            return goal
        if not (space.contains(cell) and space.is_free(cell)):
            plane = CellMask.copied(space.across[FREE], spec.rows, spec.cols)
            escape = nearest_free(plane, cell, MAX_ESCAPE_M / spec.resolution_m)
            return None if escape is None or escape == cell else spec.centre(*escape)
        path = self._replanner.plan(cell, end)
        if isinstance(path, NoPath):
            return None
        corners = taut_corners(path.cells, space.across[FREE])
        return goal if len(corners) < 3 else spec.centre(*corners[1].tolist())


@compiled
def _newly_seen(
    high: BoolGrid,
    low: BoolGrid,
    seen: BoolGrid,
    row: float,
    col: float,
    yaw: float,
    half_angle: float,
    reach: float,
) -> npt.NDArray[np.int64]:
    """Return (N, 2) the occupied cells in view that were not seen before, and mark them as seen."""
    rows, cols = high.shape
    found, count = np.empty((int(4 * (reach + 1) ** 2), 2), dtype=np.int64), 0
    rays = int(4 * half_angle * reach) + 1
    for ray in range(rays):
        angle = yaw - half_angle + ray * 2 * half_angle / rays
        for step in range(int(2 * reach)):
            i = math.floor(row + 0.5 * step * math.sin(angle))
            j = math.floor(col + 0.5 * step * math.cos(angle))
            if not (0 <= i < rows and 0 <= j < cols):
                break
            if (high[i, j] or low[i, j]) and not seen[i, j]:
                seen[i, j] = True
                found[count, 0], found[count, 1] = i, j
                count += 1
            if high[i, j]:
                break
    return found[:count]
