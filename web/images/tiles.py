"""The map in tiles, and which of them changed: what a large map costs follows what changes on it,
not its size."""

from __future__ import annotations

import threading
from collections.abc import Hashable, Iterator

import numpy as np
import numpy.typing as npt

from navcore.grid.cell_mask import CellMask, changed_tiles
from navcore.mission.beware_list import BewareList
from web.interface.snapshots import TickSnapshot

TILE = 256
"""Cells to a side; a multiple of the 64 cells of a word."""

Tile = tuple[int, int]
Part = tuple[int, int, int, int]


class TileVersions:
    """Compares each picture with the last; safe to use from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._key: Hashable = None
        self._layers: dict[Hashable, CellMask] = {}
        self._versions: npt.NDArray[np.int64] = np.zeros((0, 0), dtype=np.int64)
        self._newest = 0

    def update(
        self, picture: TickSnapshot, beware: BewareList
    ) -> tuple[int, npt.NDArray[np.int64]]:
        """The newest version, and (tiles down, tiles across) the version at which each tile last
        changed."""
        with self._lock:
            layers = {**picture.occupancy.masks, "seen": picture.seen_mask}
            if picture.prior is not None:
                layers["prior"] = picture.prior
            spec = picture.grid_spec
            shape = -(-spec.rows // TILE), -(-spec.cols // TILE)
            # Another list may paint the same cells otherwise.
            key = (beware.version, spec)
            if key != self._key or shape != self._versions.shape:
                self._key, self._newest = key, self._newest + 1
                self._versions = np.full(shape, self._newest, dtype=np.int64)
            else:
                changed = self._changed(layers, shape)
                if changed.any():
                    self._newest += 1
                    self._versions = np.where(changed, self._newest, self._versions)
            self._layers = layers
            return self._newest, self._versions

    def _changed(
        self, layers: dict[Hashable, CellMask], shape: tuple[int, int]
    ) -> npt.NDArray[np.bool_]:
        changed = np.zeros(shape, dtype=np.bool_)
        for name in {**self._layers, **layers}:
            old, new = self._layers.get(name), layers.get(name)
            if old is not new:
                changed |= changed_tiles(old, new, TILE)
        return changed


def tile_cells(tile: Tile, picture: TickSnapshot) -> Part:
    """(top, left, bottom, right) cells of a tile."""
    spec = picture.grid_spec
    top, left = tile[0] * TILE, tile[1] * TILE
    return top, left, min(top + TILE, spec.rows), min(left + TILE, spec.cols)


def changed_since(versions: npt.NDArray[np.int64], since: int) -> Iterator[tuple[Tile, int]]:
    """The tiles that changed after a version, with theirs."""
    for row, col in np.argwhere(versions > since):
        yield (int(row), int(col)), int(versions[row, col])
