"""Jump-point search without corner cutting over packed rows and columns: exactly optimal, deterministic.

The search follows Harabor & Grastien (AAAI 2011, ICAPS 2014): of all paths of one length between two cells only the one that
walks its diagonals first is looked at, and a straight walk is one scan over words to the next jump point. Four things are
arranged in our own way:

* Lengths are integers: `UNIT` a straight step and `ROOT` a diagonal one. A sum of them does not depend on its order, so equal
  lengths compare as equal, and different ones compare as they should as long as a path has fewer than 400 000 diagonal steps;
  two longer paths could be taken for equal if they differ by 1e-11 of their length.
* A cell reached again at equal length from another side is not dropped: the directions that this side adds are walked too.
* The open list is a ring of buckets, each a sixteenth of a cell wide. Inside a bucket the order is last in, first out; a cell
  may be opened twice, and the search ends at the first bucket behind the best path known.
* On a diagonal the straight walks to both sides that meet an obstacle are known beforehand and not taken (`FreeSpace`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.grid import Cell
from navcore.search.bits import ONE, PAD, compiled, highest, inlined, lean, lowest
from navcore.search.free_space import (
    AHEAD,
    BACK,
    FREE,
    PATIENCE,
    SQUARE,
    VAIN_AHEAD,
    FreeSpace,
    Planes,
    bit_of,
    forget,
    look_along,
)
from navcore.search.legs import fewest_turns, lay

Memory = npt.NDArray[np.int64]

SHIFT = 38
UNIT = 1 << SHIFT
"""Length of a straight step: 2^38, so that paths of 2^25 cells still have a length."""
ROOT = 388736063997
"""Length of a diagonal step: √2 · 2^38, rounded."""
FAR = np.int64(2**62)

EAST, WEST, SOUTH, NORTH, SOUTH_EAST, SOUTH_WEST, NORTH_EAST, NORTH_WEST = (1 << bit for bit in range(8))
ANYWHERE = 255

FOUND, UNREACHABLE, TIMEOUT, FULL = 0, 1, 2, 3

# A search's memory is one array of int64, so that handing it on costs little: first some counters …
PUSHED, WAITING, BEST, REACHED, STAMP, GOAL_ROW, GOAL_COL, LEAST, BUCKET, LAST, LACKING, RING, SLOTS, ROOM = range(14)
# … then the ring of buckets, each with 1 + its newest entry, 0 if it is empty …
HEADS = 16
# … then the hash table with a row of four for every cell the search has reached: (stamp, cell), length from the start, the
# parent's cell, and bits for the walks wanted (0 to 7) and done (8 to 15); then the queue: (next entry of the bucket, row).
KEY, LENGTH, PARENT, WALKS = 0, 1, 2, 3
FINE = 4
"""Buckets to a cell of length: 2^4."""


class Arena:
    """The memory of a search, kept from one to the next; it grows when a search needs more."""

    def __init__(self, space: FreeSpace, cells: int = 1 << 11) -> None:
        # One walk away from the goal lengthens a path's estimate by less than three times the grid's sides.
        self._ring = 1 << (3 * (space.rows + space.cols + 4) << FINE).bit_length()
        self._cells = cells
        self.memory = self._new()

    def grow(self) -> None:
        """Four times as much room, forgetting everything."""
        self._cells *= 4
        self.memory = self._new()

    def _new(self) -> Memory:
        memory = np.zeros(HEADS + self._ring + 2 * self._cells * 4 + 2 * self._cells, dtype=np.int64)
        memory[RING], memory[SLOTS], memory[ROOM] = self._ring, 2 * self._cells, 2 * self._cells
        return memory


def find(space: FreeSpace, arena: Arena, start: Cell, goal: Cell, budget: int) -> tuple[int, npt.NDArray[np.int64], int]:
    """Search between two free cells (row, col): how it ended, the (N, 2) cells of the path, and how many steps are diagonal.

    There are no cells if there is no path. `budget` is the number of straight walks and diagonal steps after which the search
    is given up.
    """
    while True:
        outcome = search(
            space.across,
            space.along,
            arena.memory,
            (start[0] + PAD) << 16 | (start[1] + PAD),
            (goal[0] + PAD) << 16 | (goal[1] + PAD),
            budget,
        )
        if outcome[0] != FULL:
            return outcome
        arena.grow()


@compiled
def search(
    across: Planes,
    along: Planes,
    memory: Memory,
    start: int,
    goal: int,
    budget: int,
) -> tuple[int, npt.NDArray[np.int64], int]:
    """Search on memory that the caller owns; cells are (row + PAD) << 16 | (col + PAD). FULL if the memory does not suffice."""
    begin(memory, start, goal)
    saved = mark_goal(across, along, goal)
    want(memory, claim(memory, start, start, 0), ANYWHERE)
    status = run(across, along, memory, budget)
    unmark_goal(across, along, goal, saved)
    for bucket in range(memory[BUCKET], memory[LAST] + 1):
        memory[HEADS + (bucket & (memory[RING] - 1))] = 0
    if status == FOUND:
        cells = trace(across, memory, start, goal)
        return FOUND, cells, (memory[BEST] - (len(cells) - 1) * UNIT) // (ROOT - UNIT)
    return status, np.empty((0, 2), dtype=np.int64), 0


@inlined
def begin(memory: Memory, start: int, goal: int) -> None:
    """Set the counters for a new search."""
    memory[STAMP] += 1
    memory[BEST] = FAR
    for counter in (PUSHED, WAITING, REACHED, BUCKET, LAST, LACKING):
        memory[counter] = 0
    memory[GOAL_ROW], memory[GOAL_COL] = goal >> 16, goal & 0xFFFF
    memory[LEAST] = octile((start >> 16) - (goal >> 16), (start & 0xFFFF) - (goal & 0xFFFF))


@inlined
def octile(rows: int, cols: int) -> int:
    """Length of the shortest path between two cells on an empty grid, by their distance in rows and columns."""
    rows, cols = abs(rows), abs(cols)
    low, high = min(rows, cols), max(rows, cols)
    return (high - low) * UNIT + low * ROOT


@compiled
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
    forget(across, row)
    forget(along, col)
    return saved


@compiled
def unmark_goal(across: Planes, along: Planes, goal: int, saved: tuple[np.uint64, np.uint64, np.uint64, np.uint64]) -> None:
    """Undo `mark_goal`."""
    row, col = goal >> 16, goal & 0xFFFF
    across[AHEAD, row, col >> 6], across[BACK, row, col >> 6] = saved[0], saved[1]
    along[AHEAD, col, row >> 6], along[BACK, col, row >> 6] = saved[2], saved[3]
    forget(across, row)
    forget(along, col)


@inlined
def row_of(memory: Memory, key: int) -> int:
    """Where the row of the table begins that holds a key, or the free one where it belongs.

    Cells that are neighbours in their row are neighbours here too, for they are often needed together.
    """
    slot = ((key >> 16) * 40503 + key) & (memory[SLOTS] - 1)
    while True:
        at = HEADS + memory[RING] + 4 * slot
        held = memory[at + KEY]
        if held == key or held >> 32 != key >> 32:
            return int(at)
        slot = (slot + 1) & (memory[SLOTS] - 1)


@inlined
def claim(memory: Memory, cell: int, parent: int, length: int) -> int:
    """A path of this length leads to a cell: where its row of the table begins, or -1 if nothing is gained by that path."""
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
    """From a cell that was claimed the given walks are worth looking at."""
    if walks & ~memory[at + WALKS]:
        memory[at + WALKS] |= walks
        cell = memory[at + KEY] & 0xFFFFFFFF
        left = octile((cell >> 16) - memory[GOAL_ROW], (cell & 0xFFFF) - memory[GOAL_COL])
        push(memory, (memory[at + LENGTH] + left - memory[LEAST]) >> (SHIFT - FINE), at)


@inlined
def push(memory: Memory, bucket: int, at: int) -> None:
    """Put a row of the table into a bucket."""
    entry = memory[PUSHED]
    if entry >= memory[ROOM]:
        memory[LACKING] = 1
        return
    memory[PUSHED] += 1
    memory[WAITING] += 1
    memory[LAST] = max(memory[LAST], bucket)
    head = HEADS + (bucket & (memory[RING] - 1))
    memory[HEADS + memory[RING] + 4 * memory[SLOTS] + entry] = memory[head] << 32 | at
    memory[head] = entry + 1


@lean
def run(across: Planes, along: Planes, memory: Memory, budget: int) -> int:
    """Open bucket after bucket until none can hold a shorter path."""
    while memory[WAITING] > 0 and memory[BUCKET] <= (memory[BEST] - memory[LEAST]) >> (SHIFT - FINE):
        head = HEADS + (memory[BUCKET] & (memory[RING] - 1))
        if memory[head] == 0:
            memory[BUCKET] += 1
            continue
        entry = memory[HEADS + memory[RING] + 4 * memory[SLOTS] + memory[head] - 1]
        memory[head] = entry >> 32
        memory[WAITING] -= 1
        at = entry & 0xFFFFFFFF
        walks = memory[at + WALKS]
        todo = walks & ~(walks >> 8) & 0xFF
        if todo == 0:
            continue
        memory[at + WALKS] = walks | todo << 8
        budget -= open_cell(across, along, memory, at, todo)
        if memory[LACKING]:
            return FULL
        if budget < 0:
            return TIMEOUT
    return FOUND if memory[BEST] < FAR else UNREACHABLE


@inlined
def open_cell(across: Planes, along: Planes, memory: Memory, at: int, todo: int) -> int:
    """Walk from a cell in the directions asked for; returns how many straight walks and diagonal steps that took."""
    cell, length = memory[at + KEY] & 0xFFFFFFFF, memory[at + LENGTH]
    row, col = cell >> 16, cell & 0xFFFF
    if length + octile(row - memory[GOAL_ROW], col - memory[GOAL_COL]) >= memory[BEST]:
        return 0
    count = 0
    for side in range(2):
        if todo & (EAST << side):
            count += 1
            walk_row(across, memory, row, col, side, cell, length)
        if todo & (SOUTH << side):
            count += 1
            walk_col(along, memory, row, col, side, cell, length)
    for corner in range(4):
        if todo & (SOUTH_EAST << corner):
            count += walk_diagonal(across, along, memory, row, col, corner, cell, length)
    return count


@inlined
def stop_ahead(planes: Planes, line: int, at: int) -> int:
    """The first cell behind `at` on a line where a walk towards higher cells stops."""
    word = np.uint64(at >> 6)
    bits = planes[AHEAD, np.uint64(line), word] & (np.uint64(0xFFFFFFFFFFFFFFFE) << np.uint64(at & 63))
    while bits == 0:
        word += ONE
        bits = planes[AHEAD, np.uint64(line), word]
    return 64 * int(word) + int(lowest(bits))


@inlined
def stop_back(planes: Planes, line: int, at: int) -> int:
    """The same towards lower cells."""
    word = np.uint64(at >> 6)
    bits = planes[BACK, np.uint64(line), word] & ((ONE << np.uint64(at & 63)) - ONE)
    while bits == 0:
        word -= ONE
        bits = planes[BACK, np.uint64(line), word]
    return 64 * int(word) + int(highest(bits))


@inlined
def walk_row(
    across: Planes,
    memory: Memory,
    row: int,
    col: int,
    side: int,
    parent: int,
    length: int,
) -> None:
    """Walk east (side 0) or west (1) to the next jump point, if an obstacle is not first."""
    stop = stop_back(across, row, col) if side else stop_ahead(across, row, col)
    if bit_of(across, FREE, row, stop) == 0:
        return
    at = claim(memory, row << 16 | stop, parent, length + abs(stop - col) * UNIT)
    if at < 0:
        return
    behind = stop + 1 if side else stop - 1
    walks = WEST if side else EAST
    if bit_of(across, FREE, row + 1, stop) > bit_of(across, FREE, row + 1, behind):
        walks |= SOUTH | (SOUTH_WEST if side else SOUTH_EAST)
    if bit_of(across, FREE, row - 1, stop) > bit_of(across, FREE, row - 1, behind):
        walks |= NORTH | (NORTH_WEST if side else NORTH_EAST)
    want(memory, at, walks)


@inlined
def walk_col(
    along: Planes,
    memory: Memory,
    row: int,
    col: int,
    side: int,
    parent: int,
    length: int,
) -> None:
    """Walk south (side 0) or north (1) to the next jump point, if an obstacle is not first."""
    stop = stop_back(along, col, row) if side else stop_ahead(along, col, row)
    if bit_of(along, FREE, col, stop) == 0:
        return
    at = claim(memory, stop << 16 | col, parent, length + abs(stop - row) * UNIT)
    if at < 0:
        return
    behind = stop + 1 if side else stop - 1
    walks = NORTH if side else SOUTH
    if bit_of(along, FREE, col + 1, stop) > bit_of(along, FREE, col + 1, behind):
        walks |= EAST | (NORTH_EAST if side else SOUTH_EAST)
    if bit_of(along, FREE, col - 1, stop) > bit_of(along, FREE, col - 1, behind):
        walks |= WEST | (NORTH_WEST if side else SOUTH_WEST)
    want(memory, at, walks)


@inlined
def walk_diagonal(
    across: Planes,
    along: Planes,
    memory: Memory,
    row: int,
    col: int,
    corner: int,
    parent: int,
    length: int,
) -> int:
    """Walk diagonally until a corner or obstacle is in the way, with a straight walk to both sides from every cell.

    `corner`: 0 south-east, 1 south-west, 2 north-east, 3 north-west. Returns the number of steps.
    """
    west, north = corner & 1, corner >> 1
    step_row, step_col = 1 - 2 * north, 1 - 2 * west
    count, room = 0, steps_to_goal(memory, row, col, step_row, step_col)
    while True:
        steps, open_row, open_col = slide(across, along, row, col, west, north, room - count)
        row += steps * step_row
        col += steps * step_col
        length += steps * ROOT
        count += steps
        if length + octile(row - memory[GOAL_ROW], col - memory[GOAL_COL]) >= memory[BEST]:
            return count
        if count == room:
            claim(memory, row << 16 | col, parent, length)
            return count
        if not (open_row or open_col):
            return count
        if open_row and not is_vain(across, VAIN_AHEAD + west, row, col):
            walk_row(across, memory, row, col, west, parent, length)
        if open_col and not is_vain(along, VAIN_AHEAD + north, col, row):
            walk_col(along, memory, row, col, north, parent, length)


@inlined
def steps_to_goal(memory: Memory, row: int, col: int, step_row: int, step_col: int) -> int:
    """Diagonal steps from a cell to the goal; more than any grid has if it does not lie in that direction."""
    steps = (memory[GOAL_ROW] - row) * step_row
    return steps if steps > 0 and steps == (memory[GOAL_COL] - col) * step_col else 1 << 30


@inlined
def slide(across: Planes, along: Planes, row: int, col: int, west: int, north: int, most: int) -> tuple[int, bool, bool]:
    """Walk diagonally, at most so many steps, to the next cell from which a straight walk may lead somewhere.

    Returns the steps taken, and whether it is the walk along the row, or along the column; neither if the way ends before.
    """
    step_row, step_col = np.uint64(1 - 2 * north), np.uint64(1 - 2 * west)
    plane_row, plane_col = np.uint64(VAIN_AHEAD + west), np.uint64(VAIN_AHEAD + north)
    line, at, steps = np.uint64(row), np.uint64(col), 0
    up, left = np.uint64(north), np.uint64(west)
    low, shift = np.uint64(63), np.uint64(6)
    while steps < most and across[np.uint64(SQUARE), line - up, (at - left) >> shift] >> ((at - left) & low) & ONE:
        line += step_row
        at += step_col
        steps += 1
        vain_row = across[plane_row, line, at >> shift] >> (at & low)
        vain_col = along[plane_col, at, line >> shift] >> (line & low)
        if (vain_row & vain_col & ONE) == 0:
            return steps, (vain_row & ONE) == 0, (vain_col & ONE) == 0
    return steps, False, False


@inlined
def is_vain(planes: Planes, plane: int, line: int, at: int) -> bool:
    """Whether a straight walk ends at an obstacle, for lines that are perhaps not looked along yet."""
    asked = planes[VAIN_AHEAD, line, 0]
    if asked < PATIENCE:
        planes[VAIN_AHEAD, line, 0] = asked + ONE
        if asked + ONE < PATIENCE:
            return False
        look_along(planes, line)
    return bool(bit_of(planes, plane, line, at) != 0)


@compiled
def trace(across: Planes, memory: Memory, start: int, goal: int) -> npt.NDArray[np.int64]:
    """(N, 2) every cell from start to goal, with as few turns as the jump points allow."""
    corners = np.empty(memory[REACHED] + 1, dtype=np.int64)
    corners[-1] = goal
    first, steps = len(corners) - 1, 0
    while corners[first] != start:
        here = corners[first]
        there = memory[row_of(memory, memory[STAMP] << 32 | here) + PARENT]
        steps += max(abs((here >> 16) - (there >> 16)), abs((here & 0xFFFF) - (there & 0xFFFF)))
        first -= 1
        corners[first] = there
    corners = corners[first:]
    straight_first = fewest_turns(across, corners)
    cells = np.empty((steps + 1, 2), dtype=np.int64)
    cells[0, 0], cells[0, 1] = (start >> 16) - PAD, (start & 0xFFFF) - PAD
    at = 0
    for leg in range(len(corners) - 1):
        at = lay(cells, at, corners[leg + 1], straight_first[leg])
    return cells
