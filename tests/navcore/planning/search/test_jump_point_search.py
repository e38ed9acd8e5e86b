"""The search itself: against an independent solver, over words' borders, in used memory."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.bench.planning.plain_astar import length_by_astar
from navcore.grid.free_space import DEAD_END_AHEAD, FreeSpace
from navcore.grid.grid import BoolGrid
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan, plan_in
from navcore.planning.replanner import Replanner
from navcore.planning.search.jump_point_search import (
    BEFORE_FLOOD,
    FOUND,
    UNREACHABLE,
    find,
    search,
)
from navcore.planning.search.open_list import FAR, ROOT, UNIT, SearchWorkspace
from tests.navcore.grid.random_grids import free_cell, grids
from tests.navcore.laws import law
from tests.navcore.planning.test_planner import assert_is_a_path, optimum

SEEDS = st.integers(0, 2**32 - 1)


@law(150)
@given(grids(), SEEDS)
def test_queries_in_used_memory_are_as_long_as_an_independent_exact_solver_says(
    blocked: BoolGrid, seed: int
) -> None:
    generator, space = np.random.default_rng(seed), FreeSpace.of(blocked)
    workspace = SearchWorkspace(space, cells=1 << int(generator.integers(1, 8)))
    before = space.across.copy(), space.along.copy()
    for _ in range(3):
        start, goal = (free_cell(generator, blocked) for _ in range(2))
        if start is None or goal is None:
            return
        outcome, best = plan_in(space, workspace, start, goal), optimum(blocked, start, goal)
        if isinstance(outcome, Path):
            assert outcome.length == pytest.approx(best, rel=1e-12)
            assert_is_a_path(outcome, blocked, start, goal)
        else:
            assert outcome.reason is Reason.UNREACHABLE
            assert best == np.inf
    for planes, old in zip((space.across, space.along), before, strict=True):
        np.testing.assert_array_equal(
            planes[:DEAD_END_AHEAD], old[:DEAD_END_AHEAD], "a search leaves the space as it was"
        )


@law(60)
@given(grids(), SEEDS)
def test_a_path_does_not_depend_on_what_was_searched_before(blocked: BoolGrid, seed: int) -> None:
    generator, space = np.random.default_rng(seed), FreeSpace.of(blocked)
    workspace = SearchWorkspace(space, cells=2)
    start, goal = (free_cell(generator, blocked) for _ in range(2))
    if start is None or goal is None:
        return
    first = find(space, workspace, start, goal, 1 << 40)
    find(space, workspace, goal, start, 1 << 40)
    again, fresh = find(space, workspace, start, goal, 1 << 40), plan(blocked, start, goal)
    np.testing.assert_array_equal(first[1], again[1])
    assert isinstance(fresh, Path) == (first[0] == FOUND)
    if isinstance(fresh, Path):
        np.testing.assert_array_equal(first[1], fresh.cells)


@law(60)
@given(grids(), SEEDS, st.integers(0, 200))
def test_a_budget_ends_a_search_or_leaves_its_result_alone(
    blocked: BoolGrid, seed: int, budget: int
) -> None:
    generator, space = np.random.default_rng(seed), FreeSpace.of(blocked)
    start, goal = (free_cell(generator, blocked) for _ in range(2))
    if start is None or goal is None:
        return
    free, bounded = (
        plan_in(space, SearchWorkspace(space), start, goal, max_expansions=most)
        for most in (None, budget)
    )
    if isinstance(bounded, NoPath):
        assert bounded == free or bounded.reason is Reason.TIMEOUT
    else:
        assert isinstance(free, Path)
        np.testing.assert_array_equal(free.cells, bounded.cells)


@law(60)
@given(grids(), SEEDS, st.integers(1, 30))
def test_what_is_known_of_the_length_leaves_it_alone(
    blocked: BoolGrid, seed: int, units: int
) -> None:
    generator, space = np.random.default_rng(seed), FreeSpace.of(blocked)
    start, goal = (free_cell(generator, blocked) for _ in range(2))
    if start is None or goal is None:
        return
    workspace = SearchWorkspace(space)
    status, cells, diagonal = find(space, workspace, start, goal, 1 << 40)
    length, memory = (len(cells) - 1 - diagonal) * UNIT + diagonal * ROOT, workspace.memory
    for bound, floor in (
        (FAR, length),
        (FAR, length - 1),
        (length + 1, 0),
        (length + units * UNIT, length),
    ):
        known = search(
            space.across,
            space.along,
            space.diagonal_ends,
            memory,
            *start,
            *goal,
            1 << 40,
            bound,
            floor,
        )
        assert (known[0], len(known[1]), known[2]) == (status, len(cells), diagonal)
    none = search(
        space.across, space.along, space.diagonal_ends, memory, *start, *goal, 1 << 40, length, 0
    )
    assert none[0] == UNREACHABLE, "no path is shorter than the shortest"


def turns(path: Path) -> int:
    steps = np.diff(path.cells, axis=0)
    return int((np.diff(steps, axis=0) != 0).any(axis=1).sum())


def test_of_equally_short_paths_one_with_few_turns_is_taken() -> None:
    """A robot that has come east past a wall's end goes on east before it turns, if that is no
    longer."""
    blocked = np.zeros((12, 40), dtype=np.bool_)
    blocked[1:5, :10] = True
    outcome = plan(blocked, (0, 0), (8, 30))
    assert isinstance(outcome, Path)
    assert turns(outcome) == 1


def test_lengths_in_units_order_as_the_real_ones() -> None:
    """The nearest misses are fractions that approximate √2: p straight steps against q diagonal
    ones."""
    p, q = 1, 1
    while q < 400_000:
        assert (p * UNIT < q * ROOT) == (p * p < 2 * q * q)
        p, q = p + 2 * q, p + q


def scattered(share: float, side: int) -> BoolGrid:
    """Return side × side cells, a share of them blocked, with free corners."""
    blocked = np.random.default_rng(3).random((side, side)) < share
    blocked[:3, :3] = blocked[-3:, -3:] = False
    return np.asarray(blocked)


def test_a_flood_ends_a_long_search_for_a_goal_that_is_walled_in() -> None:
    blocked, goal = scattered(0.03, 1100), (1096, 1096)
    blocked[1090, 1090:] = blocked[1090:, 1090] = True
    space = FreeSpace.of(blocked)
    workspace = SearchWorkspace(space)
    # The control: the search itself has not ended by then.
    short = plan_in(space, workspace, (0, 0), goal, max_expansions=BEFORE_FLOOD)
    assert short == NoPath(reason=Reason.TIMEOUT)
    told = plan_in(space, workspace, (0, 0), goal, max_expansions=BEFORE_FLOOD + 1)
    assert told == NoPath(reason=Reason.UNREACHABLE)
    assert Replanner(space).plan((0, 0), goal) == told


def test_a_search_goes_on_after_the_flood_to_the_shortest_path() -> None:
    blocked, goal = scattered(0.03, 1100), (1099, 0)
    blocked[550, :-3] = True
    short = plan(blocked, (0, 0), goal, max_expansions=BEFORE_FLOOD)
    assert short == NoPath(reason=Reason.TIMEOUT)
    path = plan(blocked, (0, 0), goal)
    assert isinstance(path, Path)
    assert path.length == pytest.approx(length_by_astar(blocked, (0, 0), goal), rel=1e-12)
    assert_is_a_path(path, blocked, (0, 0), goal)
