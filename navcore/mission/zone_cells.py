"""Cells of a polygon: those that it touches, or those that it contains as a whole."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Polygon

from navcore.grid.grid import BoolGrid, Box, GridSpec

LARGEST_BOX = 2**22
"""Number of cells of a bounding box up to which a polygon is drawn at once."""
BLOCK = 1024
"""Side in cells of the blocks in which larger polygons are drawn."""
OVERLAP = 4
"""Cells around a part that are drawn too, because OpenCV draws differently at the border."""
Corners = tuple[tuple[float, float], ...]
"""Corners (x, y) in metres of the map frame."""


def rasterise(
    polygon: Sequence[Sequence[float]], spec: GridSpec, *, whole: bool = False
) -> BoolGrid:
    """Return read-only (rows, cols), True for every cell that the polygon touches, so that no
    sliver of a zone is lost to rounding; with `whole`, for every cell that lies in it as a whole.

    A part of a map gets exactly the cells that the whole map gets there.
    """
    first_row, row_phase = _aligned(spec.origin_y_m, spec.resolution_m)
    first_col, col_phase = _aligned(spec.origin_x_m, spec.resolution_m)
    corners = tuple((float(x), float(y)) for x, y in polygon)
    phases = row_phase, col_phase
    found = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    for part in _pieces(_box(corners, spec.resolution_m, *phases), first_row, first_col, spec):
        cells = _drawn(corners, spec.resolution_m, *phases, part, whole)
        _paste(cells, part[0] - first_row, part[1] - first_col, found)
    found.flags.writeable = False
    return found


def _paste(cells: BoolGrid, top: int, left: int, into: BoolGrid) -> None:
    """Write cells at (top, left), as far as they are on the grid."""
    bottom, right = (
        min(top + cells.shape[0], into.shape[0]),
        min(left + cells.shape[1], into.shape[1]),
    )
    if max(top, 0) < bottom and max(left, 0) < right:
        into[max(top, 0) : bottom, max(left, 0) : right] = cells[
            max(-top, 0) : bottom - top, max(-left, 0) : right - left
        ]


def _pieces(box: Box, first_row: int, first_col: int, spec: GridSpec) -> Iterator[Box]:
    """Yield the parts in which a bounding box is drawn; lines are counted from 0 m, and so are the
    blocks, so that all grids get the same."""
    top, left, bottom, right = box
    if (bottom - top) * (right - left) <= LARGEST_BOX:
        yield box
        return
    for row in _blocks(max(top, first_row), min(bottom, first_row + spec.rows)):
        for col in _blocks(max(left, first_col), min(right, first_col + spec.cols)):
            yield row * BLOCK, col * BLOCK, (row + 1) * BLOCK, (col + 1) * BLOCK


def _blocks(first: int, last: int) -> range:
    return range(first // BLOCK, -(-last // BLOCK))


def _aligned(origin_m: float, resolution_m: float) -> tuple[int, float]:
    """Return the number of the grid's first line of cells, counted from 0 m, and the offset of that
    count from 0 m in cells."""
    cells = origin_m / resolution_m
    first = math.floor(cells + 1e-6)
    return first, round(cells - first, 6)


def _box(corners_m: Corners, resolution_m: float, row_phase: float, col_phase: float) -> Box:
    """Return the bounding box with some cells around it, its lines of cells counted from 0 m."""
    ends = np.asarray(corners_m) / resolution_m - np.array([col_phase, row_phase])
    left, top = (np.floor(ends.min(axis=0)).astype(int) - 2).tolist()
    right, bottom = (np.ceil(ends.max(axis=0)).astype(int) + 2).tolist()
    return top, left, bottom, right


@lru_cache(maxsize=64)
def _drawn(
    corners_m: Corners,
    resolution_m: float,
    row_phase: float,
    col_phase: float,
    part: Box,
    whole: bool,
) -> BoolGrid:
    """Return the cells of a polygon in a part, its lines counted from 0 m; cached whole maps would
    fill the memory."""
    top, left, bottom, right = part
    box = GridSpec(
        resolution_m=resolution_m,
        rows=bottom - top + 2 * OVERLAP,
        cols=right - left + 2 * OVERLAP,
        origin_x_m=(left - OVERLAP + col_phase) * resolution_m,
        origin_y_m=(top - OVERLAP + row_phase) * resolution_m,
    )
    cells = _cells_in(np.asarray(corners_m, dtype=np.float64), box, whole)
    return np.ascontiguousarray(cells[OVERLAP:-OVERLAP, OVERLAP:-OVERLAP])


def _cells_in(corners: npt.NDArray[np.float64], spec: GridSpec, whole: bool) -> BoolGrid:
    # fillPoly works on pixel centres with `shift` fractional bits: metres → cells whose centres are
    # integers.
    shift = 8
    pixels = (corners - np.array([spec.origin_x_m, spec.origin_y_m])) / spec.resolution_m
    fixed = np.round((pixels - 0.5) * (1 << shift)).astype(np.int32)
    mask = np.zeros((spec.rows, spec.cols), dtype=np.uint8)
    cv2.fillPoly(mask, [fixed], 1, shift=shift)
    edge = np.zeros_like(mask) if whole else mask
    cv2.polylines(edge, [fixed], True, 1, shift=shift)
    # Drawn lines are 8-connected and skip cells that the polygon only clips: each is tested.
    beside = cv2.dilate(edge, np.ones((3, 3), dtype=np.uint8)) > 0
    rim = np.argwhere(beside if whole else beside & (mask == 0))
    low = rim[:, ::-1] * spec.resolution_m + np.array([spec.origin_x_m, spec.origin_y_m])
    squares = shapely.box(
        low[:, 0], low[:, 1], low[:, 0] + spec.resolution_m, low[:, 1] + spec.resolution_m
    )
    polygon = Polygon(corners)
    shapely.prepare(polygon)
    if whole:
        mask[rim[:, 0], rim[:, 1]] = shapely.covers(polygon, squares)
    else:
        clipped = rim[shapely.intersects(polygon, squares)]
        mask[clipped[:, 0], clipped[:, 1]] = 1
    return mask > 0
