"""The cheapest path on the grid where floor that was not seen yet costs more than seen floor.

A step costs its length times the mean price of its two cells, 1 for a cell that was seen and
`price` for another. The search is A*, which is exact: what remains costs at least the octile
distance, and outside of the box around all seen cells `price` times that. A price of 1 gives the
shortest path, which `navcore.planning.planner` finds in a fraction of the time. It needs 9 bytes
for each cell of the grid.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, nested
from navcore.geometry.arrays import Indices
from navcore.grid.grid import BoolGrid, Cell
from navcore.planning.path import REASONS, NoPath, Path
from navcore.planning.planner import SQRT2
from navcore.planning.search.jump_point_search import (
    ENDLESS,
    FOUND,
    GOAL_BLOCKED,
    OUTSIDE,
    START_BLOCKED,
    TIMEOUT,
    UNREACHABLE,
)

QUANTUM = 2.0**-26
"""Step in cells to which the cost that a cell promises is rounded: of paths that are equal but for
the rounding of sums none is searched before another."""
SAME = 1e-6
"""Difference of cost, in cells, below which two paths cost the same."""
NO_PARENT = 8
"""Direction of a cell that no step led to."""


class WeightedPlanner:
    """Keeps its path as long as no other is cheaper, so that it does not change between paths of
    the same cost."""

    def __init__(self) -> None:
        self._present: Path | None = None

    def plan(
        self,
        free: BoolGrid,
        unseen: BoolGrid,
        price: float,
        start: Cell,
        goal: Cell,
        *,
        max_expansions: int | None = None,
    ) -> Path | NoPath:
        """Find the cheapest path; see `plan_weighted`."""
        found = plan_weighted(free, unseen, price, start, goal, max_expansions=max_expansions)
        if isinstance(found, NoPath):
            self._present = None
            return found
        cheapest = path_cost(found.cells, free, unseen, price)
        before = None if self._present is None else _rest(self._present.cells, start, goal)
        if before is not None and path_cost(before, free, unseen, price) <= cheapest + SAME:
            found = Path(cells=before, length=_length(before))
        self._present = found
        return found


def plan_weighted(
    free: BoolGrid,
    unseen: BoolGrid,
    price: float,
    start: Cell,
    goal: Cell,
    *,
    max_expansions: int | None = None,
) -> Path | NoPath:
    """Find the cheapest 8-connected path from start to goal, (row, col) both, that cuts no corners.

    `free` and `unseen` are bool (rows, cols): where the robot's centre may be, and what was not
    seen yet. `price` ≥ 1 is the cost of a metre of unseen floor in metres of seen floor. The result
    is exactly optimal; its `length` is that of its steps, without the price. `max_expansions`
    bounds the number of cells that are expanded (`Reason.TIMEOUT`).
    """
    if price < 1:
        raise ValueError(f"price of unseen floor: expected at least 1, got {price:g}")
    rows, cols = free.shape
    if not all(0 <= row < rows and 0 <= col < cols for row, col in (start, goal)):
        return NoPath(reason=REASONS[OUTSIDE])
    if not free[start]:
        return NoPath(reason=REASONS[START_BLOCKED])
    if not free[goal]:
        return NoPath(reason=REASONS[GOAL_BLOCKED])
    budget = ENDLESS if max_expansions is None else max_expansions
    status, cells = cheapest_cells(free, unseen, price, *start, *goal, budget)
    if status != FOUND:
        return NoPath(reason=REASONS[status])
    return Path(cells=cells, length=_length(cells))


def path_cost(cells: Indices, free: BoolGrid, unseen: BoolGrid, price: float) -> float:
    """Return the cost of a path of (N, 2) neighbouring cells, in cells of seen floor; infinite if
    it is not free or cuts a corner."""
    if len(cells) == 0 or not free[cells[:, 0], cells[:, 1]].all():
        return math.inf
    before, after = cells[:-1], cells[1:]
    if not (free[before[:, 0], after[:, 1]] & free[after[:, 0], before[:, 1]]).all():
        return math.inf
    prices = np.where(unseen[cells[:, 0], cells[:, 1]], price, 1.0)
    steps = np.hypot(*np.diff(cells, axis=0).T)
    return float((steps * (prices[:-1] + prices[1:]) / 2).sum())


def _rest(cells: Indices, start: Cell, goal: Cell) -> Indices | None:
    """Return the part of a path from a cell of it to its end, if that is the goal."""
    at = np.flatnonzero((cells == start).all(axis=1))
    return cells[int(at[0]) :] if len(at) and tuple(cells[-1]) == goal else None


def _length(cells: Indices) -> float:
    steps = np.abs(np.diff(cells, axis=0))
    diagonal = int((steps.sum(axis=1) == 2).sum())
    return len(steps) - diagonal + diagonal * SQRT2


@compiled
def cheapest_cells(
    free: BoolGrid,
    unseen: BoolGrid,
    price: float,
    start_row: int,
    start_col: int,
    goal_row: int,
    goal_col: int,
    budget: int,
) -> tuple[int, Indices]:
    """Return the search's status and the (N, 2) cells of the cheapest path between two free
    cells."""
    rows, cols = free.shape
    costs = np.full((rows, cols), np.inf)
    parents = np.full((rows, cols), np.uint8(NO_PARENT))
    costs[start_row, start_col] = 0.0
    seen = seen_box(free, unseen)
    goal_away = away_from(seen, goal_row, goal_col)
    # Of cells that promise the same the one that is nearest to the goal comes first.
    waiting = [(0.0, 0.0, start_row * cols + start_col)]
    expanded = 0
    while waiting:
        _, owed, cell = heapq.heappop(waiting)
        cost = -owed
        row, col = cell // cols, cell % cols
        if cost > costs[row, col]:
            continue
        if row == goal_row and col == goal_col:
            return FOUND, traced(parents, row, col)
        expanded += 1
        if expanded > budget:
            return TIMEOUT, np.empty((0, 2), dtype=np.int64)
        for direction in range(8):
            down, right = STEPS[direction, 0], STEPS[direction, 1]
            to_row, to_col = row + down, col + right
            if not (0 <= to_row < rows and 0 <= to_col < cols) or not (
                free[to_row, to_col] and free[row, to_col] and free[to_row, col]
            ):
                continue
            here = price if unseen[row, col] else 1.0
            there = price if unseen[to_row, to_col] else 1.0
            more = cost + (SQRT2 if down * right != 0 else 1.0) * (here + there) / 2
            if more < costs[to_row, to_col]:
                costs[to_row, to_col], parents[to_row, to_col] = more, direction
                away = octile(to_row - goal_row, to_col - goal_col)
                outside = away_from(seen, to_row, to_col) + goal_away
                least = min(price * away, (price - 1.0) * outside + max(outside, away))
                promised = round((more + least) / QUANTUM) * QUANTUM
                heapq.heappush(waiting, (promised, -more, to_row * cols + to_col))
    return UNREACHABLE, np.empty((0, 2), dtype=np.int64)


STEPS: Indices = np.array([(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)])
"""(8, 2) rows and columns of the steps to the neighbours, the straight ones first."""


@nested
def seen_box(free: BoolGrid, unseen: BoolGrid) -> tuple[int, int, int, int]:
    """Return first and last row and column of the free cells that were seen; the first row is
    beyond the last where there are none."""
    rows, cols = free.shape
    top, bottom, left, right = rows, -1, cols, -1
    for row in range(rows):
        for col in range(cols):
            if free[row, col] and not unseen[row, col]:
                top, bottom = min(top, row), max(bottom, row)
                left, right = min(left, col), max(right, col)
    return top, bottom, left, right


@nested
def away_from(box: tuple[int, int, int, int], row: int, col: int) -> float:
    """Return how much of a path from a cell to the box costs the price of unseen floor, in cells:
    its length but for half a diagonal step, which may end on seen floor."""
    top, bottom, left, right = box
    if top > bottom:
        return np.inf
    down, aside = max(top - row, row - bottom, 0), max(left - col, col - right, 0)
    return max(octile(down, aside) - SQRT2 / 2, 0.0)


@nested
def octile(down: int, right: int) -> float:
    """Return the length of the shortest path over so many rows and columns of an empty grid."""
    high, low = max(abs(down), abs(right)), min(abs(down), abs(right))
    return high - low + low * SQRT2


@nested
def traced(parents: npt.NDArray[np.uint8], row: int, col: int) -> Indices:
    """Return the (N, 2) cells from the start to a cell, by the directions of (rows, cols)
    `parents`."""
    count, at_row, at_col = 1, row, col
    while parents[at_row, at_col] != NO_PARENT:
        direction = parents[at_row, at_col]
        at_row, at_col = at_row - STEPS[direction, 0], at_col - STEPS[direction, 1]
        count += 1
    cells = np.empty((count, 2), dtype=np.int64)
    for index in range(count - 1, -1, -1):
        cells[index, 0], cells[index, 1] = row, col
        if index > 0:
            direction = parents[row, col]
            row, col = row - STEPS[direction, 0], col - STEPS[direction, 1]
    return cells
