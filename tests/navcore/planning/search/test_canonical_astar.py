"""A* from cell to cell: against an independent solver, and where jump-point search hands over."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.bench.planning.plain_astar import length_by_astar
from navcore.grid.bitplane import PAD
from navcore.grid.free_space import FREE, FreeSpace
from navcore.grid.grid import BoolGrid, Cell
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan_in
from navcore.planning.search.canonical_astar import MOST_SEARCHES, search_cells, trace_cells
from navcore.planning.search.jump_point_search import BEFORE_CELLS
from navcore.planning.search.open_list import (
    BEST,
    BOUND,
    CELL_ROOM,
    CELL_SEARCHES,
    FAR,
    LABELS,
    LACKING,
    PUSHED,
    ROOT,
    UNIT,
    SearchWorkspace,
)
from tests.kernels import from_python
from tests.navcore.grid.random_grids import free_cell, grids
from tests.navcore.laws import law
from tests.navcore.planning.test_planner import assert_is_a_path, optimum

call_search_cells = from_python(search_cells)
call_trace_cells = from_python(trace_cells)

SEEDS = st.integers(0, 2**32 - 1)
SQRT2 = np.sqrt(2.0)


def workspace_with_labels(space: FreeSpace) -> SearchWorkspace:
    workspace = SearchWorkspace(space, cells=1 << 16)
    workspace.memory[LACKING] = LABELS
    workspace.grow()
    return workspace


def cell_by_cell(
    space: FreeSpace, workspace: SearchWorkspace, start: Cell, goal: Cell, bound: int = FAR
) -> Path | None:
    """Return the path between two free cells; None where there is none shorter than the bound."""
    memory, free = workspace.memory, space.across[FREE]
    memory[BOUND] = bound
    here, there = (row + PAD << 16 | col + PAD for row, col in (start, goal))
    assert call_search_cells(free, memory, here, there, 1 << 40)
    cells = call_trace_cells(free, memory, here, there)
    if memory[BEST] >= bound:
        return None
    straight, diagonal = (int((np.abs(np.diff(cells, axis=0)).sum(1) == n).sum()) for n in (1, 2))
    assert memory[BEST] == straight * UNIT + diagonal * ROOT
    return Path(cells=cells, length=straight + diagonal * SQRT2)


@law(100)
@given(grids(), SEEDS)
def test_paths_are_as_long_as_an_independent_exact_solver_says(
    blocked: BoolGrid, seed: int
) -> None:
    generator, space = np.random.default_rng(seed), FreeSpace.of(blocked)
    workspace = workspace_with_labels(space)
    for searches in (0, MOST_SEARCHES, MOST_SEARCHES - 1):  # in new, cleared and used memory
        workspace.memory[CELL_SEARCHES] = max(searches, workspace.memory[CELL_SEARCHES])
        start, goal = (free_cell(generator, blocked) for _ in range(2))
        if start is None or goal is None:
            return
        path, best = cell_by_cell(space, workspace, start, goal), optimum(blocked, start, goal)
        if path is None:
            assert best == np.inf
            continue
        assert path.length == pytest.approx(best, rel=1e-12)
        assert_is_a_path(path, blocked, start, goal)
        length = int(workspace.memory[BEST])
        assert cell_by_cell(space, workspace, start, goal, length) is None
        bounded = cell_by_cell(space, workspace, start, goal, length + 1)
        assert bounded is not None
        np.testing.assert_array_equal(bounded.cells, path.cells)


def scattered(share: float) -> BoolGrid:
    """Return 300 × 300 cells, a share of them blocked, with free corners."""
    blocked = np.random.default_rng(3).random((300, 300)) < share
    blocked[:3, :3] = blocked[-3:, -3:] = False
    return np.asarray(blocked)


def maze(side: int) -> BoolGrid:
    """Return a maze without loops, with corridors and walls of one cell."""
    blocked, generator = (
        np.ones((2 * side + 1, 2 * side + 1), dtype=np.bool_),
        np.random.default_rng(3),
    )
    blocked[1, 1], route = False, [(1, 1)]
    while route:
        row, col = route[-1]
        steps = [
            (down, right)
            for down, right in ((0, 2), (2, 0), (0, -2), (-2, 0))
            if 0 < row + down < 2 * side and 0 < col + right < 2 * side
            if blocked[row + down, col + right]
        ]
        if not steps:
            route.pop()
            continue
        down, right = steps[generator.integers(len(steps))]
        blocked[row + down // 2, col + right // 2] = blocked[row + down, col + right] = False
        route.append((row + down, col + right))
    return blocked


@pytest.mark.parametrize(
    ("blocked", "takes_over"),
    [
        pytest.param(scattered(0.1), True, id="10 % blocked"),
        pytest.param(scattered(0.3), True, id="30 % blocked"),
        pytest.param(scattered(0.01), False, id="1 % blocked: long walks"),
        pytest.param(maze(80), False, id="maze: few cells to open at once"),
    ],
)
def test_it_takes_over_where_walks_are_short_and_the_front_is_wide(
    blocked: BoolGrid, takes_over: bool
) -> None:
    space = FreeSpace.of(blocked)
    workspace, free = SearchWorkspace(space), np.argwhere(~blocked)
    start, goal = ((int(row), int(col)) for row, col in free[[0, -1]])
    path = plan_in(space, workspace, start, goal)
    assert isinstance(path, Path)
    assert path.length == pytest.approx(length_by_astar(blocked, start, goal), rel=1e-12)
    assert_is_a_path(path, blocked, start, goal)
    assert (workspace.memory[CELL_SEARCHES] > 0) == takes_over


def test_jump_point_search_goes_on_where_the_open_list_gets_too_long() -> None:
    blocked = scattered(0.3)
    space = FreeSpace.of(blocked)
    workspace = workspace_with_labels(space)
    workspace.memory[CELL_ROOM] = 1000
    path = plan_in(space, workspace, (0, 0), (299, 299))
    assert workspace.memory[CELL_SEARCHES] == 1
    assert workspace.memory[PUSHED] > BEFORE_CELLS
    # The control: with more room it does not have to.
    workspace = SearchWorkspace(space)
    other = plan_in(space, workspace, (0, 0), (299, 299))
    assert workspace.memory[PUSHED] == BEFORE_CELLS
    assert isinstance(path, Path)
    assert isinstance(other, Path)
    assert path.length == pytest.approx(other.length, rel=1e-12)
    short = plan_in(space, workspace, (0, 0), (299, 299), max_expansions=2000)
    assert short == NoPath(reason=Reason.TIMEOUT)
