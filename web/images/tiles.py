"""Tiles of the map and their versions: the cost of an update depends on the changes, not on the
size of the map."""

from __future__ import annotations

import threading
from collections.abc import Hashable, Iterator

import numpy as np
import numpy.typing as npt

from navcore.grid.cell_mask import CellMask, changed_tiles
from navcore.mission.beware_list import BewareList
from web.interface.snapshots import TickSnapshot

TILE = 256
"""Side of a tile in cells; a multiple of the 64 cells of a word."""

Tile = tuple[int, int]
Part = tuple[int, int, int, int]


class TileVersions:
    """Versions of the tiles, from comparing each tick with the last; safe from any thread."""

    def __init__(self, before: int = 0) -> None:
        """All versions are larger than `before`."""
        self._lock = threading.Lock()
        self._key: Hashable = None
        self._layers: dict[Hashable, CellMask] = {}
        self._versions: npt.NDArray[np.int64] = np.zeros((0, 0), dtype=np.int64)
        self._newest = before

    def update(self, tick: TickSnapshot, beware: BewareList) -> tuple[int, npt.NDArray[np.int64]]:
        """Return the newest version, and (tile rows, tile columns) the version of the last change
        of each tile."""
        with self._lock:
            layers = {**tick.occupancy.masks, "seen": tick.seen_mask}
            if tick.prior is not None:
                layers["prior"] = tick.prior
            spec = tick.grid_spec
            shape = -(-spec.rows // TILE), -(-spec.cols // TILE)
            # Another list may paint the same cells in other colours.
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


def tile_cells(tile: Tile, tick: TickSnapshot) -> Part:
    """Return (top, left, bottom, right) cells of a tile."""
    spec = tick.grid_spec
    top, left = tile[0] * TILE, tile[1] * TILE
    return top, left, min(top + TILE, spec.rows), min(left + TILE, spec.cols)


def changed_since(versions: npt.NDArray[np.int64], since: int) -> Iterator[tuple[Tile, int]]:
    """Yield the tiles that changed after a version, with their versions."""
    for row, col in np.argwhere(versions > since):
        yield (int(row), int(col)), int(versions[row, col])
