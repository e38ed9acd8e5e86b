"""The shortest path over a space that changes, searched for only when the present one may no longer
be the shortest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from navcore.compiled import compiled, lean, nested
from navcore.geometry.arrays import Indices
from navcore.grid.bitplane import ONE, PAD, BitPlane, BitPlanes
from navcore.grid.free_space import FREED_LOG, FreeSpace
from navcore.grid.grid import Cell
from navcore.grid.growth import Growth
from navcore.planning.path import REASONS, NoPath, Path, Reason
from navcore.planning.planner import SQRT2
from navcore.planning.search.jump_point_search import (
    ENDLESS,
    FOUND,
    FULL,
    TIMEOUT,
    UNREACHABLE,
    search,
)
from navcore.planning.search.open_list import (
    BOUND,
    FAR,
    ROOT,
    UNIT,
    Memory,
    SearchWorkspace,
    octile,
)
from navcore.planning.search.path_reconstruction import expand_leg, is_clear

NOWHERE: Indices = np.empty((0, 2), dtype=np.int64)
NO_LENGTHS: Indices = np.empty(0, dtype=np.int64)
DETOUR = 12 * UNIT
"""Length by which a change mostly lengthens the path at most; a search that may assume so does not
search far to the sides."""
ELSEWHERE, LONGER = -1, -2
"""Results of `still_shortest`: the robot has left the path, or a shorter one may exist; and: the
path is blocked, and none is shorter than it was."""


@dataclass(slots=True, eq=False)
class PresentPath:
    """The present path."""

    path: Path
    """The path from the robot's cell on, as it was returned last."""
    cells: Indices
    """(N, 2) all cells of the path."""
    left: Indices
    """(N,) length from each cell to the goal, in units of `search.open_list`."""
    at: int
    """Index of the cell that the robot was in last."""
    goal: Cell
    """Goal of the path (row, col)."""


class Replanner:
    """Plans over one `FreeSpace`; its paths are always as long as those of `planner.plan`.

    The present path stays the shortest from every later cell of it as long as nothing on it is
    blocked and every cell that was freed is so far off that a path through it is no shorter. It is
    then kept without a search, and so never replaced by another of the same length. There is one
    replanner to a space: it consumes the notes that the space keeps of its changes.

    A frame costs one compiled call, and a second one if a search is needed.
    """

    def __init__(self, space: FreeSpace) -> None:
        self._space = space
        self._workspace = SearchWorkspace(space)
        self._present: PresentPath | None = None
        self._failure: tuple[Cell, Cell] | None = None
        self.searches = 0
        """Number of searches that were made."""

    def search_again(self) -> None:
        """Have the next plan search: a path through cells that were outside may be shorter. One of
        the same length is not exchanged."""
        self._space.notes[0] = FREED_LOG + 1

    def grow(self, space: FreeSpace, growth: Growth) -> None:
        """Continue on the space of a larger grid; the present path stays in its place."""
        self._space, self._workspace = space, SearchWorkspace(space, self._workspace.cells)
        self._failure, present, shift = None, self._present, growth.shift
        if present is not None:
            present.path = replace(present.path, cells=present.path.cells + shift)
            present.cells = present.cells + shift
            present.goal = present.goal[0] + growth.rows, present.goal[1] + growth.cols

    def plan(self, start: Cell, goal: Cell, *, max_expansions: int | None = None) -> Path | NoPath:
        """Find the shortest path from start to goal, (row, col) both; see `planner.plan`."""
        floor = 0
        present, space = self._present, self._space
        if present is not None and present.goal == goal:
            at, floor = still_shortest(
                present.cells,
                present.left,
                present.at,
                start[0],
                start[1],
                space.freed,
                space.notes,
            )
            if at >= 0:
                if at != present.at:
                    present.at, present.path = at, _path(present.cells[at:], floor)
                return present.path
        elif (
            self._failure == (start, goal)
            and space.notes[0] == 0
            and space.is_free(start)
            and space.is_free(goal)
        ):
            return NoPath(reason=Reason.UNREACHABLE)
        self.searches += 1
        return self._searched(
            start, goal, ENDLESS if max_expansions is None else max_expansions, floor
        )

    def _searched(self, start: Cell, goal: Cell, budget: int, floor: int) -> Path | NoPath:
        space, present, memory = self._space, self._present, self._workspace.memory
        cells, left, at = NOWHERE, NO_LENGTHS, ELSEWHERE
        if present is not None:
            cells, left, at = (
                present.cells,
                present.left,
                present.at if present.goal == goal else ELSEWHERE,
            )
        status, fresh, lengths = searched(
            space.across,
            space.along,
            space.diagonal_ends,
            space.sentinel,
            space.notes,
            memory,
            cells,
            left,
            at,
            start[0],
            start[1],
            goal[0],
            goal[1],
            budget,
            floor,
        )
        if status == FULL:
            self._workspace.grow()
            return self._searched(start, goal, budget, floor)
        if status == TIMEOUT:
            return NoPath(reason=Reason.TIMEOUT)
        self._present, self._failure = None, (start, goal) if status == UNREACHABLE else None
        if status != FOUND:
            return NoPath(reason=REASONS[status])
        path = _path(fresh, int(lengths[0]))
        self._present = PresentPath(path=path, cells=fresh, left=lengths, at=0, goal=goal)
        return path


def _path(cells: Indices, left: int) -> Path:
    steps = len(cells) - 1
    diagonal = (left - steps * UNIT) // (ROOT - UNIT)
    return Path(cells=cells, length=steps - diagonal + diagonal * SQRT2)


@compiled
def still_shortest(
    cells: Indices,
    left: Indices,
    at: int,
    start_row: int,
    start_col: int,
    freed: Indices,
    notes: Indices,
) -> tuple[int, int]:
    """Return the index on the path of the robot's cell, not before `at`, and the length left from
    there; the notes are then cleared.

    The index is `LONGER` if a cell of the path was blocked; a path is then at least as long as what
    was left of it. It is `ELSEWHERE`, and the length 0, if the robot is not on the path or a path
    may be shorter.

    A path that uses a freed cell f, or squeezes diagonally past it, is at least octile(start, f) +
    octile(f, goal) - (2 - √2) long: the squeeze leads through f's neighbours, one straight step
    each, with one diagonal step in place of those two.
    """
    if notes[0] > len(freed):
        return ELSEWHERE, 0
    while at < len(cells) and (cells[at, 0] != start_row or cells[at, 1] != start_col):
        at += 1
    if at == len(cells):
        return ELSEWHERE, 0
    goal_row, goal_col = cells[-1, 0], cells[-1, 1]
    for index in range(notes[0]):
        row, col = freed[index] >> 32, freed[index] & 0xFFFFFFFF
        bound = (
            octile(row - start_row, col - start_col)
            + octile(row - goal_row, col - goal_col)
            - (2 * UNIT - ROOT)
        )
        if bound < left[at]:
            return ELSEWHERE, 0
    if notes[1] > 0:
        return LONGER, left[at]
    notes[0] = 0
    return at, left[at]


@compiled
def searched(
    across: BitPlanes,
    along: BitPlanes,
    diagonal_ends: BitPlanes,
    sentinel: BitPlane,
    notes: Indices,
    memory: Memory,
    cells: Indices,
    left: Indices,
    at: int,
    start_row: int,
    start_col: int,
    goal_row: int,
    goal_col: int,
    budget: int,
    floor: int,
) -> tuple[int, Indices, Indices]:
    """Search for a path to replace the present one, none of which is shorter than `floor`: return
    the search's status, the (N, 2) cells, and the (N,) length left from each. The sentinel is moved
    to the path and the notes are cleared, if the search came to an end.

    `at` is the robot's index on the present path, `ELSEWHERE` if that one leads to another goal.
    """
    # Mostly a little of the present path has been found blocked.
    guess = FAR if at < 0 else left[at] + DETOUR
    ends = start_row, start_col, goal_row, goal_col
    status, fresh, diagonal = search(
        across, along, diagonal_ends, memory, *ends, budget, guess, floor
    )
    if status == UNREACHABLE and memory[BOUND] < FAR:
        status, fresh, diagonal = search(
            across, along, diagonal_ends, memory, *ends, budget, FAR, floor
        )
    if status in (FULL, TIMEOUT):
        return status, fresh, left
    if status == FOUND and at >= 0 and notes[1] == 0:
        length = (len(fresh) - 1 - diagonal) * UNIT + diagonal * ROOT
        back = rejoined(across, fresh, length, cells[at:], left[at:])
        fresh = back if len(back) else fresh
    common = common_cells(cells, fresh)
    move_sentinel(sentinel, cells, fresh, common)
    notes[:] = 0
    lengths = np.empty(len(fresh), dtype=np.int64)
    lengths[len(fresh) - common :] = left[len(cells) - common :]
    measure(fresh, lengths, len(fresh) - common)
    return status, fresh, lengths


@nested
def measure(cells: Indices, left: Indices, first: int) -> None:
    """Fill in the length from each of the first of (N, 2) cells to the goal; that of the others is
    known."""
    for index in range(first - 1, -1, -1):
        if index == len(cells) - 1:
            left[index] = 0
            continue
        is_diagonal = (
            cells[index, 0] != cells[index + 1, 0] and cells[index, 1] != cells[index + 1, 1]
        )
        left[index] = left[index + 1] + (ROOT if is_diagonal else UNIT)


@nested
def common_cells(old: Indices, new: Indices) -> int:
    """Return the number of cells that two paths have in common at their ends."""
    before, after = len(old), len(new)
    while (
        before > 0
        and after > 0
        and old[before - 1, 0] == new[after - 1, 0]
        and old[before - 1, 1] == new[after - 1, 1]
    ):
        before, after = before - 1, after - 1
    return len(new) - after


@nested
def move_sentinel(sentinel: BitPlane, old: Indices, new: Indices, common: int) -> None:
    """Move the sentinel from one path to another; it stays on the `common` last cells of both."""
    # The first common cell is reached by another step. No two other steps of a shortest path share
    # a cell beside them.
    mark(sentinel, old, len(old) - common + 1, False)
    mark(sentinel, new, len(new) - common + 1, True)


@lean
def mark(sentinel: BitPlane, cells: Indices, until: int, on: bool) -> None:
    """Set or clear the sentinel at all cells that must stay free for the first cells: these and
    those beside their diagonal steps."""
    for index in range(min(until, len(cells))):
        before = max(index - 1, 0)
        for row, col in (
            (cells[index, 0], cells[index, 1]),
            (cells[before, 0], cells[index, 1]),
            (cells[index, 0], cells[before, 1]),
        ):
            bit = ONE << np.uint64(col & 63)
            if on:
                sentinel[row + PAD, (col + PAD) >> 6] |= bit
            else:
                sentinel[row + PAD, (col + PAD) >> 6] &= ~bit


@nested
def rejoined(
    across: BitPlanes, fresh: Indices, length: int, cells: Indices, left: Indices
) -> Indices:
    """Return the path of that length that leads from `fresh`'s first cell to an early cell of
    `cells` and follows them; else (0, 2)."""
    row, col = fresh[0, 0] + PAD, fresh[0, 1] + PAD
    for index in range(len(cells)):
        to_row, to_col = cells[index, 0] + PAD, cells[index, 1] + PAD
        if octile(to_row - row, to_col - col) + left[index] != length:
            continue
        here, there = row << 16 | col, to_row << 16 | to_col
        # A leg that starts straight backwards is one that starts diagonally forwards.
        diagonal_first = is_clear(across, there, here)
        if diagonal_first or is_clear(across, here, there):
            steps = max(abs(to_row - row), abs(to_col - col))
            path = np.empty((steps + len(cells) - index, 2), dtype=np.int64)
            path[0] = fresh[0]
            expand_leg(path, 0, there, not diagonal_first)
            path[steps:] = cells[index:]
            return path
    return np.empty((0, 2), dtype=np.int64)
