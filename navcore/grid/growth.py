"""Growth of a grid: whole tiles are added on the sides where cells are needed.

A grid never shrinks and never moves against the map frame: what was the cell (row, col) becomes the
cell (row + rows, col + cols), with a shift by whole words of the bit planes. The memory is bounded
by `MOST_CELLS` and `LONGEST_SIDE`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Indices
from navcore.grid.bitplane import LONGEST_SIDE, MOST_CELLS, PAD, BitPlane, empty_plane
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import Box, Cell, GridSpec, OccupancyGrid

TILE = 256
"""Side of a tile in cells; a multiple of the 64 cells of a word."""
_SAME_CELLS = 1e-3
"""Distance in cells between the corners of two grids below which their cells are the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """Change from a grid to a larger one that contains it."""

    old: GridSpec
    """The grid before."""
    new: GridSpec
    """The grid after."""
    rows: int
    """Rows added before the first one, a multiple of 64."""
    cols: int
    """Columns added before the first one, a multiple of 64."""

    @property
    def shift(self) -> Indices:
        """(2,) rows and columns by which every cell (row, col) moves."""
        return np.array([self.rows, self.cols], dtype=np.int64)

    def plane(self, plane: BitPlane) -> BitPlane:
        """Return a plane of the old grid as one of the new grid; the added cells are 0."""
        grown = empty_plane(self.new.rows, self.new.cols)
        cells = plane[PAD : PAD + self.old.rows, 1:-1]
        top, left = PAD + self.rows, 1 + self.cols // 64
        grown[top : top + cells.shape[0], left : left + cells.shape[1]] = cells
        return grown

    def mask(self, mask: CellMask) -> CellMask:
        """Return a set of cells of the old grid as one of the new grid."""
        return CellMask(self.plane(mask.plane), self.new.rows, self.new.cols)

    def flat(self, cells: Indices) -> Indices:
        """Return (N,) cells, row · cols + col, of the old grid as cells of the new one."""
        rows, cols = np.divmod(cells, self.old.cols)
        return np.asarray((rows + self.rows) * self.new.cols + cols + self.cols)


def growth_to(spec: GridSpec, box: Box) -> Growth | None:
    """Return the growth by whole tiles after which a grid contains the cells of `box`, which may
    lie outside; None where it contains them already, or where it would become too large."""
    growth = _enlarged(spec, box)
    return growth if growth.new != spec and is_possible(growth.new) else None


def growth_over(spec: GridSpec, other: GridSpec) -> Growth | None:
    """Return the growth by whole tiles after which a grid covers another one; None where it does
    already. Raises `BadConfiguration` where it would become too large."""
    growth = _enlarged(spec, cells_of(spec, other))
    if not is_possible(growth.new):
        raise BadConfiguration(
            f"the map covers {other.extent()}, that of this world begins with {spec.extent()}: one "
            "map of both would be too large; check the origin"
        )
    return growth if growth.new != spec else None


def growth_into(spec: GridSpec, larger: GridSpec) -> Growth | None:
    """Return the change from a grid to a given larger one; None unless the larger one has the same
    cells and others around them, on a border between words."""
    if abs(larger.resolution_m - spec.resolution_m) > 1e-9 * spec.resolution_m:
        return None
    exact = _in_cells(spec, larger)
    rows, cols = round(exact[0]), round(exact[1])
    fits = (
        max(abs(exact[0] - rows), abs(exact[1] - cols)) < _SAME_CELLS
        and min(rows, cols) >= 0
        and rows % 64 == cols % 64 == 0
        and rows + spec.rows <= larger.rows
        and cols + spec.cols <= larger.cols
    )
    return Growth(old=spec, new=larger, rows=rows, cols=cols) if fits else None


def padded(grid: OccupancyGrid, points: Iterable[tuple[float, float]]) -> OccupancyGrid:
    """Return an occupancy grid grown by whole tiles to points (x, y) in metres of the map frame;
    the added cells are free, zones included."""
    growth = _enlarged(grid.spec, hull(grid.spec, [grid.spec.cell(*point) for point in points]))
    if growth.new == grid.spec:
        return grid
    old, new = growth.old, growth.new
    sides = (
        (growth.rows, new.rows - old.rows - growth.rows),
        (growth.cols, new.cols - old.cols - growth.cols),
    )
    return replace(
        grid,
        spec=new,
        geometric=np.pad(grid.geometric, sides),
        beware={class_id: np.pad(layer, sides) for class_id, layer in grid.beware.items()},
        zones=np.pad(grid.zones, sides),
        wide_zones=tuple((margin_m, np.pad(mask, sides)) for margin_m, mask in grid.wide_zones),
        uncertain=tuple((margin_m, np.pad(mask, sides)) for margin_m, mask in grid.uncertain),
    )


def is_possible(spec: GridSpec) -> bool:
    """Return whether a grid is within the bounds of memory."""
    return max(spec.rows, spec.cols) <= LONGEST_SIDE and spec.rows * spec.cols <= MOST_CELLS


def reaching(spec: GridSpec, points: Iterable[tuple[float, float]]) -> GridSpec:
    """Return the grid grown by whole tiles to points (x, y) in metres of the map frame, whether
    that is possible or not."""
    return _enlarged(spec, hull(spec, [spec.cell(*point) for point in points])).new


def cells_of(spec: GridSpec, other: GridSpec) -> Box:
    """Return the part of the map that another grid covers, in cells of this one."""
    (top, left), side = _in_cells(other, spec), other.resolution_m / spec.resolution_m
    return (
        math.floor(top + _SAME_CELLS),
        math.floor(left + _SAME_CELLS),
        math.ceil(top + other.rows * side - _SAME_CELLS),
        math.ceil(left + other.cols * side - _SAME_CELLS),
    )


def _in_cells(inner: GridSpec, outer: GridSpec) -> tuple[float, float]:
    """Return (row, col) of the corner of a grid in cells of another."""
    return (
        (inner.origin_y_m - outer.origin_y_m) / outer.resolution_m,
        (inner.origin_x_m - outer.origin_x_m) / outer.resolution_m,
    )


def hull(spec: GridSpec, cells: Iterable[Cell], ring: int = 1) -> Box:
    """Return the smallest part that contains the grid and, with a ring of cells around them, all of
    the given cells."""
    rows, cols = zip(*cells, strict=True)
    return (
        min(0, min(rows) - ring),
        min(0, min(cols) - ring),
        max(spec.rows, max(rows) + 1 + ring),
        max(spec.cols, max(cols) + 1 + ring),
    )


def joined(boxes: Iterable[Box]) -> Box:
    """Return the smallest part that contains at least one given part."""
    tops, lefts, bottoms, rights = zip(*boxes, strict=True)
    return min(tops), min(lefts), max(bottoms), max(rights)


def _tiles(cells: int) -> int:
    return max(-(-cells // TILE), 0) * TILE


def _enlarged(spec: GridSpec, box: Box) -> Growth:
    top, left, bottom, right = box
    above, before = _tiles(-top), _tiles(-left)
    below, after = _tiles(bottom - spec.rows), _tiles(right - spec.cols)
    if above == before == below == after == 0:
        return Growth(old=spec, new=spec, rows=0, cols=0)
    part = spec.part(-above, -before, spec.rows + below, spec.cols + after)
    # Rounded, so that the corner does not depend on the order in which tiles were added.
    x_m, y_m = round(part.origin_x_m, 9), round(part.origin_y_m, 9)
    new = replace(part, origin_x_m=x_m, origin_y_m=y_m)
    return Growth(old=spec, new=new, rows=above, cols=before)
