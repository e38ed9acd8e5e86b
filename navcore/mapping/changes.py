"""Changes of a map against the map that the operator has accepted, by area.

An accepted map does not follow the robot's map: it changes only where the operator accepts an area.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np

from navcore.config.changes import DEFAULT_CHANGES, ChangesConfig
from navcore.errors import BadGeometry
from navcore.formats.nav2_map import map_from_cells
from navcore.geometry.arrays import Indices, Points
from navcore.grid.grid import BoolGrid, GridSpec, inflate
from navcore.grid.growth import growth_over
from navcore.mapping.storage.prior_map import prior_layer


class ChangeKind(StrEnum):
    """What has changed in an area."""

    APPEARED = "appeared"
    """Occupied now, but not on the accepted map."""
    GONE = "gone"
    """Occupied on the accepted map, but seen free now."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellMap:
    """Occupied and known cells of a map; its arrays are not written to."""

    spec: GridSpec
    """Size and position of the grid."""
    occupied: BoolGrid
    """(rows, cols) cells with an obstacle or an object of the beware list."""
    known: BoolGrid
    """(rows, cols) cells that were observed; occupied cells need not be."""

    def on(self, spec: GridSpec) -> CellMap:
        """Return the map on another grid: a cell is occupied if an occupied one touches it, and
        known if its centre was known. Cells beyond the map are unknown."""
        if spec == self.spec:
            return self
        nothing = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
        try:
            stored = map_from_cells(occupied=self.occupied, known=self.known, spec=self.spec)
            occupied = prior_layer(stored, spec)
        except BadGeometry:  # no overlap
            return CellMap(spec=spec, occupied=nothing, known=nothing)
        source, known = self.spec, nothing
        rows = _cells_at(spec.origin_y_m, spec.rows, spec.resolution_m, source.origin_y_m, source)
        cols = _cells_at(spec.origin_x_m, spec.cols, spec.resolution_m, source.origin_x_m, source)
        own = np.ix_((rows >= 0) & (rows < source.rows), (cols >= 0) & (cols < source.cols))
        known[own] = self.known[np.ix_(rows[own[0][:, 0]], cols[own[1][0]])]
        return CellMap(spec=spec, occupied=occupied, known=known)


def _cells_at(
    origin_m: float, count: int, side_m: float, source_m: float, source: GridSpec
) -> Indices:
    """Return the source cell along one axis at the centre of each of `count` cells."""
    centres = origin_m + (np.arange(count) + 0.5) * side_m
    return np.asarray(np.floor((centres - source_m) / source.resolution_m), dtype=np.int64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChangedArea:
    """Neighbouring cells that have changed in the same way."""

    kind: ChangeKind
    """What has changed."""
    cells: Indices
    """(N, 2) cells (row, col)."""
    outline: Points
    """(M, 2) convex outline around the cells in metres of the map frame."""
    area_m2: float
    """Area of the cells in square metres."""


def changed_areas(
    accepted: CellMap, present: CellMap, config: ChangesConfig = DEFAULT_CHANGES
) -> tuple[ChangedArea, ...]:
    """Return the areas in which the present map differs from the accepted one, largest first.

    Both are compared on the grid of the present map. What the robot has not seen does not count as
    gone.
    """
    spec, before = present.spec, accepted.on(present.spec)
    reach = round(config.tolerance_m / spec.resolution_m)
    appeared = present.occupied & ~inflate(before.occupied, reach)
    gone = before.occupied & present.known & ~inflate(present.occupied, reach)
    found = [
        *_areas(appeared, ChangeKind.APPEARED, spec, config),
        *_areas(gone, ChangeKind.GONE, spec, config),
    ]
    return tuple(sorted(found, key=lambda area: -area.area_m2))


def accept(accepted: CellMap, spec: GridSpec, areas: Iterable[ChangedArea]) -> CellMap:
    """Return the accepted map with some changed areas of a grid taken over, on that grid grown to
    all of the accepted map, which may have grown since the areas were found."""
    growth = growth_over(spec, accepted.spec)
    before = accepted.on(spec if growth is None else growth.new)
    top, left = (0, 0) if growth is None else (growth.rows, growth.cols)
    occupied, known = before.occupied.copy(), before.known.copy()
    for area in areas:
        rows, cols = area.cells.T
        occupied[rows + top, cols + left] = area.kind is ChangeKind.APPEARED
        known[rows + top, cols + left] = True
    return CellMap(spec=before.spec, occupied=occupied, known=known)


def _areas(
    mask: BoolGrid, kind: ChangeKind, spec: GridSpec, config: ChangesConfig
) -> Iterator[ChangedArea]:
    joined = inflate(mask, math.ceil(config.join_m / 2 / spec.resolution_m))
    count, labels = cv2.connectedComponents(joined.view(np.uint8), connectivity=8)
    cells = np.argwhere(mask)
    area_of = labels[cells[:, 0], cells[:, 1]]
    cells = cells[np.argsort(area_of, kind="stable")]
    sizes = np.bincount(area_of, minlength=count)[1:]
    for own in np.split(cells, np.cumsum(sizes)[:-1]):
        if len(own) >= config.min_cells:
            area_m2 = len(own) * spec.resolution_m**2
            yield ChangedArea(kind=kind, cells=own, outline=_outline(own, spec), area_m2=area_m2)


def _outline(cells: Indices, spec: GridSpec) -> Points:
    corners = np.vstack([cells + corner for corner in ((0, 0), (0, 1), (1, 0), (1, 1))])
    xy = corners[:, ::-1] * spec.resolution_m + np.array([spec.origin_x_m, spec.origin_y_m])
    return np.asarray(cv2.convexHull(xy.astype(np.float32))[:, 0], dtype=np.float64)
