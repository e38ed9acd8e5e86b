"""The memory of a jump-point search: its open list, and the cells that it has reached, each with
its length and parent.

* Lengths are integers: `UNIT` a straight step and `ROOT` a diagonal one. A sum of them does not
  depend on its order, so equal lengths compare as equal, and different ones compare as they should
  as long as a path has fewer than 400 000 diagonal steps; two longer paths could be taken for equal
  if they differ by 1e-11 of their length.
* The open list is a ring of buckets, each a sixteenth of a cell wide. Inside a bucket the order is
  last in, first out; a cell may be opened twice.
* All of it is one array, kept from one search to the next; cells that an earlier search reached
  are recognised by their stamp.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import inlined, lean
from navcore.grid.bitplane import ALL, lowest
from navcore.grid.free_space import FreeSpace

Memory = npt.NDArray[np.int64]

SHIFT = 38
UNIT = 1 << SHIFT
"""Length of a straight step: 2^38, so that paths of 2^25 cells still have a length."""
ROOT = 388736063997
"""Length of a diagonal step: √2 · 2^38, rounded."""
FAR = 1 << 62
"""Longer than any path."""

# A search's memory is one array of int64, so that passing it costs little. First some counters:
(
    PUSHED,
    WAITING,
    BEST,
    REACHED,
    STAMP,
    GOAL_ROW,
    GOAL_COL,
    LEAST,
    BUCKET,
    LACKING,
    BOUND,
    FLOOR,
    WORK,
) = range(13)
# The constants of a search:
RING, SLOTS, ROOM, TABLE, QUEUE, ROWS, COLS = range(13, 20)
# Those of `search.canonical_astar`: indices of its buckets, labels and entries, the number of
# entries that there is room for, and the number of its searches.
CELL_BUCKETS, CELL_LABELS, CELL_ENTRIES, CELL_ROOM, CELL_SEARCHES = range(20, 25)
# Then the ring of buckets, each with 1 + its newest entry, or 0, and a bit for each that has one:
HEADS = 25
# Then the hash table with a row of four for every cell that was reached: (stamp, cell), length from
# the start, the parent's cell, and bits for the walks wanted (0 to 7) and done (8 to 15). Then the
# queue: (next entry of the bucket, row). Last, once a search has asked for it, what
# `search.canonical_astar` needs: eight buckets, a label for each cell of the planes, and the
# entries of its open list.
KEY, LENGTH, PARENT, WALKS = 0, 1, 2, 3
LABELS = 2
"""What a search lacks: 1 space for cells that it has reached, 2 the labels of all cells."""
MOST_ENTRIES = 1 << 20
"""Number of entries of the open list of `search.canonical_astar` at most."""
FINE = 4
"""Binary logarithm of the number of buckets to a cell of length."""


class SearchWorkspace:
    """The memory of a search, kept from one to the next; it grows when a search needs more."""

    def __init__(self, space: FreeSpace, cells: int = 1 << 11) -> None:
        # One walk away from the goal lengthens a path's estimate by less than three times the
        # grid's sides.
        self._ring = 1 << (3 * (space.rows + space.cols + 4) << FINE).bit_length()
        self._sides, self.cells = (space.rows, space.cols), cells
        """Number of cells that a search may reach before the memory has to grow."""
        self._planes, self._labels = 64 * space.across[0].size, 0
        self.memory = self._new()

    def grow(self) -> None:
        """Add the memory that the last search lacked, and forget everything."""
        if self.memory[LACKING] == LABELS:
            self._labels = self._planes
        else:
            self.cells *= 4
        self.memory = self._new()

    def _new(self) -> Memory:
        table = HEADS + self._ring + (self._ring >> 6)
        queue = table + 2 * self.cells * 4
        buckets = queue + 2 * self.cells
        entries = buckets + 8 + self._labels
        room = min(self._labels, MOST_ENTRIES)
        memory = np.zeros(entries + room, dtype=np.int64)
        memory[RING], memory[SLOTS], memory[ROOM] = self._ring, 2 * self.cells, 2 * self.cells
        memory[TABLE], memory[QUEUE] = table, queue
        memory[ROWS], memory[COLS] = self._sides
        memory[CELL_BUCKETS], memory[CELL_LABELS] = buckets, buckets + 8
        memory[CELL_ENTRIES], memory[CELL_ROOM] = entries, room
        return memory


@inlined
def begin(memory: Memory, start: int, goal: int, bound: int, floor: int) -> None:
    """Set the counters for a new search for a path shorter than `bound`, none of which is shorter
    than `floor`."""
    memory[STAMP] += 1
    memory[BEST] = memory[BOUND] = bound
    for counter in (PUSHED, WAITING, REACHED, BUCKET, LACKING, WORK):
        memory[counter] = 0
    memory[GOAL_ROW], memory[GOAL_COL] = goal >> 16, goal & 0xFFFF
    memory[LEAST] = octile((start >> 16) - (goal >> 16), (start & 0xFFFF) - (goal & 0xFFFF))
    memory[FLOOR] = max(memory[LEAST], floor)


@inlined
def octile(rows: int, cols: int) -> int:
    """Return the length of the shortest path between two cells on an empty grid, by their distance
    in rows and columns."""
    rows, cols = abs(rows), abs(cols)
    low, high = min(rows, cols), max(rows, cols)
    return (high - low) * UNIT + low * ROOT


@inlined
def row_of(memory: Memory, key: int) -> int:
    """Return the index of the table's row that holds a key, or of the free one where it belongs.

    Cells that are neighbours in their row are neighbours here too, since they are often needed
    together.
    """
    slot = ((key >> 16) * 40503 + key) & (memory[SLOTS] - 1)
    while True:
        at = memory[TABLE] + 4 * slot
        held = memory[at + KEY]
        if held == key or held >> 32 != key >> 32:
            return int(at)
        slot = (slot + 1) & (memory[SLOTS] - 1)


@inlined
def claim(memory: Memory, cell: int, parent: int, length: int) -> int:
    """Record a path of this length to a cell: return the index of its row of the table, or -1 if
    the path gains nothing."""
    row, col = cell >> 16, cell & 0xFFFF
    if length + octile(row - memory[GOAL_ROW], col - memory[GOAL_COL]) >= memory[BEST]:
        return -1
    key = memory[STAMP] << 32 | cell
    at = row_of(memory, key)
    if memory[at + KEY] != key:
        if 2 * memory[REACHED] >= memory[SLOTS]:
            memory[LACKING] = 1
            return -1
        memory[REACHED] += 1
        memory[at + KEY], memory[at + LENGTH], memory[at + WALKS] = key, FAR, 0
    if length > memory[at + LENGTH]:
        return -1
    if length < memory[at + LENGTH]:
        memory[at + LENGTH], memory[at + PARENT], memory[at + WALKS] = length, parent, 0
        if row == memory[GOAL_ROW] and col == memory[GOAL_COL]:
            memory[BEST] = length
    return at


@lean
def want(memory: Memory, at: int, walks: int) -> None:
    """Put the walks from a claimed cell on the open list."""
    if walks & ~memory[at + WALKS]:
        memory[at + WALKS] |= walks
        cell = memory[at + KEY] & 0xFFFFFFFF
        left = octile((cell >> 16) - memory[GOAL_ROW], (cell & 0xFFFF) - memory[GOAL_COL])
        push(memory, (memory[at + LENGTH] + left - memory[LEAST]) >> (SHIFT - FINE), at)


@inlined
def push(memory: Memory, bucket: int, at: int) -> None:
    """Put a row of the table into a bucket of the open list."""
    entry = memory[PUSHED]
    if entry >= memory[ROOM]:
        memory[LACKING] = 1
        return
    memory[PUSHED] += 1
    memory[WAITING] += 1
    ring_at = bucket & (memory[RING] - 1)
    memory[memory[QUEUE] + entry] = memory[HEADS + ring_at] << 32 | at
    memory[HEADS + ring_at] = entry + 1
    memory[HEADS + memory[RING] + (ring_at >> 6)] |= 1 << (ring_at & 63)


@inlined
def pop(memory: Memory) -> int:
    """Take a row of the table out of the first bucket that has one."""
    ring, ring_at = HEADS + memory[RING], memory[BUCKET] & (memory[RING] - 1)
    word = ring_at >> 6
    bits = np.uint64(memory[ring + word]) & (ALL << np.uint64(ring_at & 63))
    while bits == 0:
        word = (word + 1) & ((memory[RING] >> 6) - 1)
        bits = np.uint64(memory[ring + word])
    first = 64 * word + lowest(bits)
    memory[BUCKET] += (first - ring_at) & (memory[RING] - 1)
    entry = memory[memory[QUEUE] + memory[HEADS + first] - 1]
    memory[HEADS + first] = entry >> 32
    if entry >> 32 == 0:
        memory[ring + word] &= ~(1 << (first & 63))
    memory[WAITING] -= 1
    return int(entry & 0xFFFFFFFF)
