"""Looks: what one depth image says of the slope, steps and roughness of the ground around it.

All of it are differences of heights within one image, against gravity by the accelerometer. Heights
themselves are not kept: odometry has none, and the constant error of an accelerometer (0.2°) adds
up to 17 cm in 50 m, which would be a step where a loop closes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined
from navcore.config.mapping import TerrainConfig
from navcore.geometry.arrays import FloatImage, Floats, Indices
from navcore.geometry.camera import Pinhole, column_slope, row_slope
from navcore.grid.runs import WORD, Codes, run_starts
from navcore.robot.frame import Frame

VALUES = 6
"""Number of values of a look: 1, rise per metre along x and along y, squared roughness, whether a
step could be measured, and its height in metres."""
REACH = 2
"""Cells on every side of a cell to which its plane is fitted."""
_UNIT_M = np.float32(1e-5)
"""Unit in metres in which heights are added up: sums of whole numbers are several times as fast as
those of real ones, and do not depend on the order."""


class TerrainLooks(NamedTuple):
    """Looks at the cells of a grid that begins at the origin of the map frame."""

    cells: Indices
    """(N, 2) cells (row, col), which may be negative."""
    values: Floats
    """(N, 6) `VALUES`, with the slope in the map frame."""


def terrain_looks(
    frame: Frame,
    ground_m: FloatImage,
    object_height_m: float,
    rules: TerrainConfig,
    cell_m: float,
) -> TerrainLooks:
    """Return what a frame, placed in the map, says of the ground in cells of side `cell_m`.

    `ground_m`: that of `ground.ground_heights`; a cell with a measurement farther than
    `object_height_m` above or below it holds an object or a drop and no ground.
    """
    affine, reach = frame.T_map_camera[:3], math.ceil(rules.max_range_m / cell_m) + 1
    left, top = np.floor(affine[:2, 3] / cell_m).astype(np.int64) - reach
    affine[:2] /= cell_m
    affine[:2, 3] -= left, top
    heights = _cell_heights(
        frame.depth_m,
        ground_m,
        affine.astype(np.float32),
        frame.intrinsics.pinhole,
        2 * reach + 1,
        np.array([rules.max_range_m, object_height_m], dtype=np.float32),
        rules.min_pixels,
    )
    tilt = frame.pose.matrix()[:2, :2] @ frame.plane_slope
    cells, values = _fit(heights, cell_m, rules.min_cells, (float(tilt[0]), float(tilt[1])))
    return TerrainLooks(cells + np.array([top, left]), values)


@compiled
def _cell_heights(
    depth_m: FloatImage,
    ground_m: FloatImage,
    affine: FloatImage,
    lens: Pinhole,
    side: int,
    limits: FloatImage,
    min_pixels: int,
) -> Floats:
    """Return the (side, side) mean height of the ground in each cell above the plane on which the
    robot stands; NaN where there are too few pixels, or an object.

    `affine` transforms from the optical frame to columns, rows and height in metres; `limits` are
    the range and the height of an object.
    """
    width = depth_m.shape[1]
    total, count = np.zeros(side * side, dtype=np.int64), np.zeros(side * side, dtype=np.int32)
    across, heights = np.empty(width, dtype=np.float32), np.empty(width, dtype=np.int32)
    codes, starts = np.full(width + 1, -2, dtype=np.int32), np.empty(width + 1, dtype=np.int32)
    changed = np.zeros((width + WORD - 1) // WORD * WORD, dtype=np.uint8)
    for j in range(width):
        across[j] = column_slope(j, lens)
    for i in range(depth_m.shape[0]):
        b = np.float32(row_slope(i, lens))
        ground = ground_m[i if len(ground_m) > 1 else 0]
        _row(depth_m[i], ground, across, b, affine, side, limits, codes, heights)
        for run in range(run_starts(codes, changed, starts, width)):
            first, end = starts[run], starts[run + 1]
            code = codes[first + 1]
            if code < 0:
                continue
            if code & 1:
                count[code >> 1] = -(1 << 30)  # no ground, however many pixels follow
                continue
            height = total[code >> 1]
            for j in range(first, end):
                height += heights[j]
            total[code >> 1] = height
            count[code >> 1] += end - first
    means = np.full((side, side), np.nan)
    for cell in range(side * side):
        if count[cell] >= min_pixels:
            means[cell // side, cell % side] = _UNIT_M * total[cell] / max(count[cell], 1)
    return means


@inlined
def _row(
    depth_m: FloatImage,
    ground_m: FloatImage,
    across: FloatImage,
    b: np.float32,
    t: FloatImage,
    side: int,
    limits: FloatImage,
    codes: Codes,
    heights: npt.NDArray[np.int32],
) -> None:
    """Write for each pixel of a row of the image its height in `_UNIT_M`, and twice its cell,
    row · side + col, plus one on an object, or −1 outside the grid; free of branches, so that the
    compiler vectorises it."""
    x0, y0, z0 = t[0, 0], t[1, 0], t[2, 0]
    x1, y1, z1 = t[0, 1] * b + t[0, 2], t[1, 1] * b + t[1, 2], t[2, 1] * b + t[2, 2]
    x3, y3, z3 = t[0, 3], t[1, 3], t[2, 3]
    zero, wide, far, object_m = np.float32(0), np.float32(side), limits[0], limits[1]
    units = np.float32(1) / _UNIT_M
    for j in range(len(across)):
        depth, a = depth_m[j], across[j]
        x, y, z = (x0 * a + x1) * depth + x3, (y0 * a + y1) * depth + y3, (z0 * a + z1) * depth + z3
        # Truncation is the floor of non-negative values; negative ones are outside.
        inside = (depth > zero) & (depth <= far) & (x >= zero) & (y >= zero) & (x < wide)
        cell = np.int32(y) * np.int32(side) + np.int32(x)
        code = np.int32(2) * cell + np.int32(abs(z - ground_m[j]) > object_m)
        inside &= y < wide
        codes[j + 1] = code if inside else np.int32(-1)
        heights[j] = np.int32(z * units) if inside else np.int32(0)


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
