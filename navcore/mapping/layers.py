"""Occupied cells of the map, one layer of bits for each class, with a log of their changes.

The layers always equal those rebuilt from the points. `take_changes` names the changed cells, so
that following the map costs what has changed and not the size of the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.config.mapping import MappingConfig
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Bools, Indices
from navcore.grid.bitplane import BitPlane, BitPlanes, empty_plane, unpack
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.grid.growth import Growth
from navcore.mapping.points.point_queries import refresh_planes
from navcore.mapping.points.point_table import PointTable
from navcore.mapping.views.voxels import BIN_M, HEIGHT_BINS, LOWEST_M
from navcore.mission.beware_list import NOTHING, BewareList


def floor_bins(floor_m: float) -> np.uint64:
    """Return the set of height bins, one bit each, whose middle is within `floor_m` of the
    floor."""
    return np.uint64(
        sum(
            1 << level
            for level in range(HEIGHT_BINS)
            if abs(LOWEST_M + (level + 0.5) * BIN_M) < floor_m
        )
    )


def least_confidence(beware: BewareList, certain: float) -> npt.NDArray[np.float32]:
    """Return (64,) the smallest confidence of a point that counts, by class id; `certain` is the
    largest that a list can ask for."""
    least = np.zeros(64, dtype=np.float32)
    for entry in beware.classes:
        # A threshold above what the map can reach would disable the class silently.
        least[entry.class_id] = min(entry.min_confidence, certain)
    return least


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Changes:
    """Cells that became occupied or free in the layer of a class; a cell may occur more than
    once."""

    class_ids: npt.NDArray[np.uint8]
    """(N,) class of the layer of each cell."""
    cells: Indices
    """(N,) cells, row · cols + col."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LayerRules:
    """What decides which cells the points of a map occupy."""

    class_ids: npt.NDArray[np.uint8]
    """(K,) class of each layer."""
    least: npt.NDArray[np.float32]
    """(64,) smallest confidence of a point that counts, by class id."""
    loaded_prior: CellMask | None
    """Occupied cells of the prior map as it was loaded; None without one."""


class MapLayers:
    """One layer for every class ever detected; `NOTHING` for geometric obstacles."""

    def __init__(self, spec: GridSpec, rules: MappingConfig) -> None:
        self._spec = spec
        self._certain, self._floor_bins = rules.confidence.certain, floor_bins(rules.floor_m)
        self._class_ids = np.array([NOTHING], dtype=np.uint8)
        self._planes: BitPlanes = empty_plane(spec.rows, spec.cols)[None]
        self._least = np.zeros(64, dtype=np.float32)
        self._changes: list[Changes] | None = None
        self._prior: npt.NDArray[np.bool_] = np.zeros(spec.rows * spec.cols, dtype=np.bool_)
        self.loaded_prior: CellMask | None = None
        """Cells of the prior map that was loaded, seen free since or not; None without one."""
        self._prior_mask: CellMask | None = None

    def add_classes(self, class_ids: npt.NDArray[np.uint8]) -> None:
        """Add a layer for each of these (N,) classes that has none."""
        lacking = np.bincount(class_ids, minlength=256) > 0
        lacking[self._class_ids] = False
        new = np.flatnonzero(lacking).astype(np.uint8)
        if len(new):
            self._class_ids = np.concatenate([self._class_ids, new])
            self._planes = np.concatenate(
                [self._planes, np.zeros((len(new), *self._planes.shape[1:]), dtype=np.uint64)]
            )

    def refresh(self, points: PointTable, cells: Indices) -> bool:
        """Recompute (N,) cells, row · cols + col, from the points in them; return whether any layer
        changed."""
        class_ids, changed = refresh_planes(
            points.records,
            points.first,
            cells,
            self._spec.cols,
            self._prior,
            self._least,
            self._class_ids,
            self._planes,
        )
        if self._changes is not None and len(changed):
            self._changes.append(Changes(class_ids=class_ids, cells=changed))
        return len(changed) > 0

    def grow(self, growth: Growth) -> None:
        """Continue on a larger grid; all cells then count as changed."""
        self._spec = growth.new
        self._planes = np.stack([growth.plane(plane) for plane in self._planes])
        loaded, prior = self.loaded_prior, np.zeros(growth.new.rows * growth.new.cols, np.bool_)
        if loaded is not None:
            prior[growth.flat(np.flatnonzero(self._prior))] = True
        self._set_prior(prior, None if loaded is None else growth.mask(loaded))
        self._changes = None

    def rebuild(self, points: PointTable, prior: BoolGrid, spec: GridSpec) -> None:
        """Recompute all layers from the points and the (rows, cols) cells of a prior map on a
        grid."""
        self._spec = spec
        self._set_prior(prior.reshape(-1).copy(), CellMask.of(prior) if prior.any() else None)
        self.add_classes(points.live["class_id"])
        self._planes = layer_planes(self.rules(), points, self._prior, self._spec)
        self._changes = None

    def rules(self) -> LayerRules:
        """Return what decides which cells the points occupy."""
        return LayerRules(
            class_ids=self._class_ids, least=self._least, loaded_prior=self.loaded_prior
        )

    def replace(
        self, rules: LayerRules, planes: BitPlanes, prior: Bools, points: PointTable
    ) -> None:
        """Set the layers and the (rows · cols,) cells of the prior map to those that
        `layer_planes` computed with the rules before some changes of these points; all cells count
        as changed, and `refresh` has to follow for the changes."""
        self._prior, self._prior_mask = prior, None
        added = np.zeros((len(self._class_ids) - len(planes), *planes.shape[1:]), dtype=np.uint64)
        self._planes = np.concatenate([planes, added]) if len(added) else planes
        self._refresh_classes(points, np.flatnonzero(rules.least != self._least))
        self._changes = None

    def use(self, beware: BewareList, points: PointTable) -> None:
        """Count only points with the confidence that the list asks for, past ones included."""
        least = least_confidence(beware, self._certain)
        stale = np.flatnonzero(least != self._least)
        self._least = least
        self._refresh_classes(points, stale)

    def take_changes(self) -> Changes | None:
        """Return the changes since the last call; None at the first, when all cells count as
        changed."""
        taken, self._changes = self._changes, []
        if taken is None:
            return None
        return Changes(
            class_ids=np.concatenate(
                [np.empty(0, dtype=np.uint8), *(change.class_ids for change in taken)]
            ),
            cells=np.concatenate(
                [np.empty(0, dtype=np.int64), *(change.cells for change in taken)]
            ),
        )

    def plane(self, class_id: int) -> BitPlane | None:
        """Return the live layer of a class, valid until the map changes; None for a class that was
        never detected."""
        known = self._class_ids.tolist()
        return self._planes[known.index(class_id)] if class_id in known else None

    def bools(self, class_id: int) -> BoolGrid:
        """Return the (rows, cols) layer of a class."""
        plane, shape = self.plane(class_id), (self._spec.rows, self._spec.cols)
        return np.zeros(shape, dtype=np.bool_) if plane is None else unpack(plane, *shape)

    @property
    def prior(self) -> CellMask | None:
        """Occupied cells of the prior map that were not seen free; None without a prior map."""
        if self.loaded_prior is not None and self._prior_mask is None:
            self._prior_mask = CellMask.of(self._prior.reshape(self._spec.rows, self._spec.cols))
        return self._prior_mask

    def load_prior(self, occupied: BoolGrid, points: PointTable) -> bool:
        """Occupy the (rows, cols) cells of a prior map until they are disproved; return whether any
        layer changed."""
        if occupied.shape != (self._spec.rows, self._spec.cols):
            raise BadConfiguration(
                f"prior map: expected {(self._spec.rows, self._spec.cols)} cells, "
                f"got {occupied.shape}"
            )
        before = np.flatnonzero(self._prior)
        self._set_prior(occupied.reshape(-1).copy(), CellMask.of(occupied))
        return self.refresh(points, np.union1d(before, np.flatnonzero(self._prior)))

    @property
    def floor_bins(self) -> np.uint64:
        """Height bins in which a measurement disproves the prior map; 0 without a prior map."""
        return np.uint64(0) if self.loaded_prior is None else self._floor_bins

    def clear_prior(self, floor: Indices) -> Indices:
        """Remove and return the cells of the prior map among (N,) cells, row · cols + col, whose
        floor was measured; `refresh` has to follow."""
        cells: Indices = floor[self._prior[floor]]
        self._prior[cells] = False
        if len(cells):
            self._prior_mask = None
        return cells

    def erase_prior(self, cells: Indices) -> Indices:
        """Take (N,) cells, row · cols + col, out of the prior map for good; return those that were
        in it. `refresh` has to follow."""
        if self.loaded_prior is None:
            return cells[:0]
        loaded = self.loaded_prior.bools.reshape(-1).copy()
        erased: Indices = cells[loaded[cells]]
        loaded[erased] = self._prior[erased] = False
        self._set_prior(self._prior, CellMask.of(loaded.reshape(self._spec.rows, -1)))
        return erased

    def put_back_prior(self, cells: Indices, disproved: Bools) -> None:
        """Put (N,) erased cells back into the prior map; `disproved`: (N,) whether their floor was
        measured. `refresh` has to follow."""
        if self.loaded_prior is None or not len(cells):
            return
        loaded = self.loaded_prior.bools.reshape(-1).copy()
        loaded[cells], self._prior[cells] = True, ~disproved
        self._set_prior(self._prior, CellMask.of(loaded.reshape(self._spec.rows, -1)))

    def _set_prior(self, prior: Bools, loaded: CellMask | None) -> None:
        self._prior, self._prior_mask, self.loaded_prior = prior, None, loaded

    def _refresh_classes(self, points: PointTable, class_ids: Indices) -> None:
        """Recompute the cells that hold points of some classes."""
        if len(class_ids):
            cells = points.live["cell"][np.isin(points.live["class_id"], class_ids)]
            self.refresh(points, np.unique(cells[cells >= 0]).astype(np.int64))


def layer_planes(rules: LayerRules, points: PointTable, prior: Bools, spec: GridSpec) -> BitPlanes:
    """Return the plane of each class for points and the (rows · cols,) cells of a prior map."""
    planes = np.stack([empty_plane(spec.rows, spec.cols)] * len(rules.class_ids))
    cells = points.live["cell"]
    occupied = np.union1d(cells[cells >= 0].astype(np.int64), np.flatnonzero(prior))
    refresh_planes(
        points.records,
        points.first,
        occupied,
        spec.cols,
        prior,
        rules.least,
        rules.class_ids,
        planes,
    )
    return planes
