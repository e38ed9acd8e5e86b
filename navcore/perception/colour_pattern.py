"""Patterns on the floor: striped tape, hatched areas, outlines of bays, symbols, and bright lines.

What is measured: the floor is put on a grid of square cells by depth, each cell of the colour that
most of its pixels have. A cell lies *between* if along one of four directions (x, y and the two
diagonals) the other colour is on both sides of it, no farther apart than `max_gap_m`. A marking is
a connected area of cells of the two colours within half of `max_gap_m` of such cells, in which both
colours lie between the other and each covers `min_share`. So neither a plain colour, nor a single
line, nor the edge of a shadow is one: they have no cell between on one of the two sides.

A bright line is what a morphological opening of the brightness of these cells takes away: along one
of the four directions, every stretch of `max_width_m` over it reaches darker floor. So neither a
bright floor is a line, nor one half of it in the light of a lamp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.config.perception.perception import ColourSegmenterConfig
from navcore.geometry.arrays import Bools, FloatImage, Floats, Indices
from navcore.geometry.camera import Pinhole, column_slope, row_slope
from navcore.geometry.transform import Matrix
from navcore.mission.beware_list import ColourPattern, FloorLine
from navcore.robot.frame import Frame

Cells = npt.NDArray[np.uint8]
"""(rows, cols) 1 for the cells of a set, 0 elsewhere."""


@dataclass(frozen=True, slots=True, eq=False)
class FloorGrid:
    """The measured pixels of a frame on a grid of square cells of the floor."""

    seen: Bools
    """(H, W) pixels on the grid: those with a depth within the range of the configuration."""
    rows: Indices
    """Row on the grid of each of these pixels, which lies along x of the map."""
    cols: Indices
    """Column on the grid of each of these pixels, along y."""
    cell_m: float
    """Side of a cell in metres."""

    @staticmethod
    def of(frame: Frame, config: ColourSegmenterConfig) -> FloorGrid:
        """Return the grid of a frame."""
        seen = (frame.depth_m > 0) & (frame.depth_m < config.pattern_range_m)
        # The median takes the noise of single pixels out, which would mix narrow stripes.
        depth_m = np.asarray(cv2.medianBlur(frame.depth_m, 5), dtype=np.float32)
        rows, cols = np.empty((2, int(np.count_nonzero(seen))), dtype=np.int64)
        lens, cell_m = frame.intrinsics.pinhole, config.pattern_cell_m
        _find_cells(seen, depth_m, lens, frame.T_map_camera, cell_m, rows, cols)
        return FloorGrid(seen, rows, cols, cell_m)


@compiled
def _find_cells(
    seen: Bools,
    depth_m: FloatImage,
    lens: Pinhole,
    T_map_camera: Matrix,
    cell_m: float,
    rows: Indices,
    cols: Indices,
) -> None:
    """Fill in row and column, along x and y of the map, of the cell of each seen pixel."""
    t, k = T_map_camera, 0
    for i in range(seen.shape[0]):
        y = row_slope(i, lens)
        for j in range(seen.shape[1]):
            if seen[i, j]:
                z = np.float64(depth_m[i, j])
                x_camera, y_camera = column_slope(j, lens) * z, y * z
                rows[k] = math.floor(
                    (t[0, 0] * x_camera + t[0, 1] * y_camera + t[0, 2] * z + t[0, 3]) / cell_m
                )
                cols[k] = math.floor(
                    (t[1, 0] * x_camera + t[1, 1] * y_camera + t[1, 2] * z + t[1, 3]) / cell_m
                )
                k += 1


@dataclass(frozen=True, slots=True, eq=False)
class _Window:
    """The part of a floor grid around the low pixels of a colour."""

    near: Bools
    """(N,) low pixels of the window among those on the grid."""
    cells: Indices
    """(M,) cell of each of these, row · columns + column."""
    shape: tuple[int, int]
    """Rows and columns."""

    @staticmethod
    def around(own: Bools, low: Bools, grid: FloorGrid, reach: int) -> _Window:
        """Return the window of the (N,) pixels of a colour, of which some are low, and of `reach`
        cells on every side."""
        rows, cols, its = grid.rows, grid.cols, own & low
        (top, bottom), (left, right) = (
            (at[its].min() - reach, at[its].max() + reach) for at in (rows, cols)
        )
        near = low & (rows >= top) & (rows <= bottom) & (cols >= left) & (cols <= right)
        shape = (int(bottom - top) + 1, int(right - left) + 1)
        return _Window(near, (rows[near] - top) * shape[1] + cols[near] - left, shape)

    def sums(self, weights: npt.NDArray[np.generic] | None = None) -> Floats:
        """Return the (rows, columns) sums of (N,) weights of pixels, by default their number."""
        own = None if weights is None else weights[self.near]
        count = self.shape[0] * self.shape[1]
        sums = np.bincount(self.cells, own, minlength=count)
        return sums.reshape(self.shape).astype(np.float64)

    def most(self, pixels: Bools) -> Cells:
        """Return the cells in which at least half of the pixels are of a set."""
        whole = self.sums()
        return np.asarray((2 * self.sums(pixels) >= whole) & (whole > 0), dtype=np.uint8)

    def pixels_in(self, cells: Cells) -> Bools:
        """Return (N,) which pixels lie in some cells."""
        inside = np.zeros(len(self.near), dtype=np.bool_)
        inside[self.near] = cells.ravel()[self.cells] > 0
        return inside


def line_pixels(
    own: Bools, value: npt.NDArray[np.uint8], floor: Bools, grid: FloorGrid, line: FloorLine
) -> Bools:
    """Return the (H, W) pixels of lines among those of a colour `own`.

    `value` is the (H, W) brightness, `floor` the (H, W) pixels that are low enough.
    """
    found = np.zeros(own.shape, dtype=np.bool_)
    first, low = own[grid.seen], floor[grid.seen]
    if not (first & low).any():
        return found
    width = 2 * (round(line.max_width_m / grid.cell_m) // 2) + 3  # odd, longer than the line
    window = _Window.around(first, low, grid, width)
    whole = window.sums()
    # What is not seen is no darker floor.
    mean = np.full(window.shape, 255, dtype=np.float32)
    np.divide(window.sums(value[grid.seen]), whole, out=mean, where=whole > 0, casting="same_kind")
    sides = [cv2.morphologyEx(mean, cv2.MORPH_OPEN, along) for along in _segments(width)]
    known, area = (whole > 0).astype(np.float32), (4 * width + 1, 4 * width + 1)
    around = cv2.blur(mean * known, area) / np.maximum(cv2.blur(known, area), 1e-6)
    beside = np.maximum(np.min(sides, axis=0), around)
    bright = window.most(first) & (mean >= (1 + line.min_contrast) * beside)
    # Cells at the rim of a line are partly floor.
    rim = (1 + line.min_contrast / 2) * beside
    near = window.near
    taken = window.pixels_in(_grown(bright, 1)) & first
    taken[near] &= value[grid.seen][near] >= rim.ravel()[window.cells]
    found[grid.seen] = taken
    return found


def pattern_pixels(
    own: Bools, other: Bools, floor: Bools, grid: FloorGrid, pattern: ColourPattern
) -> Bools:
    """Return the (H, W) pixels of markings in which two colours alternate.

    `own` and `other` are the (H, W) pixels of the two colours, `floor` those that are low enough.
    """
    found = np.zeros(own.shape, dtype=np.bool_)
    first, second, low = own[grid.seen], other[grid.seen], floor[grid.seen]
    if not (first & low).any() or not (second & low).any():
        return found
    # Nothing farther from the first colour than a gap belongs to a marking.
    gap = max(round(pattern.max_gap_m / grid.cell_m), 1)
    window = _Window.around(first, low, grid, gap)
    a, b = window.most(first), window.most(second)
    marked = _markings(a, b & (1 - a), pattern, gap, grid.cell_m)
    found[grid.seen] = window.pixels_in(marked) & (first | second)
    return found


def _markings(
    first: Cells, second: Cells, pattern: ColourPattern, gap: int, cell_m: float
) -> Cells:
    """Return the cells of the markings of two colours; `gap` is the largest gap in cells."""
    if pattern.min_line_m > 0:
        first = _long_parts(first, pattern.min_line_m / cell_m)
    second_between = _between(first, gap) & second
    first_between = _between(second, gap) & first
    core = second_between | first & _grown(second_between | first_between, gap // 2)
    area = core if pattern.takes_any else core | second & _grown(core, gap // 2)
    # Far off, rows of pixels lie farther apart than cells.
    names = cv2.connectedComponents(_grown(area, 1), connectivity=8)[1]
    kept = np.zeros_like(area)
    for name in np.intersect1d(names[second_between > 0], names[first_between > 0]):
        part = (names == name) & (area > 0)
        share, sides = first[part].mean(), [np.ptp(at) + 1 for at in np.nonzero(part)]
        # Around a plain area, the floor may have the second colour: little of it lies between.
        between = second_between[part].sum() / core[part].sum()
        is_shared = (
            pattern.min_share <= share <= 1 - pattern.min_share and between >= pattern.min_share / 2
        )
        if is_shared and cell_m * max(sides) <= pattern.max_size_m:
            kept[part] = 1
    return kept


def _grown(cells: Cells, by: int) -> Cells:
    side = 2 * by + 1
    return np.asarray(cv2.dilate(cells, np.ones((side, side), dtype=np.uint8)), dtype=np.uint8)


def _between(cells: Cells, gap: int) -> Cells:
    """Return the cells with cells of a set on both sides, at most `gap` cells between them."""
    side = gap + 1 + gap % 2
    padded = cv2.copyMakeBorder(cells, side, side, side, side, cv2.BORDER_CONSTANT, value=0)
    closed = np.max(
        [cv2.morphologyEx(padded, cv2.MORPH_CLOSE, line) for line in _segments(side)], axis=0
    )
    return np.asarray(closed[side:-side, side:-side], dtype=np.uint8)


def _segments(side: int) -> list[Cells]:
    """Return segments of so many cells along x, y and the two diagonals."""
    along = [np.zeros((side, side), dtype=np.uint8) for _ in range(2)]
    along[0][side // 2], along[1][:, side // 2] = 1, 1
    short = 2 * round(side / 2 / np.sqrt(2)) + 1
    return [*along, np.eye(short, dtype=np.uint8), np.eye(short, dtype=np.uint8)[::-1].copy()]


def _long_parts(cells: Cells, min_cells: float) -> Cells:
    """Return the connected parts of a set that are long enough."""
    _, names, boxes, _ = cv2.connectedComponentsWithStats(_grown(cells, 1), connectivity=8)
    is_long = np.maximum(boxes[:, cv2.CC_STAT_WIDTH], boxes[:, cv2.CC_STAT_HEIGHT]) - 2 >= min_cells
    is_long[0] = False
    return np.asarray(cells * is_long[names], dtype=np.uint8)
