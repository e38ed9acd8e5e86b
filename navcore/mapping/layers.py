"""The occupied cells that the map's points make, one bit a cell and a layer for each class, and
every change of one handed on.

They always equal the layers rebuilt from the points. `take_changes` names the cells that changed,
so that whoever follows the map pays for what changed and not for its size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.grid.bitplane import BitPlane, BitPlanes, empty_plane, unpack
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.confidence import CERTAIN
from navcore.mapping.point_table import PointTable, refresh_planes
from navcore.mapping.voxels import BIN_M, HEIGHT_BINS, LOWEST_M
from navcore.mission.beware_list import NOTHING, BewareList

Indices = npt.NDArray[np.int64]

FLOOR_M = 0.05
"""What is measured within this height shows the floor …"""
FLOOR_BINS = np.uint64(
    sum(
        1 << level
        for level in range(HEIGHT_BINS)
        if abs(LOWEST_M + (level + 0.5) * BIN_M) < FLOOR_M
    )
)
"""… that is, in one of these bins."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Changes:
    """Cells that became occupied or free in the layer of a class since the last look; a cell may be
    named more than once."""

    class_ids: npt.NDArray[np.uint8]
    """(N,) whose layer."""
    cells: Indices
    """(N,) row · cols + col."""


class MapLayers:
    """A layer for every class that was ever seen, `NOTHING` for what is an obstacle by its height."""

    def __init__(self, spec: GridSpec) -> None:
        self._spec = spec
        self._class_ids = np.array([NOTHING], dtype=np.uint8)
        self._planes: BitPlanes = empty_plane(spec.rows, spec.cols)[None]
        self._least = np.zeros(64, dtype=np.float32)
        self._changes: list[Changes] | None = None
        self._prior: npt.NDArray[np.bool_] = np.zeros(spec.rows * spec.cols, dtype=np.bool_)
        self._has_prior = False
        self._prior_mask: CellMask | None = None

    def add_classes(self, class_ids: npt.NDArray[np.uint8]) -> None:
        """Have a layer for each of these classes."""
        lacking = np.bincount(class_ids, minlength=256) > 0
        lacking[self._class_ids] = False
        new = np.flatnonzero(lacking).astype(np.uint8)
        if len(new):
            self._class_ids = np.concatenate([self._class_ids, new])
            self._planes = np.concatenate(
                [self._planes, np.zeros((len(new), *self._planes.shape[1:]), dtype=np.uint64)]
            )

    def refresh(self, points: PointTable, cells: Indices) -> bool:
        """Make (N,) cells, row · cols + col, anew from the points in them; whether any layer has
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
        """Make all layers anew from these points and (rows, cols) cells of a prior map."""
        self._prior, self._prior_mask = prior.reshape(-1).copy(), None
        self._has_prior = bool(prior.any())
        self.add_classes(points.live["class_id"])
        self._planes[:] = 0
        self.refresh(
            points, np.union1d(points.live["cell"].astype(np.int64), np.flatnonzero(self._prior))
        )
        self._changes = None

    def use(self, beware: BewareList, points: PointTable) -> None:
        """Count, from now on and in all that was seen, only points as sure as the list wants them."""
        least = np.zeros(64, dtype=np.float32)
        for entry in beware.classes:
            # More than the map can ever be sure of would switch the class off unseen.
            least[entry.class_id] = min(entry.min_confidence, CERTAIN)
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
        """What changed in the layers since the last call; None at the first, when everything has to
        be looked at."""
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
        """The live layer of a class, to be read only until the map changes; None when nothing of it
        was ever seen."""
        at = np.flatnonzero(self._class_ids == class_id)
        return self._planes[at[0]] if len(at) else None

    def bools(self, class_id: int) -> BoolGrid:
        """(rows, cols) the layer of a class."""
        plane, shape = self.plane(class_id), (self._spec.rows, self._spec.cols)
        return np.zeros(shape, dtype=np.bool_) if plane is None else unpack(plane, *shape)

    @property
    def prior(self) -> CellMask | None:
        """Cells that are occupied on a map from elsewhere and were not seen free; None without such
        a map."""
        if self._has_prior and self._prior_mask is None:
            self._prior_mask = CellMask.of(self._prior.reshape(self._spec.rows, self._spec.cols))
        return self._prior_mask if self._has_prior else None

    def load_prior(self, occupied: BoolGrid, points: PointTable) -> bool:
        """Take (rows, cols) cells of a map from elsewhere for occupied, until they are disproved;
        whether that changed any."""
        if occupied.shape != (self._spec.rows, self._spec.cols):
            raise BadConfiguration(
                f"prior map: is {occupied.shape} cells, expected {(self._spec.rows, self._spec.cols)}"
            )
        before = np.flatnonzero(self._prior)
        self._prior, self._prior_mask, self._has_prior = occupied.reshape(-1).copy(), None, True
        return self.refresh(points, np.union1d(before, np.flatnonzero(self._prior)))

    def clear_prior(self, seen: Indices, heights: npt.NDArray[np.uint64]) -> Indices:
        """Give up the cells of the prior map whose floor was measured, and return them; `refresh`
        has to follow.

        `heights`: (N,) a bit for each height bin of the (N,) cells in which something was measured.
        """
        if not self._has_prior:
            return np.empty(0, dtype=np.int64)
        cells: Indices = seen[(heights & FLOOR_BINS != 0) & self._prior[seen]]
        self._prior[cells] = False
        if len(cells):
            self._prior_mask = None
        return cells
