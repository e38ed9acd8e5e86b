"""Nearest cells: the nearest reachable one against the definition."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.grid import BoolGrid
from navcore.grid.nearest import nearest_reachable
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


def test_from_a_blocked_or_missing_start_nothing_is_reachable() -> None:
    blocked = np.array([[True, False]])
    assert nearest_reachable(blocked, (0, 0), (0, 1)) is None
    assert nearest_reachable(blocked, (3, 0), (0, 1)) is None
