"""Immutable sets of cells, one bit each: a snapshot of a large map takes a few megabytes."""

from __future__ import annotations

import numpy as np

from navcore.grid.bitplane import PAD, BitPlane, empty_plane, pack, unpack
from navcore.grid.grid import BoolGrid


class CellMask:
    """Immutable set of cells of a grid, made by `of` or `copied`; safe to share between threads."""

    __slots__ = ("_bools", "_plane", "cols", "is_empty", "rows")

    def __init__(self, plane: BitPlane, rows: int, cols: int, *, is_empty: bool = False) -> None:
        """Take ownership of a plane (`navcore.grid.bitplane`); it must not be written to
        afterwards. With `is_empty` it is known to have no cell."""
        plane.flags.writeable = False
        self._plane, self.rows, self.cols = plane, rows, cols
        self._bools: BoolGrid | None = None
        self.is_empty = is_empty
        """Whether the set is known to have no cell, as of most classes of the list."""

    @staticmethod
    def of(bools: BoolGrid) -> CellMask:
        """Return the True cells of a bool (rows, cols) grid."""
        plane = empty_plane(*bools.shape)
        pack(bools, plane)
        return CellMask(plane, *bools.shape, is_empty=not bools.any())

    @staticmethod
    def empty(rows: int, cols: int) -> CellMask:
        """Return the empty set of a grid."""
        return CellMask(empty_plane(rows, cols), rows, cols, is_empty=True)

    @staticmethod
    def copied(plane: BitPlane, rows: int, cols: int) -> CellMask:
        """Return the present cells of a plane."""
        return CellMask(plane.copy(), rows, cols)

    @property
    def plane(self) -> BitPlane:
        """Packed cells, read-only."""
        return self._plane

    @property
    def bools(self) -> BoolGrid:
        """(rows, cols) True for the cells of the set, read-only; unpacked at the first use."""
        if self._bools is None:
            bools = unpack(self._plane, self.rows, self.cols)
            bools.flags.writeable = False
            self._bools = bools
        return self._bools

    def window(self, top: int, left: int, bottom: int, right: int) -> BoolGrid:
        """Return the (bottom − top, right − left) part of `bools` without unpacking the rest; the
        part must be within the grid."""
        if self.is_empty:
            return np.zeros((bottom - top, right - left), dtype=np.bool_)
        return window(self._plane, top, left, bottom, right)


def changed_tiles(old: CellMask | None, new: CellMask | None, tile_cells: int) -> BoolGrid:
    """Return (tiles down, tiles across) which tiles differ between two sets of cells of one grid.

    A missing set is empty, and one of the two must be given. `tile_cells`, the side of a tile, is a
    multiple of 64; the tiles at the upper and right border may be smaller.
    """
    one = old or new
    assert one is not None
    words = one.plane != 0 if old is None or new is None else old.plane != new.plane
    down, across, width = -(-one.rows // tile_cells), -(-one.cols // tile_cells), tile_cells // 64
    inner = np.zeros((down * tile_cells, across * width), dtype=np.bool_)
    held = words[PAD:, PAD // 64 :][: inner.shape[0], : inner.shape[1]]
    inner[: held.shape[0], : held.shape[1]] = held
    return np.asarray(inner.reshape(down, tile_cells, across, width).any(axis=(1, 3)))


def window(plane: BitPlane, top: int, left: int, bottom: int, right: int) -> BoolGrid:
    """Return rows top … bottom−1 and columns left … right−1 of a plane as bool."""
    first, last = (left + PAD) >> 6, (right + PAD + 63) >> 6
    words = np.ascontiguousarray(plane[PAD + top : PAD + bottom, first:last]).view(np.uint8)
    bits = np.unpackbits(words, axis=1, bitorder="little")
    start = left + PAD - 64 * first
    return bits[:, start : start + right - left].view(np.bool_)
