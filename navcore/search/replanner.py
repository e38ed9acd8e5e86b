"""The shortest path over a space that changes, searched for only when the one at hand may no longer be the shortest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.grid import Cell
from navcore.path import SQRT2, NoPath, Path, Reason, plan_in
from navcore.search.bits import ONE, PAD, Plane, compiled, lean
from navcore.search.free_space import FreeSpace, Planes
from navcore.search.legs import is_clear, lay
from navcore.search.memory import FAR, ROOT, UNIT, Arena, octile

Ints = npt.NDArray[np.int64]

NOWHERE: Ints = np.empty((0, 2), dtype=np.int64)
DETOUR = 12 * UNIT
"""A change mostly makes the path no longer than this; a search that may assume so does not look far aside."""


@dataclass(slots=True, eq=False)
class Standing:
    """The path at hand."""

    path: Path
    """As it was given out last, from the robot's cell on."""
    cells: Ints
    """(N, 2) all of it."""
    left: Ints
    """(N,) length from each cell to the goal, in units of `navcore.search.memory`."""
    at: int
    """Where on it the robot was last."""
    goal: Cell
    """Where it leads."""


class Replanner:
    """Plans over one `FreeSpace`. What it returns is always as long as what `navcore.path.plan` would return.

    The path at hand stays the shortest from every later cell of it as long as nothing on it is blocked and every cell that
    was freed is so far off that a path by way of it is no shorter. It is then kept without a search, and so never gives way to
    another of the same length. One replanner a space: it consumes the notes that the space keeps of its changes.
    """

    def __init__(self, space: FreeSpace) -> None:
        self._space = space
        self._arena = Arena(space)
        self._standing: Standing | None = None
        self._failure: tuple[Cell, Cell] | None = None
        self.searches = 0
        """How many searches were made."""

    def plan(self, start: Cell, goal: Cell, *, max_expansions: int | None = None) -> Path | NoPath:
        """The shortest path from start to goal, (row, col) both; see `navcore.path.plan`."""
        kept = self._kept(start, goal)
        if kept is not None:
            return kept
        if self._still_unreachable(start, goal):
            return NoPath(reason=Reason.UNREACHABLE)
        self.searches += 1
        outcome = plan_in(self._space, self._arena, start, goal, max_expansions=max_expansions, guess=self._guess(goal))
        if isinstance(outcome, NoPath) and outcome.reason is Reason.TIMEOUT:
            return outcome
        outcome = self._joined(outcome, goal)
        self._stand(outcome, start, goal)
        return outcome

    def _kept(self, start: Cell, goal: Cell) -> Path | None:
        standing, space = self._standing, self._space
        if standing is None or standing.goal != goal:
            return None
        at = still_shortest(standing.cells, standing.left, standing.at, start, space.freed, space.notes)
        if at < 0:
            return None
        space.notes[:] = 0
        if at != standing.at:
            standing.at, standing.path = at, _path(standing.cells[at:], int(standing.left[at]))
        return standing.path

    def _guess(self, goal: Cell) -> int:
        """A length that the new path is probably shorter than: mostly a little of the old one's has been found blocked."""
        standing = self._standing
        return FAR if standing is None or standing.goal != goal else int(standing.left[standing.at]) + DETOUR

    def _still_unreachable(self, start: Cell, goal: Cell) -> bool:
        space = self._space
        return self._failure == (start, goal) and space.notes[0] == 0 and space.is_free(start) and space.is_free(goal)

    def _joined(self, outcome: Path | NoPath, goal: Cell) -> Path | NoPath:
        """A path of the same length that soon joins the one at hand, if there is one: the way should not flip to and fro."""
        standing, space = self._standing, self._space
        if standing is None or standing.goal != goal or isinstance(outcome, NoPath) or space.notes[1] > 0:
            return outcome
        cells = joined(space.across, outcome.cells, standing.cells[standing.at :], standing.left[standing.at :])
        return outcome if len(cells) == 0 else Path(cells=cells, length=outcome.length)

    def _stand(self, outcome: Path | NoPath, start: Cell, goal: Cell) -> None:
        space, old = self._space, NOWHERE if self._standing is None else self._standing.cells
        new = outcome.cells if isinstance(outcome, Path) else NOWHERE
        restring(space.tripwire, old, new)
        space.notes[:] = 0
        self._standing, self._failure = None, None
        if isinstance(outcome, Path):
            self._standing = Standing(path=outcome, cells=new, left=lengths_left(new), at=0, goal=goal)
        elif outcome.reason is Reason.UNREACHABLE:
            self._failure = (start, goal)


def _path(cells: Ints, left: int) -> Path:
    steps = len(cells) - 1
    diagonal = (left - steps * UNIT) // (ROOT - UNIT)
    return Path(cells=cells, length=steps - diagonal + diagonal * SQRT2)


@compiled
def still_shortest(cells: Ints, left: Ints, at: int, start: tuple[int, int], freed: Ints, notes: Ints) -> int:
    """Where on the path the robot is, not before `at`; -1 if it is elsewhere or the path may not be the shortest from there.

    A path that uses a freed cell f, or squeezes diagonally past it, is at least octile(start, f) + octile(f, goal) - (2 - √2)
    long: the squeeze goes by way of f's neighbours, one straight step each, with one diagonal step in place of those two.
    """
    if notes[1] > 0 or notes[0] > len(freed):
        return -1
    while at < len(cells) and (cells[at, 0] != start[0] or cells[at, 1] != start[1]):
        at += 1
    if at == len(cells):
        return -1
    goal_row, goal_col = cells[-1, 0], cells[-1, 1]
    for index in range(notes[0]):
        row, col = freed[index] >> 32, freed[index] & 0xFFFFFFFF
        bound = octile(row - start[0], col - start[1]) + octile(row - goal_row, col - goal_col) - (2 * UNIT - ROOT)
        if bound < left[at]:
            return -1
    return at


@compiled
def lengths_left(cells: Ints) -> Ints:
    """(N,) length from each of (N, 2) cells to the last."""
    left = np.zeros(len(cells), dtype=np.int64)
    for index in range(len(cells) - 2, -1, -1):
        sloping = cells[index, 0] != cells[index + 1, 0] and cells[index, 1] != cells[index + 1, 1]
        left[index] = left[index + 1] + (ROOT if sloping else UNIT)
    return left


@compiled
def restring(tripwire: Plane, old: Ints, new: Ints) -> None:
    """Move the wire from one path to another; where both end alike, it stays."""
    before, after = len(old), len(new)
    while before > 0 and after > 0 and old[before - 1, 0] == new[after - 1, 0] and old[before - 1, 1] == new[after - 1, 1]:
        before, after = before - 1, after - 1
    # The first cell of what is alike is come to in another way. No two other steps of a shortest path share a cell beside them.
    string(tripwire, old, before + 1, False)
    string(tripwire, new, after + 1, True)


@lean
def string(tripwire: Plane, cells: Ints, until: int, on: bool) -> None:
    """Set or clear the wire at all that has to stay free for the first cells: these and what is beside their diagonal steps."""
    for index in range(min(until, len(cells))):
        before = max(index - 1, 0)
        for row, col in (
            (cells[index, 0], cells[index, 1]),
            (cells[before, 0], cells[index, 1]),
            (cells[index, 0], cells[before, 1]),
        ):
            bit = ONE << np.uint64(col & 63)
            if on:
                tripwire[row + PAD, (col + PAD) >> 6] |= bit
            else:
                tripwire[row + PAD, (col + PAD) >> 6] &= ~bit


@compiled
def joined(across: Planes, fresh: Ints, cells: Ints, left: Ints) -> Ints:
    """The path that leaves `fresh`'s first cell for an early cell of `cells` and follows them; (0, 2) if it is not as short."""
    row, col = fresh[0, 0] + PAD, fresh[0, 1] + PAD
    length = lengths_left(fresh)[0]
    for index in range(len(cells)):
        to_row, to_col = cells[index, 0] + PAD, cells[index, 1] + PAD
        if octile(to_row - row, to_col - col) + left[index] != length:
            continue
        here, there = row << 16 | col, to_row << 16 | to_col
        # A way back that starts straight is a way there that starts diagonally.
        diagonal_first = is_clear(across, there, here)
        if diagonal_first or is_clear(across, here, there):
            steps = max(abs(to_row - row), abs(to_col - col))
            path = np.empty((steps + len(cells) - index, 2), dtype=np.int64)
            path[0] = fresh[0]
            lay(path, 0, there, not diagonal_first)
            path[steps:] = cells[index:]
            return path
    return np.empty((0, 2), dtype=np.int64)
