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
from navcore.geometry.arrays import Indices
from navcore.grid.bitplane import BitPlane, BitPlanes, empty_plane, unpack
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.point_table import PointTable, refresh_planes
from navcore.mapping.voxels import BIN_M, HEIGHT_BINS, LOWEST_M
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Changes:
    """Cells that became occupied or free in the layer of a class; a cell may occur more than
    once."""

    class_ids: npt.NDArray[np.uint8]
    """(N,) class of the layer of each cell."""
    cells: Indices
    """(N,) cells, row · cols + col."""


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
        self._has_prior = False
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

    def rebuild(self, points: PointTable, prior: BoolGrid) -> None:
        """Recompute all layers from the points and the (rows, cols) cells of a prior map."""
        self._prior, self._prior_mask = prior.reshape(-1).copy(), None
        self._has_prior = bool(prior.any())
        self.add_classes(points.live["class_id"])
        self._planes[:] = 0
        self.refresh(
            points, np.union1d(points.live["cell"].astype(np.int64), np.flatnonzero(self._prior))
        )
        self._changes = None

    def use(self, beware: BewareList, points: PointTable) -> None:
        """Count only points with the confidence that the list asks for, past ones included."""
        least = np.zeros(64, dtype=np.float32)
        for entry in beware.classes:
            # A threshold above what the map can reach would disable the class silently.
            least[entry.class_id] = min(entry.min_confidence, self._certain)
        stale = np.flatnonzero(least != self._least)
        if len(stale):
            self._least = least
            self.refresh(
                points,
                np.unique(points.live["cell"][np.isin(points.live["class_id"], stale)]).astype(
                    np.int64
                ),
            )

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
        at = np.flatnonzero(self._class_ids == class_id)
        return self._planes[at[0]] if len(at) else None

    def bools(self, class_id: int) -> BoolGrid:
        """Return the (rows, cols) layer of a class."""
        plane, shape = self.plane(class_id), (self._spec.rows, self._spec.cols)
        return np.zeros(shape, dtype=np.bool_) if plane is None else unpack(plane, *shape)

    @property
    def prior(self) -> CellMask | None:
        """Occupied cells of the prior map that were not seen free; None without a prior map."""
        if self._has_prior and self._prior_mask is None:
            self._prior_mask = CellMask.of(self._prior.reshape(self._spec.rows, self._spec.cols))
        return self._prior_mask if self._has_prior else None

    def load_prior(self, occupied: BoolGrid, points: PointTable) -> bool:
        """Occupy the (rows, cols) cells of a prior map until they are disproved; return whether any
        layer changed."""
        if occupied.shape != (self._spec.rows, self._spec.cols):
            raise BadConfiguration(
                f"prior map: expected {(self._spec.rows, self._spec.cols)} cells, "
                f"got {occupied.shape}"
            )
        before = np.flatnonzero(self._prior)
        self._prior, self._prior_mask, self._has_prior = occupied.reshape(-1).copy(), None, True
        return self.refresh(points, np.union1d(before, np.flatnonzero(self._prior)))

    def clear_prior(self, seen: Indices, heights: npt.NDArray[np.uint64]) -> Indices:
        """Remove and return the cells of the prior map whose floor was measured; `refresh` has to
        follow.

        `seen`: (N,) measured cells, row · cols + col. `heights`: (N,) one bit for each height bin
        in which a surface was measured.
        """
        if not self._has_prior:
            return np.empty(0, dtype=np.int64)
        cells: Indices = seen[(heights & self._floor_bins != 0) & self._prior[seen]]
        self._prior[cells] = False
        if len(cells):
            self._prior_mask = None
        return cells
