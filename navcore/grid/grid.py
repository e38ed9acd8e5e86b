"""The occupancy grid: which cells the robot must not touch and why, and where its centre therefore
may not be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

BoolGrid = npt.NDArray[np.bool_]
"""(rows, cols) truth value of each cell; row 0 has the smallest y."""
Cell = tuple[int, int]
"""(row, col) of a cell."""
Box = tuple[int, int, int, int]
"""(top, left, bottom, right) rows top … bottom−1 and columns left … right−1 of a grid."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GridSpec:
    """Where the grid lies on the map frame. Cell (row, col) covers a square; row grows with y, col
    with x."""

    resolution_m: float
    """Side of a cell, r_g in the paper."""
    rows: int
    """Cells along y, H in the paper."""
    cols: int
    """Cells along x, W in the paper."""
    origin_x_m: float
    """x of the lower-left corner of cell (0, 0)."""
    origin_y_m: float
    """y of the lower-left corner of cell (0, 0)."""

    @staticmethod
    def centred(*, size_m: tuple[float, float], resolution_m: float) -> GridSpec:
        """A grid with the map frame's origin in its middle, as in the paper's Algorithm 1, line 3."""
        cols, rows = (2 * math.ceil(side / resolution_m / 2) for side in size_m)
        return GridSpec(
            resolution_m=resolution_m,
            rows=rows,
            cols=cols,
            origin_x_m=-cols / 2 * resolution_m,
            origin_y_m=-rows / 2 * resolution_m,
        )

    def cell(self, x_m: float, y_m: float) -> Cell:
        """(row, col) of the cell that holds a point; may lie outside the grid."""
        return (
            math.floor((y_m - self.origin_y_m) / self.resolution_m),
            math.floor((x_m - self.origin_x_m) / self.resolution_m),
        )

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """(x, y) of a cell's centre, in metres of the map frame."""
        return (
            self.origin_x_m + (col + 0.5) * self.resolution_m,
            self.origin_y_m + (row + 0.5) * self.resolution_m,
        )

    def centres(self, cells: npt.NDArray[np.integer]) -> npt.NDArray[np.float64]:
        """(N, 2) points (x, y) of the centres of (N, 2) cells (row, col)."""
        return np.column_stack(
            [
                self.origin_x_m + (cells[:, 1] + 0.5) * self.resolution_m,
                self.origin_y_m + (cells[:, 0] + 0.5) * self.resolution_m,
            ]
        )

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether a point lies on the grid, i.e. has a cell there; False for NaN and infinity."""
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            return False
        row, col = self.cell(x_m, y_m)
        return 0 <= row < self.rows and 0 <= col < self.cols

    def part(self, top: int, left: int, bottom: int, right: int) -> GridSpec:
        """Of rows top … bottom−1 and columns left … right−1."""
        return GridSpec(
            resolution_m=self.resolution_m,
            rows=bottom - top,
            cols=right - left,
            origin_x_m=self.origin_x_m + left * self.resolution_m,
            origin_y_m=self.origin_y_m + top * self.resolution_m,
        )

    def extent(self) -> str:
        """The covered area in words, for refusals."""
        right = self.origin_x_m + self.cols * self.resolution_m
        top = self.origin_y_m + self.rows * self.resolution_m
        return f"x {self.origin_x_m:g} to {right:g} m, y {self.origin_y_m:g} to {top:g} m"


@dataclass(frozen=True, slots=True, kw_only=True)
class OccupancyGrid:
    """Occupied cells, layer by layer; what no layer marks is free or unknown, and both count as
    free."""

    spec: GridSpec
    """Where it lies."""
    geometric: BoolGrid
    """(rows, cols) something higher than the obstacle height stands there."""
    beware: Mapping[int, BoolGrid]
    """Class id → (rows, cols) for each enabled class of the beware list."""
    zones: BoolGrid
    """(rows, cols) enabled zones of the operator."""
    margins_m: Mapping[int, float] = field(default_factory=dict)
    """Class id → room beyond the robot's own margin, for each class with a margin of its own."""
    wide_zones: tuple[tuple[float, BoolGrid], ...] = ()
    """(margin, mask) of zones with a margin of their own."""

    def occupied(self) -> BoolGrid:
        """(rows, cols) any layer."""
        union = self.geometric | self.zones
        for layer in (*self.beware.values(), *(mask for _, mask in self.wide_zones)):
            union |= layer
        return union


def inflation_radius(*, vehicle_width_m: float, safety_margin_m: float, resolution_m: float) -> int:
    """Cells of r_i = ⌈(w_v/2 + s_m) / r_g⌉ (Algorithm 1, line 9)."""
    # The small term keeps 0.45 / 0.05 at 9 cells where floating point says 9.000000000000002.
    return math.ceil((vehicle_width_m / 2 + safety_margin_m) / resolution_m - 1e-9)


def inflate(mask: BoolGrid, radius_cells: int) -> BoolGrid:
    """Dilate (rows, cols) by the disc of all cells whose centre is at most `radius_cells` away
    (Algorithm 1, line 10)."""
    return cv2.dilate(mask.view(np.uint8), _disc(radius_cells)).view(np.bool_)


def inflate_by(mask: BoolGrid, margin_m: float, resolution_m: float) -> BoolGrid:
    """Dilate (rows, cols) by a margin in metres; a margin of 0 returns the mask itself."""
    if margin_m <= 0:
        return mask
    return inflate(
        mask,
        inflation_radius(vehicle_width_m=0.0, safety_margin_m=margin_m, resolution_m=resolution_m),
    )


def inflate_layers(
    grid: OccupancyGrid, *, vehicle_width_m: float, safety_margin_m: float
) -> BoolGrid:
    """(rows, cols) where the robot's centre may not be: every layer inflated by the robot and the
    layer's margin."""
    base, groups = grid.geometric | grid.zones, dict[float, BoolGrid]()
    for class_id, layer in grid.beware.items():
        margin_m = grid.margins_m.get(class_id, 0.0)
        if margin_m > 0:
            groups[margin_m] = groups[margin_m] | layer if margin_m in groups else layer
        else:
            base |= layer
    blocked = np.zeros_like(base)
    for margin_m, mask in [(0.0, base), *groups.items(), *grid.wide_zones]:
        radius = inflation_radius(
            vehicle_width_m=vehicle_width_m,
            safety_margin_m=safety_margin_m + margin_m,
            resolution_m=grid.spec.resolution_m,
        )
        blocked |= inflate(mask, radius)
    return blocked


@cache
def _disc(radius_cells: int) -> npt.NDArray[np.uint8]:
    offsets = np.arange(-radius_cells, radius_cells + 1)
    return (offsets[:, None] ** 2 + offsets[None, :] ** 2 <= radius_cells**2).astype(np.uint8)
