"""Unseen floor costs its price: the path is the cheapest one, by an independent solver."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import lil_matrix
from scipy.sparse.csgraph import dijkstra

from navcore.grid.grid import BoolGrid, Cell
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import SQRT2, plan
from navcore.planning.weighted_planner import WeightedPlanner, path_cost, plan_weighted
from tests.navcore.laws import law
from tests.navcore.planning.test_planner import assert_is_a_path, problems


def cheapest(blocked: BoolGrid, unseen: BoolGrid, price: float, start: Cell, goal: Cell) -> float:
    """Cost of the cheapest path by SciPy's Dijkstra; infinite without one."""
    rows, cols = blocked.shape
    graph = lil_matrix((rows * cols, rows * cols))
    prices = np.where(unseen, price, 1.0)
    for row, col in np.argwhere(~blocked).tolist():
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                to = row + down, col + right
                if (down, right) == (0, 0) or not (0 <= to[0] < rows and 0 <= to[1] < cols):
                    continue
                if not (blocked[to] or blocked[row, to[1]] or blocked[to[0], col]):
                    length = SQRT2 if down and right else 1.0
                    graph[row * cols + col, to[0] * cols + to[1]] = (
                        length * (prices[row, col] + prices[to]) / 2
                    )
    found = dijkstra(graph.tocsr(), indices=start[0] * cols + start[1])
    return float(found[goal[0] * cols + goal[1]])


@law(100)
@given(problems(), st.integers(0, 2**32 - 1), st.sampled_from([1.0, 1.5, 4.0, 20.0]))
def test_a_weighted_path_costs_what_an_independent_exact_solver_says(
    problem: tuple[BoolGrid, Cell, Cell], seed: int, price: float
) -> None:
    blocked, start, goal = problem
    unseen = np.random.default_rng(seed).random(blocked.shape) < 0.4
    best = cheapest(blocked, unseen, price, start, goal)
    found = plan_weighted(~blocked, unseen, price, start, goal)
    if isinstance(found, NoPath):
        assert found.reason is Reason.UNREACHABLE and best == np.inf
        return
    assert_is_a_path(found, blocked, start, goal)
    assert path_cost(found.cells, ~blocked, unseen, price) == pytest.approx(best, abs=1e-9)


@law(100)
@given(problems(), st.integers(0, 2**32 - 1))
def test_a_price_of_one_gives_the_length_of_the_shortest_path(
    problem: tuple[BoolGrid, Cell, Cell], seed: int
) -> None:
    blocked, start, goal = problem
    unseen = np.random.default_rng(seed).random(blocked.shape) < 0.5
    weighted, shortest = (
        plan_weighted(~blocked, unseen, 1.0, start, goal),
        plan(blocked, start, goal),
    )
    if isinstance(shortest, NoPath):
        assert weighted == shortest
    else:
        assert isinstance(weighted, Path)
        assert weighted.length == pytest.approx(shortest.length, abs=1e-9)


def test_a_seen_detour_is_taken_only_when_the_price_makes_it_cheaper() -> None:
    free = np.ones((21, 41), dtype=np.bool_)
    unseen = np.zeros_like(free)
    unseen[5:, 15:25] = True
    start, goal = (10, 5), (10, 35)
    for price, through in ((1.0, True), (1.2, True), (3.0, False)):
        found = plan_weighted(free, unseen, price, start, goal)
        assert isinstance(found, Path)
        assert unseen[found.cells[:, 0], found.cells[:, 1]].any() == through


def test_the_path_is_kept_while_no_other_is_cheaper() -> None:
    free, unseen = np.ones((9, 30), dtype=np.bool_), np.zeros((9, 30), dtype=np.bool_)
    planner, goal = WeightedPlanner(), (8, 29)
    first = planner.plan(free, unseen, 2.0, (0, 0), goal)
    assert isinstance(first, Path)
    for at in range(1, 10):
        row, col = first.cells[at].tolist()
        after = planner.plan(free, unseen, 2.0, (row, col), goal)
        assert isinstance(after, Path) and (after.cells == first.cells[at:]).all()
    row, col = first.cells[15].tolist()
    free[row, col] = False
    other = planner.plan(free, unseen, 2.0, (0, 0), goal)
    assert isinstance(other, Path) and path_cost(other.cells, free, unseen, 2.0) < np.inf


@pytest.mark.parametrize("price", [1.5, 5.0])
@pytest.mark.parametrize("goal", [(300, 1100), (900, 950), (600, 1190)])
def test_on_a_large_map_few_cells_are_searched_beside_the_path(price: float, goal: Cell) -> None:
    free, unseen = np.ones((1200, 1200), dtype=np.bool_), np.ones((1200, 1200), dtype=np.bool_)
    unseen[550:650, 550:650] = False
    found = plan_weighted(free, unseen, price, (600, 600), goal, max_expansions=20_000)
    assert isinstance(found, Path)


def test_ends_that_are_blocked_or_outside_and_a_spent_budget_are_named() -> None:
    free, unseen = np.ones((5, 5), dtype=np.bool_), np.zeros((5, 5), dtype=np.bool_)
    free[0, 0] = False

    def reason(start: Cell, goal: Cell, most: int | None = None) -> Reason:
        found = plan_weighted(free, unseen, 2.0, start, goal, max_expansions=most)
        assert isinstance(found, NoPath)
        return found.reason

    assert reason((0, 0), (4, 4)) is Reason.START_BLOCKED
    assert reason((4, 4), (0, 0)) is Reason.GOAL_BLOCKED
    assert reason((4, 4), (5, 0)) is Reason.OUTSIDE
    assert reason((4, 4), (1, 0), 1) is Reason.TIMEOUT
    with pytest.raises(ValueError, match="at least 1"):
        plan_weighted(free, unseen, 0.5, (4, 4), (1, 1))
