"""Kernels of the person detector: the pixels of a depth image on a coarse grid around the camera,
and what its cells showed before."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined
from navcore.config.perception.perception import PERSON_GRID_CELLS
from navcore.geometry.arrays import Bools, FloatImage, Floats, Indices
from navcore.geometry.camera import Pinhole, column_slope, row_slope
from navcore.grid.runs import WORD, Codes, run_starts

SIDE = PERSON_GRID_CELLS
"""Number of cells along each side of the grid; beyond, its memory repeats itself."""
FIXED, MOVABLE, NEW = range(1, 4)
"""Kinds of occupied cells: for long, for a while, and where floor was shortly before."""
_NONE, _FLOOR, _BODY = np.int32(-1), np.int32(0), np.int32(1)
"""What a pixel shows: neither floor nor a body within the grid, or one of them in a cell: its code
is twice the number of the cell, row · `SIDE` + column, and this."""
_ROW_BIT = (2 * SIDE).bit_length() - 1
"""Number of the bit of a code at which the row begins."""

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
    and y and find the greatest height; every second row is evaluated.

    From below upwards: positions, in cells of the grid, and codes of a row are computed in vectors,
    of which only runs of one code are visited.
    """
    height, width = depth_m.shape
    across = np.empty(width, dtype=np.float32)
    for j in range(width):
        across[j] = column_slope(j, lens)
    affine = t[:3].copy()
    affine[:2] /= limits.cell_m
    affine[0, 3] -= origin[0]
    affine[1, 3] -= origin[1]
    narrow = affine.astype(np.float32)
    # Of the present row and the one below it. Parts of one array would keep the compiler from
    # vectorising.
    x, x_below = np.empty(width, dtype=np.float32), np.empty(width, dtype=np.float32)
    y, y_below = np.empty(width, dtype=np.float32), np.empty(width, dtype=np.float32)
    codes = np.full(width + 1, _NONE, dtype=np.int32)
    codes_below = np.full(width + 1, _NONE, dtype=np.int32)
    z = np.empty(width, dtype=np.float32)
    changed = np.zeros((width + WORD - 1) // WORD * WORD, dtype=np.uint8)
    starts = np.empty(width + 1, dtype=np.int32)
    apart = np.zeros((width + 7) // 8 * 8, dtype=np.uint8)
    eights = apart.view(np.uint64)
    for i in range(height - 1, -1, -2):
        ground, b = ground_m[i if len(ground_m) > 1 else 0], np.float32(row_slope(i, lens))
        _row(depth_m[i], ground, across, b, narrow, limits, x, y, z, codes)
        for run in range(run_starts(codes, changed, starts, width)):
            first, end = starts[run], starts[run + 1]
            code = codes[first + 1]
            if code == _NONE:
                continue
            row, col = (code >> 1) // SIDE, (code >> 1) % SIDE
            if code & 1 == _FLOOR:
                counts[row, col, 2] = 1
                continue
            people, x_sum, y_sum, top = 0, 0.0, 0.0, sums[row, col, 2]
            for j in range(first, end):
                people += is_person[i, j]
                x_sum += x[j]
                y_sum += y[j]
                top = max(top, float(z[j]))
            pixels = end - first
            counts[row, col, 0] += pixels
            counts[row, col, 1] += people
            sums[row, col, 0] += (x_sum + pixels * origin[0]) * limits.cell_m
            sums[row, col, 1] += (y_sum + pixels * origin[1]) * limits.cell_m
            sums[row, col, 2] = top
        _far_floor(codes, codes_below, apart)
        for eight in range(len(eights)):
            if eights[eight] == 0:
                continue
            for j in range(8 * eight, min(8 * eight + 8, width)):
                if apart[j]:
                    to = (x_below[j] - x[j], y_below[j] - y[j])
                    _continue_floor(x[j], y[j], to, limits, counts)
        x, x_below, y, y_below = x_below, x, y_below, y
        codes, codes_below = codes_below, codes


@inlined
def _row(
    depths: FloatImage,
    grounds: FloatImage,
    across: FloatImage,
    b: np.float32,
    t: FloatImage,
    limits: GridLimits,
    x: FloatImage,
    y: FloatImage,
    z: FloatImage,
    codes: Codes,
) -> None:
    """Write for each pixel of a row of the image its column and row in the grid, in cells, and its
    height above the ground in metres, and, after a sentinel, its code; free of branches, so that
    the compiler vectorises it."""
    x0, y0, z0 = t[0, 0], t[1, 0], t[2, 0]
    x1, y1, z1 = t[0, 1] * b + t[0, 2], t[1, 1] * b + t[1, 2], t[2, 1] * b + t[2, 2]
    x3, y3, z3 = t[0, 3], t[1, 3], t[2, 3]
    zero, side = np.float32(0), np.float32(SIDE)
    far, floor_far = np.float32(limits.max_range_m), np.float32(limits.floor_range_m)
    low, high = np.float32(limits.body_low_m), np.float32(limits.body_high_m)
    flat = np.float32(limits.floor_m)
    for j in range(len(across)):
        depth, a = depths[j], across[j]
        col, row = (x0 * a + x1) * depth + x3, (y0 * a + y1) * depth + y3
        up = (z0 * a + z1) * depth + z3 - grounds[j]
        x[j], y[j], z[j] = col, row, up
        # Truncation is the floor of non-negative values; negative ones are outside.
        inside = (depth > zero) & (depth <= far) & (col >= zero) & (row >= zero)
        inside &= (col < side) & (row < side)
        floor = (abs(up) < flat) & (depth <= floor_far)
        body = (low < up) & (up < high)
        cell = np.int32(row) * np.int32(SIDE) + np.int32(col)
        code = np.int32(2) * cell + (_FLOOR if floor else _BODY)
        codes[j + 1] = code if inside & (floor | body) else _NONE


@inlined
def _far_floor(codes: Codes, below: Codes, apart: Mask) -> None:
    """Write for each pixel of a row whether it and the one below it show floor in cells that share
    no side."""
    one, cols_of, row_bit = np.int32(1), np.int32(2 * SIDE - 2), np.int32(_ROW_BIT)
    for j in range(len(codes) - 1):
        code, other = codes[j + 1], below[j + 1]
        both = code | other  # negative if either shows nothing, odd if either is a body
        cols = abs((code & cols_of) - (other & cols_of)) >> one
        rows = abs((code >> row_bit) - (other >> row_bit))
        apart[j] = (both >= 0) & ((both & one) == 0) & (cols + rows > one)


@inlined
def _continue_floor(
    x: float, y: float, to: tuple[float, float], limits: GridLimits, counts: Counts
) -> None:
    """Mark the floor between a position and the one `to` which it is, in cells, if they are near to
    each other."""
    squared = to[0] * to[0] + to[1] * to[1]
    if not 0.25 < squared < (limits.fill_m / limits.cell_m) ** 2:
        return
    steps = math.ceil(2 * math.sqrt(squared))
    for step in range(1, steps):
        share = step / steps
        col, row = math.floor(x + share * to[0]), math.floor(y + share * to[1])
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
