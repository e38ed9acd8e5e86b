"""Kernels of the person detector: the pixels of a depth image on a coarse grid around the camera,
and what its cells showed before."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined
from navcore.geometry.arrays import Bools, FloatImage, Floats, Indices
from navcore.geometry.camera import Pinhole, column_slope, point_on_ray, row_slope

SIDE = 128
"""Number of cells along each side of the grid; beyond, its memory repeats itself."""
FIXED, MOVABLE, NEW = range(1, 4)
"""Kinds of occupied cells: for long, for a while, and where floor was shortly before."""
_TOGETHER = 16
"""Number of columns of the image that are copied together."""

Counts = npt.NDArray[np.int32]
Mask = npt.NDArray[np.uint8]


class GridLimits(NamedTuple):
    """Ranges and heights in metres, as compiled kernels take them."""

    cell_m: float
    max_range_m: float
    floor_range_m: float
    body_low_m: float
    body_high_m: float
    floor_m: float
    fill_m: float


class CellMemory(NamedTuple):
    """What the cells around the camera showed, by row and column modulo `SIDE`."""

    owner: Indices
    """Cell of the map that an entry is about."""
    free_s: Floats
    """Time at which it showed floor last; −∞ for never."""
    occupied_s: Floats
    """Time since which it has been occupied; ∞ when it is not."""


@compiled
def bin_pixels(
    depth_m: FloatImage,
    ground_m: FloatImage,
    is_person: Bools,
    t: Floats,
    lens: Pinhole,
    limits: GridLimits,
    origin: Indices,
    counts: Counts,
    sums: Floats,
) -> None:
    """Count the pixels of bodies, of people and of floor in each cell, add up x and y and find the
    greatest height; every second column is evaluated."""
    height, width = depth_m.shape
    # A column of the image lies in as many cache lines as it has rows: some are copied together.
    depths = np.empty((_TOGETHER, height), dtype=np.float32)
    grounds = np.empty((_TOGETHER, height), dtype=np.float32)
    points, cells = np.zeros((3, height + 1)), np.empty((2, height), dtype=np.int64)
    for first in range(0, width, 2 * _TOGETHER):
        columns = min(_TOGETHER, (width - first + 1) // 2)
        for i in range(height):
            for n in range(columns):
                depths[n, i] = depth_m[i, first + 2 * n]
                grounds[n, i] = ground_m[i, first + 2 * n]
        for n in range(columns):
            j = first + 2 * n
            _column(depths[n], grounds[n], column_slope(j, lens), t, lens, limits, points, cells)
            _bin_column(depths[n], points, cells, is_person[:, j], limits, origin, counts, sums)


@inlined
def _column(
    depths: Floats,
    grounds: Floats,
    a: float,
    t: Floats,
    lens: Pinhole,
    limits: GridLimits,
    points: Floats,
    cells: Indices,
) -> None:
    """Write (3, H) x, y and height above the ground of the pixels of a column, and (2, H) the
    columns and rows of their cells; free of branches, so that the compiler vectorises it."""
    for i in range(len(depths)):
        x, y, z = point_on_ray(t, a, row_slope(i, lens), depths[i])
        points[0, i], points[1, i], points[2, i] = x, y, z - grounds[i]
        cells[0, i] = np.int64(math.floor(x / limits.cell_m))
        cells[1, i] = np.int64(math.floor(y / limits.cell_m))


@inlined
def _bin_column(
    depths: Floats,
    points: Floats,
    cells: Indices,
    is_person: Bools,
    limits: GridLimits,
    origin: Indices,
    counts: Counts,
    sums: Floats,
) -> None:
    """Add the pixels of one column, from below upwards; between floor pixels that are near to each
    other the floor continues."""
    cell_m, floor_before = limits.cell_m, False
    half_cell, fill = (cell_m / 2) ** 2, limits.fill_m**2
    for i in range(len(depths) - 1, -1, -1):
        if not 0 < depths[i] <= limits.max_range_m:
            floor_before = False
            continue
        x, y, z = points[0, i], points[1, i], points[2, i]
        col, row = cells[0, i] - origin[0], cells[1, i] - origin[1]
        in_grid = 0 <= row < SIDE and 0 <= col < SIDE
        if abs(z) < limits.floor_m and depths[i] <= limits.floor_range_m:
            if in_grid:
                counts[row, col, 2] += 1
            to_x, to_y = points[0, i + 1] - x, points[1, i + 1] - y
            squared = to_x * to_x + to_y * to_y
            if floor_before and half_cell < squared < fill:
                steps = math.ceil(2 * math.sqrt(squared) / cell_m)
                for step in range(1, steps):
                    share = step / steps
                    col = math.floor((x + share * to_x) / cell_m) - origin[0]
                    row = math.floor((y + share * to_y) / cell_m) - origin[1]
                    if 0 <= row < SIDE and 0 <= col < SIDE:
                        counts[row, col, 2] += 1
            floor_before = True
            continue
        floor_before = False
        if limits.body_low_m < z < limits.body_high_m and in_grid:
            counts[row, col, 0] += 1
            counts[row, col, 1] += is_person[i]
            sums[row, col, 0] += x
            sums[row, col, 1] += y
            sums[row, col, 2] = max(sums[row, col, 2], z)


@compiled
def recall_cells(
    counts: Counts,
    floor: Mask,
    inner: Mask,
    origin: Indices,
    now_s: float,
    limits: tuple[int, float, float],
    memory: CellMemory,
    kinds: Mask,
) -> None:
    """Remember what each cell shows now, and classify it.

    `floor` and `inner` are the cells that show floor and those surrounded by floor; `limits` are
    the fewest pixels of an occupied cell, and the times in seconds after which it counts as fixed
    and up to which as newly occupied.
    """
    min_pixels, fixed_s, fresh_s = limits
    owner, free_s, occupied_s = memory.owner, memory.free_s, memory.occupied_s
    for r in range(SIDE):
        for c in range(SIDE):
            row, col = r + origin[1], c + origin[0]
            at, on, cell = row % SIDE, col % SIDE, row * 1_000_003 + col
            if owner[at, on] != cell:
                owner[at, on], free_s[at, on], occupied_s[at, on] = cell, -np.inf, np.inf
            if counts[r, c, 0] >= min_pixels:
                occupied_s[at, on] = min(occupied_s[at, on], now_s)
                if now_s - occupied_s[at, on] >= fixed_s:
                    kinds[r, c] = FIXED
                else:
                    is_new = occupied_s[at, on] - free_s[at, on] < fresh_s
                    kinds[r, c] = NEW if is_new else MOVABLE
            elif floor[r, c]:
                occupied_s[at, on] = np.inf
                if inner[r, c]:
                    free_s[at, on] = now_s


@compiled
def component_totals(
    names: npt.NDArray[np.int32], total: int, kinds: Mask, counts: Counts, sums: Floats
) -> Floats:
    """Return (total, 6) for each component: pixels of bodies and of people, newly occupied cells,
    sums of x and y, and the greatest height in metres."""
    totals = np.zeros((total, 6))
    for row in range(names.shape[0]):
        for col in range(names.shape[1]):
            name = names[row, col]
            if name == 0:
                continue
            totals[name, 0] += counts[row, col, 0]
            totals[name, 1] += counts[row, col, 1]
            totals[name, 2] += kinds[row, col] == NEW
            totals[name, 3] += sums[row, col, 0]
            totals[name, 4] += sums[row, col, 1]
            totals[name, 5] = max(totals[name, 5], sums[row, col, 2])
    return totals
