"""Nearest cells: the nearest reachable one against the definition."""

from __future__ import annotations

import tracemalloc

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.grid import BoolGrid
from navcore.grid.nearest import nearest_marked, nearest_of, nearest_reachable
from navcore.planning.path import Path
from navcore.planning.planner import plan
from tests.navcore.grid.random_grids import free_cell, grids
from tests.navcore.laws import law


@law(60)
@given(grids(st.integers(1, 9)), st.integers(0, 2**32 - 1))
def test_no_cell_with_a_path_to_it_is_nearer_to_the_goal(blocked: BoolGrid, seed: int) -> None:
    generator = np.random.default_rng(seed)
    start = free_cell(generator, blocked)
    goal = int(generator.integers(-3, 12)), int(generator.integers(-3, 12))
    if start is None:
        return
    near = nearest_reachable(blocked, start, goal)
    assert near is not None
    assert isinstance(plan(blocked, start, near), Path)
    distance = np.hypot(near[0] - goal[0], near[1] - goal[1])
    for row, col in np.argwhere(~blocked):
        if np.hypot(row - goal[0], col - goal[1]) < distance - 1e-9:
            assert not isinstance(plan(blocked, start, (int(row), int(col))), Path)


@law(60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.001, 0.02, 0.5]))
def test_the_nearest_marked_cell_is_that_of_all_of_them(seed: int, share: float) -> None:
    generator = np.random.default_rng(seed)
    mask = generator.random(tuple(generator.integers(1, 90, 2))) < share
    cell = int(generator.integers(-40, 130)), int(generator.integers(-40, 130))
    assert nearest_marked(mask, cell) == nearest_of(np.argwhere(mask), cell)


def test_the_search_of_a_large_grid_takes_some_bytes_a_cell() -> None:
    blocked = np.zeros((1024, 1024), dtype=np.bool_)
    blocked[100:120, 100:120] = True
    tracemalloc.start()
    try:
        assert nearest_reachable(blocked, (0, 0), (110, 105)) == (110, 99)
        assert tracemalloc.get_traced_memory()[1] < 10 * blocked.size
    finally:
        tracemalloc.stop()


def test_from_a_blocked_or_missing_start_nothing_is_reachable() -> None:
    blocked = np.array([[True, False]])
    assert nearest_reachable(blocked, (0, 0), (0, 1)) is None
    assert nearest_reachable(blocked, (3, 0), (0, 1)) is None
