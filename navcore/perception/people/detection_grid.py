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
_NEITHER, _FLOOR, _BODY = (np.uint8(kind) for kind in range(3))
"""What a pixel shows."""

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
    """Count the pixels of bodies and of people in each cell, mark those that show floor, add up x
    and y and find the greatest height; every second column is evaluated."""
    height, width = depth_m.shape
    # A column of the image lies in as many cache lines as it has rows: some are copied together.
    depths = np.empty((_TOGETHER, height), dtype=np.float32)
    grounds = np.empty((_TOGETHER, height), dtype=np.float32)
    points, cells = np.empty((3, height)), np.empty((2, height), dtype=np.int32)
    kinds, down = np.empty(height, dtype=np.uint8), np.empty(height)
    for i in range(height):
        down[i] = row_slope(i, lens)
    for first in range(0, width, 2 * _TOGETHER):
        columns = min(_TOGETHER, (width - first + 1) // 2)
        for i in range(height):
            ground = ground_m[i if len(ground_m) > 1 else 0]
            for n in range(columns):
                depths[n, i], grounds[n, i] = depth_m[i, first + 2 * n], ground[first + 2 * n]
        for n in range(columns):
            j = first + 2 * n
            a = column_slope(j, lens)
            _column(depths[n], grounds[n], a, down, t, limits, origin, points, cells, kinds)
            _bin_column(points, cells, kinds, is_person[:, j], limits, origin, counts, sums)


@inlined
def _column(
    depths: FloatImage,
    grounds: FloatImage,
    a: float,
    down: Floats,
    t: Floats,
    limits: GridLimits,
    origin: Indices,
    points: Floats,
    cells: Counts,
    kinds: Mask,
) -> None:
    """Write (3, H) x, y and height above the ground of the pixels of a column, (2, H) the columns
    and rows of their cells, and (H,) what they show; free of branches, so that the compiler
    vectorises it."""
    first_col, first_row = np.int32(origin[0]), np.int32(origin[1])
    for i in range(len(depths)):
        depth = depths[i]
        x, y, z = point_on_ray(t, a, down[i], depth)
        z -= grounds[i]
        points[0, i], points[1, i], points[2, i] = x, y, z
        cells[0, i] = np.int32(math.floor(x / limits.cell_m)) - first_col
        cells[1, i] = np.int32(math.floor(y / limits.cell_m)) - first_row
        near = (depth > np.float32(0)) & (depth <= limits.max_range_m)
        floor = (abs(z) < limits.floor_m) & (depth <= limits.floor_range_m)
        body = (limits.body_low_m < z) & (z < limits.body_high_m)
        kind = _FLOOR if floor else (_BODY if body else _NEITHER)
        kinds[i] = kind if near else _NEITHER


@inlined
def _bin_column(
    points: Floats,
    cells: Counts,
    kinds: Mask,
    is_person: Bools,
    limits: GridLimits,
    origin: Indices,
    counts: Counts,
    sums: Floats,
) -> None:
    """Add the pixels of one column, from below upwards; consecutive pixels of a body in one cell
    are added up before they are written."""
    i, floor_below = len(kinds) - 1, False
    while i >= 0:
        row, col = cells[1, i], cells[0, i]
        in_grid = np.uint32(row) < SIDE and np.uint32(col) < SIDE  # negative ones are large
        if kinds[i] == _FLOOR:
            if in_grid:
                counts[row, col, 2] = 1
            if floor_below:
                _continue_floor(points, cells, i, limits, origin, counts)
            floor_below = True
            i -= 1
            continue
        floor_below = False
        if kinds[i] == _NEITHER or not in_grid:
            i -= 1
            continue
        bodies, people = 0, 0
        x, y, top = sums[row, col, 0], sums[row, col, 1], sums[row, col, 2]
        while i >= 0 and kinds[i] == _BODY and cells[1, i] == row and cells[0, i] == col:
            bodies += 1
            people += is_person[i]
            x += points[0, i]
            y += points[1, i]
            top = max(top, points[2, i])
            i -= 1
        counts[row, col, 0] += bodies
        counts[row, col, 1] += people
        sums[row, col, 0], sums[row, col, 1], sums[row, col, 2] = x, y, top


@inlined
def _continue_floor(
    points: Floats, cells: Counts, i: int, limits: GridLimits, origin: Indices, counts: Counts
) -> None:
    """Mark the floor between pixel i of a column and the one below it, where both show floor and
    are near to each other; nothing lies between cells that share a side."""
    if abs(cells[0, i + 1] - cells[0, i]) + abs(cells[1, i + 1] - cells[1, i]) <= 1:
        return
    cell_m, x, y = limits.cell_m, points[0, i], points[1, i]
    to_x, to_y = points[0, i + 1] - x, points[1, i + 1] - y
    squared = to_x * to_x + to_y * to_y
    if not (cell_m / 2) ** 2 < squared < limits.fill_m**2:
        return
    steps = math.ceil(2 * math.sqrt(squared) / cell_m)
    for step in range(1, steps):
        share = step / steps
        col = math.floor((x + share * to_x) / cell_m) - origin[0]
        row = math.floor((y + share * to_y) / cell_m) - origin[1]
        if 0 <= row < SIDE and 0 <= col < SIDE:
            counts[row, col, 2] = 1


@compiled
def bin_scan(
    rays: Floats,
    scanner: tuple[float, float],
    pixels_m: float,
    limits: GridLimits,
    origin: Indices,
    counts: Counts,
    sums: Floats,
) -> None:
    """Add a laser scan to the pixels: along each ray floor, as no body stands there, and at its end
    a body as high as a person, where the camera shows none.

    `rays` is (N, 3) the x and y of the direction and the range in metres, ∞ for none, `scanner` the
    position from which they come, all in the map frame; a ray that ends at 1 m counts as `pixels_m`
    pixels, one that ends elsewhere inversely to its length.
    """
    shown = counts[:, :, 0] > 0
    cell_m, reach_m = limits.cell_m, limits.max_range_m
    x, y = scanner
    for n in range(len(rays)):
        range_m = rays[n, 2]
        steps = int(min(range_m - cell_m, reach_m) / (cell_m / 2))
        for step in range(1, steps + 1):
            along_m = step * cell_m / 2
            at_x, at_y = x + along_m * rays[n, 0], y + along_m * rays[n, 1]
            row, col = _cell_of(at_x, at_y, cell_m, origin)
            if row >= 0:
                counts[row, col, 2] = 1
        if range_m > reach_m:
            continue
        at_x, at_y = x + range_m * rays[n, 0], y + range_m * rays[n, 1]
        row, col = _cell_of(at_x, at_y, cell_m, origin)
        if row >= 0 and not shown[row, col]:
            pixels = max(1, round(pixels_m / range_m))
            counts[row, col, 0] += pixels
            sums[row, col, 0] += pixels * at_x
            sums[row, col, 1] += pixels * at_y
            sums[row, col, 2] = max(sums[row, col, 2], limits.body_high_m)


@inlined
def _cell_of(x: float, y: float, cell_m: float, origin: Indices) -> tuple[int, int]:
    """Return row and column in the grid of a position of the map, (−1, −1) outside."""
    row, col = math.floor(y / cell_m) - origin[1], math.floor(x / cell_m) - origin[0]
    if 0 <= row < SIDE and 0 <= col < SIDE:
        return row, col
    return -1, -1


@compiled
def recall_cells(
    counts: Counts,
    origin: Indices,
    now_s: float,
    limits: tuple[int, float, float],
    memory: CellMemory,
    kinds: Mask,
) -> None:
    """Remember what each cell shows now, and classify it.

    Floor beside an object may be its foot, scattered: only what is surrounded by floor is certainly
    free. `limits` are the fewest pixels of an occupied cell, and the times in seconds after which
    it counts as fixed and up to which as newly occupied.
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
            elif _shows_floor(counts, r, c):
                occupied_s[at, on] = np.inf
                is_free = True
                for i in range(max(r - 1, 0), min(r + 2, SIDE)):
                    for j in range(max(c - 1, 0), min(c + 2, SIDE)):
                        is_free &= _shows_floor(counts, i, j)
                if is_free:
                    free_s[at, on] = now_s


@inlined
def _shows_floor(counts: Counts, row: int, col: int) -> bool:
    return bool(counts[row, col, 2] > 0 and counts[row, col, 0] == 0)


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
