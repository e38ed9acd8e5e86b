"""Sets of cells as values: one bit a cell, so that a snapshot of the largest map is a copy of a
megabyte."""

from __future__ import annotations

import numpy as np

from navcore.grid.bitplane import PAD, BitPlane, empty_plane, pack, unpack
from navcore.grid.grid import BoolGrid


class CellMask:
    """An immutable set of cells of a grid. Made by `of` or `copied`; may cross threads."""

    __slots__ = ("_bools", "_plane", "cols", "rows")

    def __init__(self, plane: BitPlane, rows: int, cols: int) -> None:
        """Takes the plane (`navcore.search.bits`) over; nobody may write to it afterwards."""
        plane.flags.writeable = False
        self._plane, self.rows, self.cols = plane, rows, cols
        self._bools: BoolGrid | None = None

    @staticmethod
    def of(bools: BoolGrid) -> CellMask:
        """The cells that are True in a bool (rows, cols) grid."""
        plane = empty_plane(*bools.shape)
        pack(bools, plane)
        return CellMask(plane, *bools.shape)

    @staticmethod
    def copied(plane: BitPlane, rows: int, cols: int) -> CellMask:
        """The cells that a plane holds now."""
        return CellMask(plane.copy(), rows, cols)

    @property
    def plane(self) -> BitPlane:
        """The packed cells, read-only."""
        return self._plane

    @property
    def bools(self) -> BoolGrid:
        """(rows, cols) True where a cell is in the set; unpacked once, read-only."""
        if self._bools is None:
            bools = unpack(self._plane, self.rows, self.cols)
            bools.flags.writeable = False
            self._bools = bools
        return self._bools

    def window(self, top: int, left: int, bottom: int, right: int) -> BoolGrid:
        """(bottom − top, right − left) part of `bools` without unpacking the rest; the borders lie
        on the grid."""
        return window(self._plane, top, left, bottom, right)


def window(plane: BitPlane, top: int, left: int, bottom: int, right: int) -> BoolGrid:
    """Unpack rows top … bottom−1 and columns left … right−1 of a plane."""
    first, last = (left + PAD) >> 6, (right + PAD + 63) >> 6
    words = np.ascontiguousarray(plane[PAD + top : PAD + bottom, first:last]).view(np.uint8)
    bits = np.unpackbits(words, axis=1, bitorder="little")
    start = left + PAD - 64 * first
    return bits[:, start : start + right - left].view(np.bool_)
