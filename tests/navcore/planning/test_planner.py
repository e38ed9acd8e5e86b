"""The planner against independent solvers and published lengths."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from navcore.grid.grid import BoolGrid, Cell
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan
from tests.navcore.laws import law
from tests.shared_data import beside

MAPS = FilePath(__file__).parents[3].parent / "shared" / "data" / "maps"
SQRT2 = 2.0**0.5


def optimum(blocked: BoolGrid, start: Cell, goal: Cell, *, cut_corners: bool = False) -> float:
    """Length of the shortest path by SciPy's Dijkstra on the explicit graph of the corner rule;
    infinite without one."""
    rows, cols = blocked.shape
    ids = np.arange(rows * cols).reshape(rows, cols)
    heads: list[npt.NDArray[np.int64]] = []
    tails: list[npt.NDArray[np.int64]] = []
    weights: list[npt.NDArray[np.float64]] = []
    free = np.pad(~blocked, 1)
    for dr in (-1, 0, 1):
        for dc in (-1, 0, 1):
            if dr == dc == 0:
                continue
            there = free[1 + dr : rows + 1 + dr, 1 + dc : cols + 1 + dc]
            sides = free[1 + dr : rows + 1 + dr, 1:-1] & free[1:-1, 1 + dc : cols + 1 + dc]
            allowed = ~blocked & there if cut_corners else ~blocked & there & sides
            heads.append(ids[allowed])
            tails.append(ids[allowed] + dr * cols + dc)
            weights.append(np.full(int(allowed.sum()), SQRT2 if dr and dc else 1.0))
    graph = coo_matrix(
        (np.concatenate(weights), (np.concatenate(heads), np.concatenate(tails))),
        shape=(rows * cols, rows * cols),
    )
    return float(dijkstra(graph.tocsr(), indices=int(ids[start]))[int(ids[goal])])


def assert_is_a_path(path: Path, blocked: BoolGrid, start: Cell, goal: Cell) -> None:
    """From start to goal, connected, free, no corner cut, and as long as its own steps."""
    cells = path.cells
    assert tuple(cells[0]) == start
    assert tuple(cells[-1]) == goal
    assert not blocked[cells[:, 0], cells[:, 1]].any()
    steps = np.diff(cells, axis=0)
    assert (np.abs(steps).max(axis=1, initial=0) == 1).all()
    assert not blocked[cells[:-1, 0] + steps[:, 0], cells[:-1, 1]].any()
    assert not blocked[cells[:-1, 0], cells[:-1, 1] + steps[:, 1]].any()
    assert path.length == pytest.approx(np.hypot(steps[:, 0], steps[:, 1]).sum(), abs=1e-9)


@st.composite
def problems(draw: st.DrawFn) -> tuple[BoolGrid, Cell, Cell]:
    rows, cols = draw(st.integers(1, 18)), draw(st.integers(1, 18))
    share = draw(st.sampled_from([0.0, 0.1, 0.25, 0.4, 0.6]))
    blocked = np.random.default_rng(draw(st.integers(0, 2**32 - 1))).random((rows, cols)) < share
    start = draw(st.integers(0, rows - 1)), draw(st.integers(0, cols - 1))
    goal = draw(st.integers(0, rows - 1)), draw(st.integers(0, cols - 1))
    blocked[start] = blocked[goal] = False
    return blocked, start, goal


@law(300)
@given(problems())
def test_a_plan_is_as_long_as_an_independent_exact_solver_says(
    problem: tuple[BoolGrid, Cell, Cell],
) -> None:
    blocked, start, goal = problem
    best, outcome = optimum(*problem), plan(blocked, start, goal)
    if isinstance(outcome, NoPath):
        assert outcome.reason is Reason.UNREACHABLE
        assert best == np.inf
    else:
        assert outcome.length == pytest.approx(best, abs=1e-9)
        assert_is_a_path(outcome, blocked, start, goal)


@law(60)
@given(problems())
def test_planning_the_same_problem_twice_gives_the_same_cells(
    problem: tuple[BoolGrid, Cell, Cell],
) -> None:
    first, second = plan(*problem), plan(problem[0].copy(order="F"), *problem[1:])
    if isinstance(first, NoPath) or isinstance(second, NoPath):
        assert first == second
    else:
        np.testing.assert_array_equal(first.cells, second.cells)
        assert first.length == second.length


@law(60)
@given(problems())
def test_the_path_back_is_as_long_as_the_path_there(problem: tuple[BoolGrid, Cell, Cell]) -> None:
    blocked, start, goal = problem
    there, back = plan(blocked, start, goal), plan(blocked, goal, start)
    assert isinstance(there, Path) == isinstance(back, Path)
    if isinstance(there, Path) and isinstance(back, Path):
        assert there.length == pytest.approx(back.length, abs=1e-9)


@law(60)
@given(problems())
def test_planning_leaves_the_grid_as_it_was(problem: tuple[BoolGrid, Cell, Cell]) -> None:
    before = problem[0].copy()
    plan(*problem)
    np.testing.assert_array_equal(problem[0], before)


def test_the_corner_rule_costs_a_detour_that_a_corner_cutter_would_not_make() -> None:
    """Control: the exact solver without the corner rule differs, so agreement with it is not by
    chance."""
    blocked = np.zeros((3, 3), dtype=np.bool_)
    blocked[1, 1] = True
    outcome = plan(blocked, (1, 0), (0, 1))
    assert isinstance(outcome, Path)
    assert outcome.length == 2.0
    assert optimum(blocked, (1, 0), (0, 1), cut_corners=True) == pytest.approx(SQRT2)


def test_a_gap_between_two_diagonal_walls_is_closed() -> None:
    blocked = np.eye(8, dtype=np.bool_)[::-1].copy()
    outcome = plan(blocked, (0, 0), (7, 7))
    assert isinstance(outcome, NoPath)
    assert outcome.reason is Reason.UNREACHABLE


def test_a_robot_on_its_goal_has_a_path_of_one_cell_and_no_length() -> None:
    outcome = plan(np.zeros((4, 4), dtype=np.bool_), (2, 1), (2, 1))
    assert isinstance(outcome, Path)
    assert outcome.cells.tolist() == [[2, 1]]
    assert outcome.length == 0.0


WALL = np.zeros((5, 7), dtype=np.bool_)
WALL[:, 3] = True


@pytest.mark.parametrize(
    ("start", "goal", "budget", "reason"),
    [
        ((1, 3), (1, 6), None, Reason.START_BLOCKED),
        ((1, 0), (1, 3), None, Reason.GOAL_BLOCKED),
        ((1, 3), (2, 3), None, Reason.START_BLOCKED),
        ((-1, 0), (1, 1), None, Reason.OUTSIDE),
        ((1, 1), (5, 0), None, Reason.OUTSIDE),
        ((1, 1), (0, 7), None, Reason.OUTSIDE),
        ((1, 3), (0, -1), None, Reason.OUTSIDE),
        ((1, 0), (1, 6), None, Reason.UNREACHABLE),
        ((0, 0), (4, 2), 2, Reason.TIMEOUT),
    ],
)
def test_a_plan_that_fails_says_why(
    start: Cell, goal: Cell, budget: int | None, reason: Reason
) -> None:
    outcome = plan(WALL, start, goal, max_expansions=budget)
    assert isinstance(outcome, NoPath)
    assert outcome.reason is reason


def test_a_budget_that_suffices_changes_nothing() -> None:
    free, bounded = plan(WALL, (0, 0), (4, 2)), plan(WALL, (0, 0), (4, 2), max_expansions=WALL.size)
    assert isinstance(free, Path)
    assert isinstance(bounded, Path)
    np.testing.assert_array_equal(free.cells, bounded.cells)


def map_data(*parts: str) -> FilePath:
    """A file of the published maps; skips where they are not installed, unless continuous
    integration promises them."""
    return beside(MAPS.joinpath(*parts), "the published grid maps are")


MOVINGAI = [
    ("bg512", "AR0011SR", 6),
    ("cities", "Berlin_0_1024", 3),
    ("cities", "London_0_1024", 3),
    ("cities", "NewYork_0_1024", 3),
    ("dao", "arena2", 10),
    ("dao", "orz100d", 6),
    ("mazes", "maze512-2-0", 4),
    ("mazes", "maze512-32-0", 4),
    ("mazes", "maze512-8-0", 4),
    ("random", "random512-10-0", 6),
    ("random", "random512-35-0", 6),
    ("rooms", "16room_000", 6),
    ("rooms", "64room_000", 6),
    ("sc1", "Aurora", 3),
]


@pytest.mark.parametrize("kind", [np.uint8, np.int32, np.int64, np.float32, np.float64])
def test_a_grid_of_numbers_is_blocked_where_they_are_not_0(kind: type[np.generic]) -> None:
    blocked = np.zeros((30, 30), dtype=np.bool_)
    blocked[:-1, 15] = True
    wanted, found = plan(blocked, (0, 0), (0, 29)), plan(blocked.astype(kind), (0, 0), (0, 29))
    assert isinstance(wanted, Path) and isinstance(found, Path)
    np.testing.assert_array_equal(found.cells, wanted.cells)


@pytest.mark.parametrize(
    ("folder", "name", "count"), MOVINGAI, ids=[name for _, name, _ in MOVINGAI]
)
def test_the_published_optimal_lengths_of_movingai_are_met(
    folder: str, name: str, count: int
) -> None:
    lines = map_data("movingai", folder, f"{name}.map").read_text().splitlines()
    blocked = np.array([[letter not in ".GS" for letter in line] for line in lines[4:]])
    scenario = map_data("movingai", folder, f"{name}.map.scen").read_text().splitlines()
    queries = [line.split() for line in scenario[1:] if line.strip()]
    # The lengths are published as rounded text: six digits, in one file two decimals.
    decimals = max(len(query[8].partition(".")[2]) for query in queries)
    for at in np.linspace(0, len(queries) - 1, count).astype(int):
        start_x, start_y, goal_x, goal_y = (int(word) for word in queries[at][4:8])
        outcome = plan(blocked, (start_y, start_x), (goal_y, goal_x))
        assert isinstance(outcome, Path), f"{name}, query {at}"
        known = float(queries[at][8])
        last_digit = max(10.0**-decimals, 10.0 ** (math.floor(math.log10(max(known, 1.0))) - 5))
        assert outcome.length == pytest.approx(known, abs=last_digit, rel=0), f"{name}, query {at}"
        assert_is_a_path(outcome, blocked, (start_y, start_x), (goal_y, goal_x))


PACKED = [
    ("ros", "depot_queries", 10),
    ("ros", "tb3_sandbox_queries", 10),
    ("ros", "warehouse_queries", 5),
    ("synthetic", "forest1500_d08", 3),
    ("synthetic", "forest1500_d08_walls40", 3),
    ("synthetic", "forest3000_d08_walls40", 2),
]


@pytest.mark.parametrize(("folder", "name", "count"), PACKED, ids=[name for _, name, _ in PACKED])
def test_the_known_optimal_lengths_of_robot_maps_are_met(
    folder: str, name: str, count: int
) -> None:
    with np.load(map_data(folder, f"{name}.npz")) as stored:
        rows, cols = (int(side) for side in stored["shape"])
        blocked = ~np.unpackbits(stored["free"], axis=1)[:rows, :cols].astype(np.bool_)
        queries = stored["queries"]
    for at in np.linspace(0, len(queries) - 1, count).astype(int):
        start_x, start_y, goal_x, goal_y = (int(number) for number in queries[at][:4])
        outcome = plan(blocked, (start_y, start_x), (goal_y, goal_x))
        assert isinstance(outcome, Path), f"{name}, query {at}"
        assert outcome.length == pytest.approx(float(queries[at][4]), rel=1e-6), (
            f"{name}, query {at}"
        )
        assert_is_a_path(outcome, blocked, (start_y, start_x), (goal_y, goal_x))
