"""The pose of a window at which most points of a scan lie on surfaces, by trying all in steps
(correlative matching, Olson 2009)."""

from __future__ import annotations

import math

import numpy as np

from navcore.compiled import compiled
from navcore.geometry.arrays import Bools, Floats
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.scans.surface_grid import (
    HITS,
    SECTORS,
    TILE,
    WEIGHT,
    SurfaceGrid,
    X,
    Y,
    tile_at,
)

STEP_M = 0.1
"""Step in metres; headings are turned so far that the farthest point moves by as much."""
_POINTS = 100
"""Number of points that are taken of a scan."""


def coarse_pose(
    grid: SurfaceGrid, points: Floats, expected: Pose2, window: tuple[float, float]
) -> Pose2:
    """Return the best pose, the nearest to the expected one of equal ones.

    `points` are (N, 2) in the frame of the robot, at least one; `window` is half its edge in metres
    and half its range of headings in radians.
    """
    window_m, window_rad = window
    reach_m = float(np.max(np.linalg.norm(points, axis=1)))
    half_m = reach_m + window_m + 2 * STEP_M
    cells = math.ceil(2 * half_m / STEP_M)
    x0, y0 = expected.x_m - half_m, expected.y_m - half_m
    step_rad = STEP_M / max(reach_m, 1.0)
    x, y, yaw = _best_pose(
        _occupied(grid, x0, y0, cells, STEP_M),
        np.array(points[:: max(len(points) // _POINTS, 1)]),
        (expected.x_m - x0, expected.y_m - y0, expected.yaw_rad),
        (math.ceil(window_m / STEP_M), math.ceil(window_rad / step_rad)),
        step_rad,
    )
    return Pose2(x_m=x0 + x, y_m=y0 + y, yaw_rad=wrap_angle(yaw))


@compiled
def _occupied(grid: SurfaceGrid, x0: float, y0: float, cells: int, step_m: float) -> Bools:
    """Return (cells, cells) whether a surface lies in a cell or beside it."""
    image = np.zeros((cells, cells), dtype=np.bool_)
    row0, col0 = math.floor(y0 / grid.cell_m), math.floor(x0 / grid.cell_m)
    count = math.ceil(cells * step_m / grid.cell_m) + 1
    for row in range(row0, row0 + count):
        for col in range(col0, col0 + count):
            tile = tile_at(grid, row, col)
            if tile < 0:
                continue
            for sector in range(SECTORS):
                surface = grid.heads[tile, row % TILE, col % TILE, sector]
                if surface < 0 or grid.sums[surface, HITS] < 1:
                    continue
                sums = grid.sums[surface]
                i = int((sums[Y] / sums[WEIGHT] - y0) / step_m)
                j = int((sums[X] / sums[WEIGHT] - x0) / step_m)
                for di in range(max(i - 1, 0), min(i + 2, cells)):
                    for dj in range(max(j - 1, 0), min(j + 2, cells)):
                        image[di, dj] = True
    return image


@compiled
def _best_pose(
    image: Bools,
    points: Floats,
    centre: tuple[float, float, float],
    window: tuple[int, int],
    step_rad: float,
) -> tuple[float, float, float]:
    """Return the pose in metres of the image with the most points on surfaces; of equal ones the
    nearest to the centre."""
    steps, turns = window
    count = len(points)
    rows, cols = np.empty(count), np.empty(count)
    best_score, best_cost = -1, 0
    best = centre
    for turn in range(-turns, turns + 1):
        yaw = centre[2] + turn * step_rad
        cos, sin = math.cos(yaw), math.sin(yaw)
        for k in range(count):
            cols[k] = (centre[0] + cos * points[k, 0] - sin * points[k, 1]) / STEP_M
            rows[k] = (centre[1] + sin * points[k, 0] + cos * points[k, 1]) / STEP_M
        for dr in range(-steps, steps + 1):
            for dc in range(-steps, steps + 1):
                score = 0
                for k in range(count):
                    i, j = int(rows[k]) + dr, int(cols[k]) + dc
                    if 0 <= i < image.shape[0] and 0 <= j < image.shape[1] and image[i, j]:
                        score += 1
                cost = dr * dr + dc * dc + turn * turn
                if score > best_score or (score == best_score and cost < best_cost):
                    best_score, best_cost = score, cost
                    best = (centre[0] + dc * STEP_M, centre[1] + dr * STEP_M, yaw)
    return best
