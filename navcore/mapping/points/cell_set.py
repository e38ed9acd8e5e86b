"""Open-addressing hash table of cells, for kernels that visit each of a few thousand cells once."""

from __future__ import annotations

import numpy as np

from navcore.compiled import inlined, nested
from navcore.geometry.arrays import Indices

EMPTY = -1
"""Key of a free slot."""
_SPREAD = 2654435761
"""Multiplier that spreads neighbouring cells over the table (Knuth, 6.4)."""


@nested
def cell_table(count: int) -> Indices:
    """Return a table of free slots for at most `count` cells."""
    size = 64
    while size < 2 * count:
        size *= 2
    return np.full(size, np.int64(EMPTY))


@inlined
def slot_of(table: Indices, cell: int) -> int:
    """Return the slot that holds a cell, or the free one in which it belongs."""
    at = (cell * _SPREAD >> 7) & (len(table) - 1)
    while table[at] != cell and table[at] != EMPTY:
        at = (at + 1) & (len(table) - 1)
    return at


@nested
def distinct(cells: Indices) -> Indices:
    """Return each of (N,) cells, 0 or more, once, in the order of their first occurrence."""
    table, found, count = cell_table(len(cells)), np.empty(len(cells), dtype=np.int64), 0
    for cell in cells:
        at = slot_of(table, cell)
        if table[at] == EMPTY:
            table[at] = found[count] = cell
            count += 1
    return found[:count]
