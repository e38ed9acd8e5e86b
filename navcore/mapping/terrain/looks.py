"""Looks: what one depth image says of the slope, steps and roughness of the ground around it.

All of it are differences of heights within one image, against gravity by the accelerometer. Heights
themselves are not kept: odometry has none, and the constant error of an accelerometer (0.2°) adds
up to 17 cm in 50 m, which would be a step where a loop closes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from navcore.compiled import compiled
from navcore.config.mapping import TerrainConfig
from navcore.geometry.arrays import FloatImage, Floats, Indices
from navcore.geometry.camera import Pinhole, column_slope, point_on_ray, row_slope
from navcore.robot.frame import Frame

VALUES = 6
"""Number of values of a look: 1, rise per metre along x and along y, squared roughness, whether a
step could be measured, and its height in metres."""
REACH = 2
"""Cells on every side of a cell to which its plane is fitted."""


class TerrainLooks(NamedTuple):
    """Looks at the cells of a grid that begins at the origin of the map frame."""

    cells: Indices
    """(N, 2) cells (row, col), which may be negative."""
    values: Floats
    """(N, 6) `VALUES`, with the slope in the map frame."""


class _Grid(NamedTuple):
    """Part of the grid around the camera, as compiled kernels take it."""

    cell_m: float
    top: int
    left: int
    side: int


def terrain_looks(
    frame: Frame,
    ground_m: FloatImage,
    object_height_m: float,
    rules: TerrainConfig,
    cell_m: float,
) -> TerrainLooks:
    """Return what a frame, placed in the map, says of the ground in cells of side `cell_m`.

    `ground_m`: (H, W) of `ground.ground_heights`; a cell with a measurement farther than
    `object_height_m` above or below it holds an object or a drop and no ground.
    """
    T_map_camera, reach = frame.T_map_camera, math.ceil(rules.max_range_m / cell_m) + 1
    x_m, y_m = T_map_camera[:2, 3]
    grid = _Grid(
        cell_m=cell_m,
        top=math.floor(y_m / cell_m) - reach,
        left=math.floor(x_m / cell_m) - reach,
        side=2 * reach + 1,
    )
    heights = _cell_heights(
        frame.depth_m,
        ground_m,
        T_map_camera,
        frame.intrinsics.pinhole,
        grid,
        (rules.max_range_m, object_height_m),
        rules.min_pixels,
    )
    tilt = frame.pose.matrix()[:2, :2] @ tilt_slope(frame)
    cells, values = _fit(heights, cell_m, rules.min_cells, (float(tilt[0]), float(tilt[1])))
    return TerrainLooks(cells + np.array([grid.top, grid.left]), values)


def tilt_slope(frame: Frame) -> Floats:
    """Return the (2,) rise per metre along x and y of the base frame of the plane on which the
    robot stands."""
    upward = frame.T_level_base[2]
    slope: Floats = upward[:2] / upward[2]
    return slope


@compiled
def _cell_heights(
    depth_m: FloatImage,
    ground_m: FloatImage,
    t: Floats,
    lens: Pinhole,
    grid: _Grid,
    limits: tuple[float, float],
    min_pixels: int,
) -> Floats:
    """Return the (side, side) mean height of the ground in each cell above the plane on which the
    robot stands; NaN where there are too few pixels, or an object.

    `limits` are the range and the height of an object.
    """
    max_range_m, object_height_m = limits
    side = grid.side
    total, count = np.zeros((side, side)), np.zeros((side, side), dtype=np.int32)
    for i in range(depth_m.shape[0]):
        b = row_slope(i, lens)
        for j in range(depth_m.shape[1]):
            depth = depth_m[i, j]
            if not 0 < depth <= max_range_m:
                continue
            x, y, z = point_on_ray(t, column_slope(j, lens), b, depth)
            row = math.floor(y / grid.cell_m) - grid.top
            col = math.floor(x / grid.cell_m) - grid.left
            if not (0 <= row < side and 0 <= col < side):
                continue
            if abs(z - ground_m[i, j]) > object_height_m:
                count[row, col] = -(1 << 30)  # no ground, however many pixels follow
            else:
                total[row, col] += z
                count[row, col] += 1
    return np.where(count >= min_pixels, total / np.maximum(count, 1), np.nan)


@compiled
def _fit(
    heights: Floats, cell_m: float, min_cells: int, tilt: tuple[float, float]
) -> tuple[Indices, Floats]:
    """Return the (N, 2) cells with a plane through at least `min_cells` heights around them, and
    their (N, 6) values; `tilt` is the rise per metre along x and y of the plane above which the
    heights are."""
    side, found = heights.shape[0], 0
    cells, values = np.empty((side * side, 2), dtype=np.int64), np.zeros((side * side, VALUES))
    for row in range(REACH, side - REACH):
        for col in range(REACH, side - REACH):
            here = heights[row, col]
            if np.isnan(here):
                continue
            n, x, y, z = 0, 0.0, 0.0, 0.0
            xx, xy, yy, xz, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(-REACH, REACH + 1):
                for j in range(-REACH, REACH + 1):
                    h = heights[row + i, col + j] - here
                    if np.isnan(h):
                        continue
                    n += 1
                    x, y, z = x + j, y + i, z + h
                    xx, xy, yy = xx + j * j, xy + i * j, yy + i * i
                    xz, yz, zz = xz + j * h, yz + i * h, zz + h * h
            if n < min_cells:
                continue
            xx, xy, yy = xx - x * x / n, xy - x * y / n, yy - y * y / n
            xz, yz, zz = xz - x * z / n, yz - y * z / n, zz - z * z / n
            determinant = xx * yy - xy * xy
            if determinant < 1.0:  # cells in a line
                continue
            across = (yy * xz - xy * yz) / determinant
            along = (xx * yz - xy * xz) / determinant
            step = -1.0
            for i, j in ((0, 1), (1, 0)):
                rise = abs(
                    heights[row + i, col + j]
                    - heights[row - i, col - j]
                    + 2 * cell_m * (j * tilt[0] + i * tilt[1])
                )
                step = rise if rise > step else step  # never true of NaN
            cells[found, 0], cells[found, 1] = row, col
            values[found, 0] = 1
            values[found, 1] = across / cell_m + tilt[0]
            values[found, 2] = along / cell_m + tilt[1]
            values[found, 3] = max(zz - across * xz - along * yz, 0.0) / n
            if step >= 0:
                values[found, 4], values[found, 5] = 1, step
            found += 1
    return cells[:found].copy(), values[:found].copy()
