"""Patterns of two colours on the floor: striped tape, hatched areas, outlines of bays, symbols.

What is measured: the floor is put on a grid of square cells by depth, each cell of the colour that
most of its pixels have. A cell lies *between* if along one of four directions (x, y and the two
diagonals) the other colour is on both sides of it, no farther apart than `max_gap_m`. A marking is
a connected area of cells of the two colours within half of `max_gap_m` of such cells, in which both
colours lie between the other and each covers `min_share`. So neither a plain colour, nor a single
line, nor the edge of a shadow is one: they have no cell between on one of the two sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import ColourSegmenterConfig
from navcore.geometry.arrays import Bools, Indices
from navcore.mission.beware_list import ColourPattern
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
        i, j = np.nonzero(seen)
        lens, t = frame.intrinsics, frame.T_map_camera
        # The median takes the noise of single pixels out, which would mix narrow stripes.
        depth = cv2.medianBlur(frame.depth_m, 5)[i, j].astype(np.float64)
        rays = np.stack([(j - lens.cx) / lens.fx, (i - lens.cy) / lens.fy, np.ones(len(i))])
        at = np.floor((t[:2, :3] @ (rays * depth) + t[:2, 3:]) / config.pattern_cell_m)
        rows, cols = at.astype(np.int64)
        return FloorGrid(seen, rows, cols, config.pattern_cell_m)


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
    rows, cols = grid.rows, grid.cols
    (top, bottom), (left, right) = (
        (at[first & low].min() - gap, at[first & low].max() + gap) for at in (rows, cols)
    )
    near = low & (rows >= top) & (rows <= bottom) & (cols >= left) & (cols <= right)
    shape = (int(bottom - top) + 1, int(right - left) + 1)
    cells = (rows[near] - top) * shape[1] + cols[near] - left
    whole, *counts = (
        np.bincount(cells, weights, minlength=shape[0] * shape[1])
        for weights in (None, first[near], second[near])
    )
    a, b = (((2 * n >= whole) & (whole > 0)).astype(np.uint8).reshape(shape) for n in counts)
    marked = _markings(a, b & (1 - a), pattern, gap, grid.cell_m)
    taken = np.zeros(len(rows), dtype=np.bool_)
    taken[near] = marked.ravel()[cells] > 0
    found[grid.seen] = taken & (first | second)
    return found


def _markings(
    first: Cells, second: Cells, pattern: ColourPattern, gap: int, cell_m: float
) -> Cells:
    """Return the cells of the markings of two colours; `gap` is the largest gap in cells."""
    if pattern.min_line_m > 0:
        first = _long_parts(first, pattern.min_line_m / cell_m)
    second_between = _between(first, gap) & second
    first_between = _between(second, gap) & first
    area = second_between | first & _grown(second_between | first_between, gap // 2)
    if not pattern.takes_any:
        area |= second & _grown(area, gap // 2)
    # Far off, rows of pixels lie farther apart than cells.
    names = cv2.connectedComponents(_grown(area, 1), connectivity=8)[1]
    kept = np.zeros_like(area)
    for name in np.intersect1d(names[second_between > 0], names[first_between > 0]):
        part = (names == name) & (area > 0)
        share, sides = first[part].mean(), [np.ptp(at) + 1 for at in np.nonzero(part)]
        is_shared = pattern.min_share <= share <= 1 - pattern.min_share
        if is_shared and cell_m * max(sides) <= pattern.max_size_m:
            kept[part] = 1
    return kept


def _grown(cells: Cells, by: int) -> Cells:
    side = 2 * by + 1
    return np.asarray(cv2.dilate(cells, np.ones((side, side), dtype=np.uint8)), dtype=np.uint8)


def _between(cells: Cells, gap: int) -> Cells:
    """Return the cells with cells of a set on both sides, at most `gap` cells between them."""
    side = gap + 1 + gap % 2
    lines = [np.zeros((side, side), dtype=np.uint8) for _ in range(2)]
    lines[0][side // 2], lines[1][:, side // 2] = 1, 1
    short = 2 * round(side / 2 / np.sqrt(2)) + 1
    lines += [np.eye(short, dtype=np.uint8), np.eye(short, dtype=np.uint8)[::-1].copy()]
    padded = cv2.copyMakeBorder(cells, side, side, side, side, cv2.BORDER_CONSTANT, value=0)
    closed = np.max([cv2.morphologyEx(padded, cv2.MORPH_CLOSE, line) for line in lines], axis=0)
    return np.asarray(closed[side:-side, side:-side], dtype=np.uint8)


def _long_parts(cells: Cells, min_cells: float) -> Cells:
    """Return the connected parts of a set that are long enough."""
    _, names, boxes, _ = cv2.connectedComponentsWithStats(_grown(cells, 1), connectivity=8)
    is_long = np.maximum(boxes[:, cv2.CC_STAT_WIDTH], boxes[:, cv2.CC_STAT_HEIGHT]) - 2 >= min_cells
    is_long[0] = False
    return np.asarray(cells * is_long[names], dtype=np.uint8)
