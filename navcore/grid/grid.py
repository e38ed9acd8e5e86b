"""Occupancy grid: the occupied cells by reason, and the cells that the robot's centre must
avoid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from navcore.geometry.arrays import sorted_distinct

BoolGrid = npt.NDArray[np.bool_]
"""(rows, cols) truth value of each cell; row 0 has the smallest y."""
Cell = tuple[int, int]
"""(row, col) of a cell."""
Box = tuple[int, int, int, int]
"""(top, left, bottom, right) rows top … bottom−1 and columns left … right−1 of a grid."""
DEFAULT_RESOLUTION_M = 0.05
"""Side of a cell of worlds and recordings that name none, metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GridSpec:
    """Size and position of a grid in the map frame; rows grow with y, columns with x."""

    resolution_m: float
    """Side of a cell in metres, r_g in the paper."""
    rows: int
    """Number of cells along y, H in the paper."""
    cols: int
    """Number of cells along x, W in the paper."""
    origin_x_m: float
    """x in metres of the lower-left corner of cell (0, 0)."""
    origin_y_m: float
    """y in metres of the lower-left corner of cell (0, 0)."""

    @staticmethod
    def centred(*, size_m: tuple[float, float], resolution_m: float) -> GridSpec:
        """Return a grid with the origin of the map frame in its middle (the paper's Algorithm 1,
        line 3)."""
        cols, rows = (2 * math.ceil(side / resolution_m / 2) for side in size_m)
        return GridSpec(
            resolution_m=resolution_m,
            rows=rows,
            cols=cols,
            origin_x_m=-cols / 2 * resolution_m,
            origin_y_m=-rows / 2 * resolution_m,
        )

    def cell(self, x_m: float, y_m: float) -> Cell:
        """Return the cell of a point; it may be outside the grid."""
        return (
            math.floor((y_m - self.origin_y_m) / self.resolution_m),
            math.floor((x_m - self.origin_x_m) / self.resolution_m),
        )

    def cells_at(self, positions: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """Return the (K,) distinct cells on the grid, row · cols + col, in which (N, 2) positions
        in metres lie, in rising order."""
        cols = np.floor((positions[:, 0] - self.origin_x_m) / self.resolution_m).astype(np.int64)
        rows = np.floor((positions[:, 1] - self.origin_y_m) / self.resolution_m).astype(np.int64)
        inside = (rows >= 0) & (rows < self.rows) & (cols >= 0) & (cols < self.cols)
        return sorted_distinct((rows * self.cols + cols)[inside])

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """Return (x, y) of a cell's centre in metres of the map frame."""
        return (
            self.origin_x_m + (col + 0.5) * self.resolution_m,
            self.origin_y_m + (row + 0.5) * self.resolution_m,
        )

    def centres(self, cells: npt.NDArray[np.integer]) -> npt.NDArray[np.float64]:
        """Return the (N, 2) centres (x, y) in metres of (N, 2) cells (row, col)."""
        return np.column_stack(
            [
                self.origin_x_m + (cells[:, 1] + 0.5) * self.resolution_m,
                self.origin_y_m + (cells[:, 0] + 0.5) * self.resolution_m,
            ]
        )

    def contains(self, x_m: float, y_m: float) -> bool:
        """Return whether a point is on the grid; False for NaN and infinity."""
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            return False
        row, col = self.cell(x_m, y_m)
        return 0 <= row < self.rows and 0 <= col < self.cols

    def part(self, top: int, left: int, bottom: int, right: int) -> GridSpec:
        """Return the grid of rows top … bottom−1 and columns left … right−1."""
        return GridSpec(
            resolution_m=self.resolution_m,
            rows=bottom - top,
            cols=right - left,
            origin_x_m=self.origin_x_m + left * self.resolution_m,
            origin_y_m=self.origin_y_m + top * self.resolution_m,
        )

    def extent(self) -> str:
        """Return the covered area in words, for error messages."""
        right = self.origin_x_m + self.cols * self.resolution_m
        top = self.origin_y_m + self.rows * self.resolution_m
        return f"x {self.origin_x_m:g} to {right:g} m, y {self.origin_y_m:g} to {top:g} m"


@dataclass(frozen=True, slots=True, kw_only=True)
class OccupancyGrid:
    """Occupied cells by layer; cells that no layer marks are free or unknown, and count as free."""

    spec: GridSpec
    """Size and position of the grid."""
    geometric: BoolGrid
    """(rows, cols) cells with an obstacle higher than the obstacle height."""
    beware: Mapping[int, BoolGrid]
    """Class id → (rows, cols) cells of each enabled class of the beware list."""
    zones: BoolGrid
    """(rows, cols) cells of the keep-out zones without a margin of their own."""
    margins_m: Mapping[int, float] = field(default_factory=dict)
    """Class id → margin in metres beyond the robot's own; 0 for classes that are not listed."""
    wide_zones: tuple[tuple[float, BoolGrid], ...] = ()
    """(margin in metres, (rows, cols) cells) of keep-out zones with a margin of their own."""
    uncertain: tuple[tuple[float, BoolGrid], ...] = ()
    """(margin in metres, (rows, cols) cells) of beware cells that need more than the margin of
    their class, because the position is uncertain relative to them."""

    def occupied(self) -> BoolGrid:
        """Return the (rows, cols) union of all layers."""
        union = self.geometric | self.zones
        for layer in (*self.beware.values(), *(mask for _, mask in self.wide_zones)):
            union |= layer
        return union


def inflation_radius(*, vehicle_width_m: float, safety_margin_m: float, resolution_m: float) -> int:
    """Return r_i = ⌈(w_v/2 + s_m) / r_g⌉ in cells (Algorithm 1, line 9)."""
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
    """Return the (rows, cols) cells that the robot's centre must avoid: every layer inflated by
    half the robot's width, the safety margin and the layer's own margin."""
    base, groups = grid.geometric | grid.zones, dict[float, BoolGrid]()
    for class_id, layer in grid.beware.items():
        margin_m = grid.margins_m.get(class_id, 0.0)
        if margin_m > 0:
            groups[margin_m] = groups[margin_m] | layer if margin_m in groups else layer
        else:
            base |= layer
    blocked = np.zeros_like(base)
    for margin_m, mask in [(0.0, base), *groups.items(), *grid.wide_zones, *grid.uncertain]:
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
