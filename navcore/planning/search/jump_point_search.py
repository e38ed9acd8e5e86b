"""Jump-point search without corner cutting over packed rows and columns: exactly optimal,
deterministic.

The search follows Harabor & Grastien (AAAI 2011, ICAPS 2014): of all paths of one length between
two cells only the one that walks its diagonals first is examined, and a straight walk is one scan
over words to the next jump point. Four details differ:

* Lengths are integers, so that equal ones compare as equal.
* A cell reached again at equal length from another side is not dropped: the directions that this
  side adds are walked too.
* The open list is a ring of buckets (`search.open_list`); the search ends at the first one behind
  the best path known.
* On a diagonal the straight walks to both sides that are dead ends are known beforehand and not
  taken (`FreeSpace`); cells with no other are passed many at a time (`search.diagonals`).

Among dense random obstacles, where walks end after a few cells, `search.canonical_astar` goes on.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined, lean, nested
from navcore.grid.bitplane import ONE, PAD, BitPlanes, highest, lowest
from navcore.grid.flood_fill import are_separate
from navcore.grid.free_space import (
    AHEAD,
    BACK,
    DEAD_END_AHEAD,
    FREE,
    REQUESTS_BEFORE_SCAN,
    SQUARE,
    FreeSpace,
    bit_of,
    find_dead_ends,
)
from navcore.grid.grid import Cell
from navcore.planning.search.canonical_astar import search_cells, trace_cells
from navcore.planning.search.diagonals import passable, settle, survey
from navcore.planning.search.open_list import (
    BEST,
    BOUND,
    BUCKET,
    CELL_ROOM,
    COLS,
    FAR,
    FINE,
    FLOOR,
    GOAL_COL,
    GOAL_ROW,
    KEY,
    LABELS,
    LACKING,
    LEAST,
    LENGTH,
    PARENT,
    PUSHED,
    QUEUE,
    REACHED,
    ROOT,
    ROWS,
    SHIFT,
    STAMP,
    UNIT,
    WAITING,
    WALKS,
    WORK,
    Memory,
    SearchWorkspace,
    begin,
    claim,
    octile,
    pop,
    row_of,
    want,
)
from navcore.planning.search.path_reconstruction import expand_leg, fewest_turns

EAST, WEST, SOUTH, NORTH, SOUTH_EAST, SOUTH_WEST, NORTH_EAST, NORTH_WEST = (
    1 << bit for bit in range(8)
)
ANYWHERE = 255

FOUND, UNREACHABLE, TIMEOUT, OUTSIDE, START_BLOCKED, GOAL_BLOCKED, FULL = range(7)
"""Status of a search that has ended; FULL: its memory did not suffice."""

IN_ONE_GO = 64
"""Number of steps of a diagonal after which the length of the path is checked."""
ON_FOOT, FARTHER = 2, 32
"""Steps of a diagonal taken cell by cell: at its start, since there are seldom more among many
obstacles; and where it is not surveyed."""

BEFORE_FLOOD, SWEEPS = 1 << 17, 3
"""Number of straight walks and diagonal steps after which a flood from the goal may tell that there
is no path, and the number of sweeps that it may take."""
BEFORE_CELLS, SHORT, WIDE = 128, 8, 12
"""Number of entries of the open list after which the search goes on from cell to cell
(`search.canonical_astar`) if its walks have been shorter than this many cells on average, and at
least so many jump points wait: in the corridors of a maze there are few cells to open at once."""
ENDLESS = 1 << 62
"""Budget of a search that is never given up."""


def find(
    space: FreeSpace, workspace: SearchWorkspace, start: Cell, goal: Cell, budget: int
) -> tuple[int, npt.NDArray[np.int64], int]:
    """Search between two cells (row, col): return the status, the (N, 2) cells of the path, and the
    number of diagonal steps.

    There are no cells without a path. `budget` is the number of straight walks and diagonal steps
    after which the search is given up, and of the entries of the open list where it goes on from
    cell to cell.
    """
    while True:
        outcome = search(
            space.across,
            space.along,
            space.diagonal_ends,
            workspace.memory,
            *start,
            *goal,
            budget,
            FAR,
            0,
        )
        if outcome[0] != FULL:
            return outcome
        workspace.grow()


@compiled
def search(
    across: BitPlanes,
    along: BitPlanes,
    diagonal_ends: BitPlanes,
    memory: Memory,
    start_row: int,
    start_col: int,
    goal_row: int,
    goal_col: int,
    budget: int,
    bound: int,
    floor: int,
) -> tuple[int, npt.NDArray[np.int64], int]:
    """Search for a path shorter than `bound` on memory that the caller owns; no path is shorter
    than `floor`. Where there is no path however long, `memory[BOUND]` becomes `FAR`.

    The ends are single numbers, since a tuple costs a microsecond to pass.
    """
    start, goal = (
        number_of(across, memory, start_row, start_col),
        number_of(across, memory, goal_row, goal_col),
    )
    if start <= 0 or goal <= 0:
        status = OUTSIDE if min(start, goal) < 0 else START_BLOCKED if start == 0 else GOAL_BLOCKED
        return status, np.empty((0, 2), dtype=np.int64), 0
    begin(memory, start, goal, bound, floor)
    at = claim(memory, start, start, 0)
    if at < 0:
        return UNREACHABLE, np.empty((0, 2), dtype=np.int64), 0
    settle(across, along)
    want(memory, at, ANYWHERE)
    first = min(budget, BEFORE_FLOOD)
    # Of a type: each constant would have `run` compiled for itself.
    few, endless = np.int64(BEFORE_CELLS), np.int64(ENDLESS)
    status = run(across, along, diagonal_ends, memory, goal, first, few)
    cells = np.empty((0, 2), dtype=np.int64)
    if status == TIMEOUT and memory[PUSHED] >= BEFORE_CELLS and is_cluttered(memory):
        if memory[CELL_ROOM] == 0:
            status, memory[LACKING] = FULL, LABELS
        elif search_cells(across[FREE], memory, start, goal, budget):
            cells = trace_cells(across[FREE], memory, start, goal)
            status = FOUND if memory[BEST] < memory[BOUND] else UNREACHABLE
        elif budget < memory[CELL_ROOM]:
            first = budget = 0  # Used up.
    if status == TIMEOUT and memory[WORK] <= first:
        status = run(across, along, diagonal_ends, memory, goal, first, endless)
    if status == TIMEOUT and budget > first:
        # Without a path a search visits all that it can reach; a flood mostly tells in less time
        # than the search has taken so far.
        ends = (goal >> 16, goal & 0xFFFF), (start >> 16, start & 0xFFFF)
        if are_separate(across[FREE], ends[0], ends[1], SWEEPS):
            status, memory[BOUND] = UNREACHABLE, FAR
        else:
            status = run(across, along, diagonal_ends, memory, goal, budget, endless)
    while memory[WAITING] > 0:
        pop(memory)
    if status != FOUND:
        return status, np.empty((0, 2), dtype=np.int64), 0
    if len(cells) == 0:
        cells = trace(across, memory, start, goal)
    return FOUND, cells, (memory[BEST] - (len(cells) - 1) * UNIT) // (ROOT - UNIT)


@lean
def is_cluttered(memory: Memory) -> bool:
    """Return whether walks have been short so far and many jump points wait."""
    total = 0
    for entry in range(memory[PUSHED]):
        at = memory[memory[QUEUE] + entry] & 0xFFFFFFFF
        cell, parent = memory[at + KEY] & 0xFFFFFFFF, memory[at + PARENT]
        rows, cols = (cell >> 16) - (parent >> 16), (cell & 0xFFFF) - (parent & 0xFFFF)
        total += max(abs(rows), abs(cols))
    return bool(total < SHORT * memory[PUSHED] and memory[WAITING] >= WIDE)


@inlined
def number_of(across: BitPlanes, memory: Memory, row: int, col: int) -> int:
    """Return the number of a cell (row, col) in a search, (row + PAD) << 16 | (col + PAD); 0 if it
    is blocked, -1 if outside."""
    if not (0 <= row < memory[ROWS] and 0 <= col < memory[COLS]):
        return -1
    return (row + PAD) << 16 | (col + PAD) if bit_of(across, FREE, row + PAD, col + PAD) else 0


@nested
def mark_goal(
    across: BitPlanes, along: BitPlanes, goal: int
) -> tuple[np.uint64, np.uint64, np.uint64, np.uint64]:
    """Make every straight walk stop at the goal; return the former words."""
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
    return saved


@nested
def unmark_goal(
    across: BitPlanes,
    along: BitPlanes,
    goal: int,
    saved: tuple[np.uint64, np.uint64, np.uint64, np.uint64],
) -> None:
    """Undo `mark_goal`."""
    row, col = goal >> 16, goal & 0xFFFF
    across[AHEAD, row, col >> 6], across[BACK, row, col >> 6] = saved[0], saved[1]
    along[AHEAD, col, row >> 6], along[BACK, col, row >> 6] = saved[2], saved[3]


@lean
def run(
    across: BitPlanes,
    along: BitPlanes,
    diagonal_ends: BitPlanes,
    memory: Memory,
    goal: int,
    budget: int,
    entries: np.int64,
) -> int:
    """Open bucket after bucket until none can contain a shorter path; `TIMEOUT` once the search has
    done more work than `budget`, or has had so many entries on its open list."""
    saved = mark_goal(across, along, goal)
    status = TIMEOUT
    while memory[WORK] <= budget and memory[PUSHED] < entries:
        if memory[WAITING] == 0:
            status = FOUND if memory[BEST] < memory[BOUND] else UNREACHABLE
            break
        at = pop(memory)
        if memory[BEST] <= memory[FLOOR] or memory[BUCKET] > (memory[BEST] - memory[LEAST]) >> (
            SHIFT - FINE
        ):
            status = FOUND if memory[BEST] < memory[BOUND] else UNREACHABLE
            break
        walks = memory[at + WALKS]
        todo = walks & ~(walks >> 8) & 0xFF
        if todo == 0:
            continue
        memory[at + WALKS] = walks | todo << 8
        memory[WORK] += open_cell(across, along, diagonal_ends, memory, at, todo)
        if memory[LACKING]:
            status = FULL
            break
    unmark_goal(across, along, goal, saved)
    return status


@inlined
def open_cell(
    across: BitPlanes,
    along: BitPlanes,
    diagonal_ends: BitPlanes,
    memory: Memory,
    at: int,
    todo: int,
) -> int:
    """Walk from a cell in the directions asked for; return the number of straight walks and
    diagonal steps."""
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
            count += walk_diagonal(
                across, along, diagonal_ends, memory, row, col, corner, cell, length
            )
    return count


@inlined
def stop_ahead(planes: BitPlanes, line: int, at: int) -> int:
    """Return the first cell behind `at` on a line where a walk towards higher cells stops."""
    word = np.uint64(at >> 6)
    bits = planes[AHEAD, np.uint64(line), word] & (
        np.uint64(0xFFFFFFFFFFFFFFFE) << np.uint64(at & 63)
    )
    while bits == 0:
        word += ONE
        bits = planes[AHEAD, np.uint64(line), word]
    return 64 * int(word) + int(lowest(bits))


@inlined
def stop_back(planes: BitPlanes, line: int, at: int) -> int:
    """Return the first cell before `at` on a line where a walk towards lower cells stops."""
    word = np.uint64(at >> 6)
    bits = planes[BACK, np.uint64(line), word] & ((ONE << np.uint64(at & 63)) - ONE)
    while bits == 0:
        word -= ONE
        bits = planes[BACK, np.uint64(line), word]
    return 64 * int(word) + int(highest(bits))


@inlined
def walk_row(
    across: BitPlanes,
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
    along: BitPlanes,
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
    across: BitPlanes,
    along: BitPlanes,
    diagonal_ends: BitPlanes,
    memory: Memory,
    row: int,
    col: int,
    corner: int,
    parent: int,
    length: int,
) -> int:
    """Walk diagonally until a corner or obstacle is met, with a straight walk to both sides from
    every cell.

    `corner` is 0 south-east, 1 south-west, 2 north-east, 3 north-west. Returns the number of steps.
    """
    west, north = corner & 1, corner >> 1
    step_row, step_col = 1 - 2 * north, 1 - 2 * west
    goal_row, goal_col = memory[GOAL_ROW], memory[GOAL_COL]
    count, on_foot = 0, ON_FOOT
    while bit_of(across, SQUARE, row - north, col - west) != 0:
        most = min(
            steps_until(row, goal_row, step_row), steps_until(col, goal_col, step_col), IN_ONE_GO
        )
        if on_foot:
            steps = slide(across, along, row, col, west, north, min(most, on_foot))
        else:
            steps = passable(across, along, diagonal_ends, row, col, west, north, most)
        row += steps * step_row
        col += steps * step_col
        length += steps * ROOT
        count += steps
        if length + octile(row - goal_row, col - goal_col) >= memory[BEST]:
            return count
        if row == goal_row and col == goal_col:
            claim(memory, row << 16 | col, parent, length)
            return count
        dead_row = row != goal_row and is_dead_end(across, DEAD_END_AHEAD + west, row, col)
        dead_col = col != goal_col and is_dead_end(along, DEAD_END_AHEAD + north, col, row)
        if not dead_row:
            walk_row(across, memory, row, col, west, parent, length)
        if not dead_col:
            walk_col(along, memory, row, col, north, parent, length)
        if dead_row and dead_col:
            if not on_foot:
                survey(
                    across, along, diagonal_ends, row, col, west, north, goal_row << 16 | goal_col
                )
            on_foot = 0 if on_foot else FARTHER
    return count


@inlined
def slide(
    across: BitPlanes, along: BitPlanes, row: int, col: int, west: int, north: int, most: int
) -> int:
    """Return the steps, at most `most`, to the next cell from which a straight walk may lead on, or
    at which the diagonal ends."""
    step_row, step_col = np.uint64(1 - 2 * north), np.uint64(1 - 2 * west)
    plane_row, plane_col = np.uint64(DEAD_END_AHEAD + west), np.uint64(DEAD_END_AHEAD + north)
    line, at, steps = np.uint64(row), np.uint64(col), 0
    up, left = np.uint64(north), np.uint64(west)
    low, shift = np.uint64(63), np.uint64(6)
    while (
        steps < most
        and across[np.uint64(SQUARE), line - up, (at - left) >> shift] >> ((at - left) & low) & ONE
    ):
        line += step_row
        at += step_col
        steps += 1
        dead_row = across[plane_row, line, at >> shift] >> (at & low)
        dead_col = along[plane_col, at, line >> shift] >> (line & low)
        if (dead_row & dead_col & ONE) == 0:
            break
    return steps


@inlined
def steps_until(at: int, goal: int, step: int) -> int:
    """Return the steps of a walk to the goal's row or column; more than any grid has if it never
    gets there."""
    steps = (goal - at) * step
    return steps if steps > 0 else 1 << 30


@inlined
def is_dead_end(planes: BitPlanes, plane: int, line: int, at: int) -> bool:
    """Return whether a straight walk ends at an obstacle; the line may not be surveyed yet."""
    asked = planes[DEAD_END_AHEAD, line, 0]
    if asked < REQUESTS_BEFORE_SCAN:
        planes[DEAD_END_AHEAD, line, 0] = asked + ONE
        if asked + ONE < REQUESTS_BEFORE_SCAN:
            return False
        find_dead_ends(planes, line)
    return bool(bit_of(planes, plane, line, at) != 0)


@nested
def trace(across: BitPlanes, memory: Memory, start: int, goal: int) -> npt.NDArray[np.int64]:
    """Return (N, 2) all cells from start to goal, with as few turns as the jump points allow."""
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
        at = expand_leg(cells, at, corners[leg + 1], straight_first[leg])
    return cells
