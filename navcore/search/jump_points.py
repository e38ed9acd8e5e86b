"""Jump-point search without corner cutting over packed rows and columns: exactly optimal, deterministic.

The search follows Harabor & Grastien (AAAI 2011, ICAPS 2014): of all paths of one length between two cells only the one that
walks its diagonals first is looked at, and a straight walk is one scan over words to the next jump point. Three things are our own
arrangement:

* Lengths are integers: `UNIT` a straight step and `ROOT` a diagonal one. A sum of them does not depend on its order, so equal
  lengths compare as equal, and different ones differ as long as a path has fewer than 400 000 diagonal steps; a longer one could
  be taken for a tie if it is 1e-11 of its length away.
* A cell reached again at equal length from another side is not dropped: the directions that this side adds are walked too.
* The open list is a ring of buckets, one cell of length wide. Inside a bucket the order is last in, first out; a cell may be
  opened twice, and the search ends at the first bucket behind the best path known.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from navcore.search.bits import ONE, PAD, highest, lowest
from navcore.search.free_space import AHEAD, BACK, FREE, SQUARE, VAIN_AHEAD, VAIN_BACK, FreeSpace, Planes, look_along

Table = npt.NDArray[np.int64]
Queue = npt.NDArray[np.int32]

SHIFT = 38
UNIT = 1 << SHIFT
"""Length of a straight step: 2^38, so that paths of 2^25 cells still have a length."""
ROOT = 388736063997
"""Length of a diagonal step: √2 · 2^38, rounded."""
FAR = np.int64(2**62)

EAST, WEST, SOUTH, NORTH, SOUTH_EAST, SOUTH_WEST, NORTH_EAST, NORTH_WEST = (1 << bit for bit in range(8))
ANYWHERE = 255

FOUND, UNREACHABLE, TIMEOUT, FULL = 0, 1, 2, 3

# Columns of the table: one row for every cell the search has reached.
KEY, LENGTH, PARENT, WALKS = 0, 1, 2, 3
# The search's few counters.
PUSHED, WAITING, BEST, REACHED, STAMP, GOAL_ROW, GOAL_COL, LEAST, BUCKET, LAST, LACKING = range(11)
FINE = 4


class Arena:
    """The memory of a search, kept from one to the next; it grows when a search needs more."""

    def __init__(self, space: FreeSpace, cells: int = 1 << 11) -> None:
        ring = 1 << int(3 * (space.rows + space.cols + 4) << FINE).bit_length()
        self.heads: Queue = np.full(ring, -1, dtype=np.int32)
        """The newest entry of each bucket; -1 in all of them between searches."""
        self.counters: npt.NDArray[np.int64] = np.zeros(11, dtype=np.int64)
        self.table: Table = np.zeros((cells, 4), dtype=np.int64)
        """Hash table: (stamp, cell), length from the start, parent's cell, and bits: walks wanted (0 to 7) and done (8 to 15)."""
        self.queue: Queue = np.empty((2 * cells, 2), dtype=np.int32)
        """Entries of the open list: the next one in its bucket, and the row of the table."""

    def grow(self) -> None:
        """Four times as much room, forgetting everything."""
        self.table = np.zeros((4 * len(self.table), 4), dtype=np.int64)
        self.queue = np.empty((4 * len(self.queue), 2), dtype=np.int32)
        self.counters[STAMP] = 0


def find(
    space: FreeSpace, arena: Arena, start: tuple[int, int], goal: tuple[int, int], budget: int
) -> tuple[int, npt.NDArray[np.int64]]:
    """Search between two free cells (row, col): how it ended, and the (N, 2) cells of the path (none if there is none).

    `budget` is the number of straight walks after which the search is given up.
    """
    while True:
        outcome = search(
            space.across,
            space.along,
            arena.heads,
            arena.counters,
            arena.table,
            arena.queue,
            (start[0] + PAD) << 16 | (start[1] + PAD),
            (goal[0] + PAD) << 16 | (goal[1] + PAD),
            budget,
        )
        if outcome[0] != FULL:
            return outcome
        arena.grow()


@numba.njit(cache=True, nogil=True)
def search(
    across: Planes,
    along: Planes,
    heads: Queue,
    counters: npt.NDArray[np.int64],
    table: Table,
    queue: Queue,
    start: int,
    goal: int,
    budget: int,
) -> tuple[int, npt.NDArray[np.int64]]:
    """Search on memory that the caller owns; cells are (row + PAD) << 16 | (col + PAD). FULL if the memory does not suffice."""
    begin(counters, start, goal)
    saved = mark_goal(across, along, goal)
    reach(heads, counters, table, queue, start, start, 0, ANYWHERE)
    status = run(across, along, heads, counters, table, queue, budget)
    unmark_goal(across, along, goal, saved)
    for bucket in range(counters[BUCKET], counters[LAST] + 1):
        heads[bucket & (len(heads) - 1)] = -1
    if status == FOUND:
        return FOUND, trace(across[FREE], table, counters, start, goal)
    return status, np.empty((0, 2), dtype=np.int64)


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def begin(counters: npt.NDArray[np.int64], start: int, goal: int) -> None:
    """Set the counters for a new search."""
    stamp = counters[STAMP] + 1
    counters[:] = 0
    counters[STAMP], counters[BEST] = stamp, FAR
    counters[GOAL_ROW], counters[GOAL_COL] = goal >> 16, goal & 0xFFFF
    counters[LEAST] = octile((start >> 16) - (goal >> 16), (start & 0xFFFF) - (goal & 0xFFFF))


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def octile(rows: int, cols: int) -> int:
    """Length of the shortest path between two cells on an empty grid, by their distance in rows and columns."""
    rows, cols = abs(rows), abs(cols)
    low, high = min(rows, cols), max(rows, cols)
    return (high - low) * UNIT + low * ROOT


@numba.njit(cache=True, nogil=True)
def mark_goal(across: Planes, along: Planes, goal: int) -> tuple[np.uint64, np.uint64, np.uint64, np.uint64]:
    """Make every straight walk stop at the goal; returns what the words were."""
    row, col = goal >> 16, goal & 0xFFFF
    saved = (
        across[AHEAD, row, col >> 6],
        across[BACK, row, col >> 6],
        along[AHEAD, col, row >> 6],
        along[BACK, col, row >> 6],
    )
    for plane in (AHEAD, BACK):
        across[plane, row, col >> 6] |= ONE << np.uint64(col & 63)
        along[plane, col, row >> 6] |= ONE << np.uint64(row & 63)
    across[VAIN_AHEAD : VAIN_BACK + 1, row] = 0
    along[VAIN_AHEAD : VAIN_BACK + 1, col] = 0
    return saved


@numba.njit(cache=True, nogil=True)
def unmark_goal(
    across: Planes, along: Planes, goal: int, saved: tuple[np.uint64, np.uint64, np.uint64, np.uint64]
) -> None:
    """Undo `mark_goal`."""
    row, col = goal >> 16, goal & 0xFFFF
    across[AHEAD, row, col >> 6], across[BACK, row, col >> 6] = saved[0], saved[1]
    along[AHEAD, col, row >> 6], along[BACK, col, row >> 6] = saved[2], saved[3]
    across[VAIN_AHEAD : VAIN_BACK + 1, row] = 0
    along[VAIN_AHEAD : VAIN_BACK + 1, col] = 0


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def slot_of(table: Table, key: int) -> int:
    """The row of the table that holds a key, or the free one where it belongs."""
    mask = len(table) - 1
    slot = (np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    while True:
        slot = np.uint64(slot) & np.uint64(mask)
        held = table[slot, KEY]
        if held == key or held >> 32 != key >> 32:
            return np.int64(slot)
        slot += np.uint64(1)


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def reach(
    heads: Queue,
    counters: npt.NDArray[np.int64],
    table: Table,
    queue: Queue,
    cell: int,
    parent: int,
    length: int,
    walks: int,
) -> None:
    """A path of this length leads to a cell, and from there the given walks are worth looking at."""
    row, col = cell >> 16, cell & 0xFFFF
    estimate = length + octile(row - counters[GOAL_ROW], col - counters[GOAL_COL])
    if estimate >= counters[BEST]:
        return
    key = counters[STAMP] << 32 | cell
    slot = slot_of(table, key)
    if table[slot, KEY] != key:
        if counters[REACHED] >= len(table) // 2:
            counters[LACKING] = 1
            return
        counters[REACHED] += 1
        table[slot, KEY], table[slot, LENGTH], table[slot, WALKS] = key, FAR, 0
    if length > table[slot, LENGTH]:
        return
    if length < table[slot, LENGTH]:
        table[slot, LENGTH], table[slot, PARENT], table[slot, WALKS] = length, parent, 0
    if row == counters[GOAL_ROW] and col == counters[GOAL_COL]:
        counters[BEST] = length
        return
    if walks & ~table[slot, WALKS] & 0xFF:
        if counters[PUSHED] >= len(queue):
            counters[LACKING] = 1
            return
        table[slot, WALKS] |= walks
        push(heads, counters, queue, (estimate - counters[LEAST]) >> (SHIFT - FINE), slot)


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def push(heads: Queue, counters: npt.NDArray[np.int64], queue: Queue, bucket: int, slot: int) -> None:
    """Put a row of the table into a bucket."""
    entry = counters[PUSHED]
    counters[PUSHED] += 1
    counters[WAITING] += 1
    counters[LAST] = max(counters[LAST], bucket)
    bucket &= len(heads) - 1
    queue[entry, 0], queue[entry, 1] = heads[bucket], slot
    heads[bucket] = entry


@numba.njit(cache=True, nogil=True, _nrt=False)
def run(
    across: Planes,
    along: Planes,
    heads: Queue,
    counters: npt.NDArray[np.int64],
    table: Table,
    queue: Queue,
    budget: int,
) -> int:
    """Open bucket after bucket until none can hold a shorter path."""
    ring = len(heads) - 1
    while counters[WAITING] > 0 and counters[BUCKET] <= (counters[BEST] - counters[LEAST]) >> (SHIFT - FINE):
        entry = heads[counters[BUCKET] & ring]
        if entry < 0:
            counters[BUCKET] += 1
            continue
        heads[counters[BUCKET] & ring] = queue[entry, 0]
        counters[WAITING] -= 1
        slot = queue[entry, 1]
        walks = table[slot, WALKS]
        todo = walks & ~(walks >> 8) & 0xFF
        if todo == 0:
            continue
        table[slot, WALKS] = walks | todo << 8
        budget -= open_cell(across, along, heads, counters, table, queue, slot, todo)
        if counters[LACKING]:
            return FULL
        if budget < 0:
            return TIMEOUT
    return FOUND if counters[BEST] < FAR else UNREACHABLE


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def open_cell(
    across: Planes,
    along: Planes,
    heads: Queue,
    counters: npt.NDArray[np.int64],
    table: Table,
    queue: Queue,
    slot: int,
    todo: int,
) -> int:
    """Walk from a cell in the directions asked for; returns the number of straight walks."""
    cell, length = table[slot, KEY] & 0xFFFFFFFF, table[slot, LENGTH]
    row, col = cell >> 16, cell & 0xFFFF
    estimate = length + octile(row - counters[GOAL_ROW], col - counters[GOAL_COL])
    if estimate >= counters[BEST]:
        return 0
    count = 0
    for side in range(2):
        if todo & (EAST, WEST)[side]:
            count += 1
            walk_row(across, along, heads, counters, table, queue, row, col, side, cell, length)
        if todo & (SOUTH, NORTH)[side]:
            count += 1
            walk_col(across, along, heads, counters, table, queue, row, col, side, cell, length)
    for corner in range(4):
        if todo & (SOUTH_EAST << corner):
            count += walk_diagonal(across, along, heads, counters, table, queue, row, col, corner, cell, length)
    return count


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def bit_at(planes: Planes, line: int, at: int) -> np.uint64:
    """1 if a cell is free, else 0."""
    return planes[FREE, np.uint64(line), np.uint64(at >> 6)] >> np.uint64(at & 63) & ONE


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def bit_of(planes: Planes, plane: int, line: int, at: int) -> np.uint64:
    """One bit of a plane."""
    return planes[np.uint64(plane), np.uint64(line), np.uint64(at >> 6)] >> np.uint64(at & 63) & ONE


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def stop_ahead(planes: Planes, line: int, at: int) -> int:
    """The first cell behind `at` on a line where a walk towards higher cells stops."""
    word = np.uint64(at >> 6)
    bits = planes[AHEAD, np.uint64(line), word] & (np.uint64(0xFFFFFFFFFFFFFFFE) << np.uint64(at & 63))
    while bits == 0:
        word += ONE
        bits = planes[AHEAD, np.uint64(line), word]
    return np.int64(word << np.uint64(6)) + lowest(bits)


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def stop_back(planes: Planes, line: int, at: int) -> int:
    """The same towards lower cells."""
    word = np.uint64(at >> 6)
    bits = planes[BACK, np.uint64(line), word] & ((ONE << np.uint64(at & 63)) - ONE)
    while bits == 0:
        word -= ONE
        bits = planes[BACK, np.uint64(line), word]
    return np.int64(word << np.uint64(6)) + highest(bits)


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def walk_row(
    across: Planes,
    along: Planes,
    heads: Queue,
    counters: npt.NDArray[np.int64],
    table: Table,
    queue: Queue,
    row: int,
    col: int,
    side: int,
    parent: int,
    length: int,
) -> None:
    """Walk east (side 0) or west (1) to the next jump point, if an obstacle is not first."""
    stop = stop_back(across, row, col) if side else stop_ahead(across, row, col)
    if bit_at(across, row, stop) == 0:
        return
    behind = stop + 1 if side else stop - 1
    walks = WEST if side else EAST
    if bit_at(across, row + 1, stop) > bit_at(across, row + 1, behind):
        walks |= SOUTH | (SOUTH_WEST if side else SOUTH_EAST)
    if bit_at(across, row - 1, stop) > bit_at(across, row - 1, behind):
        walks |= NORTH | (NORTH_WEST if side else NORTH_EAST)
    reach(heads, counters, table, queue, row << 16 | stop, parent, length + abs(stop - col) * UNIT, walks)


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def walk_col(
    across: Planes,
    along: Planes,
    heads: Queue,
    counters: npt.NDArray[np.int64],
    table: Table,
    queue: Queue,
    row: int,
    col: int,
    side: int,
    parent: int,
    length: int,
) -> None:
    """Walk south (side 0) or north (1) to the next jump point, if an obstacle is not first."""
    stop = stop_back(along, col, row) if side else stop_ahead(along, col, row)
    if bit_at(along, col, stop) == 0:
        return
    behind = stop + 1 if side else stop - 1
    walks = NORTH if side else SOUTH
    if bit_at(along, col + 1, stop) > bit_at(along, col + 1, behind):
        walks |= EAST | (NORTH_EAST if side else SOUTH_EAST)
    if bit_at(along, col - 1, stop) > bit_at(along, col - 1, behind):
        walks |= WEST | (NORTH_WEST if side else SOUTH_WEST)
    reach(heads, counters, table, queue, stop << 16 | col, parent, length + abs(stop - row) * UNIT, walks)


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def walk_diagonal(
    across: Planes,
    along: Planes,
    heads: Queue,
    counters: npt.NDArray[np.int64],
    table: Table,
    queue: Queue,
    row: int,
    col: int,
    corner: int,
    parent: int,
    length: int,
) -> int:
    """Walk diagonally until a corner or obstacle is in the way, with a straight walk to both sides from every cell.

    `corner`: 0 south-east, 1 south-west, 2 north-east, 3 north-west. Returns the number of straight walks.
    """
    west, north = corner & 1, corner >> 1
    step_row, step_col = 1 - 2 * north, 1 - 2 * west
    count = 0
    while bit_of(across, SQUARE, row - north, col - west):
        row += step_row
        col += step_col
        length += ROOT
        count += 1
        if row == counters[GOAL_ROW] and col == counters[GOAL_COL]:
            reach(heads, counters, table, queue, row << 16 | col, parent, length, 0)
            return count
        promising_row = bit_of(across, VAIN_AHEAD + west, row, col) == 0
        promising_col = bit_of(along, VAIN_AHEAD + north, col, row) == 0
        if not (promising_row or promising_col):
            continue
        if length + octile(row - counters[GOAL_ROW], col - counters[GOAL_COL]) >= counters[BEST]:
            return count
        if promising_row and not is_vain(across, VAIN_AHEAD + west, row, col):
            walk_row(across, along, heads, counters, table, queue, row, col, west, parent, length)
        if promising_col and not is_vain(along, VAIN_AHEAD + north, col, row):
            walk_col(across, along, heads, counters, table, queue, row, col, north, parent, length)
    return count


@numba.njit(cache=True, nogil=True, forceinline=True, _nrt=False)
def is_vain(planes: Planes, plane: int, line: int, at: int) -> bool:
    """Whether a straight walk ends at an obstacle, for lines that are perhaps not looked along yet."""
    if planes[VAIN_AHEAD, line, 0] == 0:
        look_along(planes, line)
    return bit_of(planes, plane, line, at) != 0


@numba.njit(cache=True, nogil=True)
def trace(
    free: npt.NDArray[np.uint64], table: Table, counters: npt.NDArray[np.int64], start: int, goal: int
) -> npt.NDArray[np.int64]:
    """(N, 2) every cell from start to goal: from a parent to its child first diagonally, then straight."""
    corners = np.empty(counters[REACHED] + 1, dtype=np.int64)
    corners[0], count, steps = goal, 1, 0
    while corners[count - 1] != start:
        here = corners[count - 1]
        there = table[slot_of(table, counters[STAMP] << 32 | here), PARENT]
        steps += max(abs((here >> 16) - (there >> 16)), abs((here & 0xFFFF) - (there & 0xFFFF)))
        corners[count] = there
        count += 1
    cells = np.empty((steps + 1, 2), dtype=np.int64)
    at = 0
    cells[0, 0], cells[0, 1] = (start >> 16) - PAD, (start & 0xFFFF) - PAD
    for index in range(count - 2, -1, -1):
        row, col = (corners[index] >> 16) - PAD, (corners[index] & 0xFFFF) - PAD
        while cells[at, 0] != row or cells[at, 1] != col:
            cells[at + 1, 0] = cells[at, 0] + np.sign(row - cells[at, 0])
            cells[at + 1, 1] = cells[at, 1] + np.sign(col - cells[at, 1])
            at += 1
    return cells
