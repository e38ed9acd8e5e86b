"""Whatever happens between two plans, a replanned path is as long as one planned from scratch."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import BoolGrid, Cell
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan
from navcore.planning.replanner import NOWHERE, Replanner, common_cells, move_sentinel
from navcore.planning.search.open_list import UNIT, octile
from tests.kernels import from_python
from tests.navcore.grid.random_grids import free_cell, grids, some_cells
from tests.navcore.laws import law
from tests.navcore.planning.test_planner import assert_is_a_path

call_move_sentinel = from_python(move_sentinel)
call_common_cells = from_python(common_cells)
call_octile = from_python(octile)

SEEDS = st.integers(0, 2**32 - 1)
SIDES = st.one_of(st.integers(2, 24), st.integers(60, 70))


class Drive:
    """A robot on a changing grid; every step is planned by the replanner and from scratch."""

    def __init__(self, blocked: BoolGrid, seed: int) -> None:
        self.blocked, self.generator = blocked, np.random.default_rng(seed)
        self.space = FreeSpace.of(blocked)
        self.replanner = Replanner(self.space)
        self.start, self.goal = (0, 0), (0, 0)
        self.path: Path | None = None
        self.visited: list[Cell] = []

    def reset(self) -> bool:
        """Set robot and goal to random cells."""
        start, goal = (free_cell(self.generator, self.blocked) for _ in range(2))
        if start is None or goal is None:
            return False
        self.start, self.goal = start, goal
        return True

    def change(self) -> None:
        """Apply random changes between two frames."""
        event = self.generator.choice(
            ["block", "free", "both", "grid", "drive", "stray", "goal", "nothing", "behind"]
        )
        if event in ("block", "both"):
            self.set(some_cells(self.generator, self.blocked.shape, 3), True)
        if event in ("free", "both"):
            occupied = np.argwhere(self.blocked)
            self.set(
                occupied[
                    self.generator.permutation(len(occupied))[: self.generator.integers(1, 4)]
                ],
                False,
            )
        if event == "grid":
            self.blocked = self.blocked ^ (self.generator.random(self.blocked.shape) < 0.003)
            self.space.update(self.blocked)
        if event == "behind":
            self.start = self.visited[self.generator.integers(len(self.visited))]
        if event in ("drive", "both") and self.path is not None:
            ahead = int(self.generator.integers(0, len(self.path.cells)))
            self.start = (int(self.path.cells[ahead, 0]), int(self.path.cells[ahead, 1]))
        if event == "stray":
            self.start = free_cell(self.generator, self.blocked) or self.start
        if event == "goal":
            self.goal = free_cell(self.generator, self.blocked) or self.goal

    def set(self, cells: np.ndarray[tuple[int, int], np.dtype[np.int64]], blocked: bool) -> None:
        self.blocked[cells[:, 0], cells[:, 1]] = blocked
        self.space.set_cells(cells, blocked)

    def agrees(self) -> bool:
        """Plan with both; whether the lengths, or the reasons, are the same."""
        self.visited.append(self.start)
        outcome, expected = (
            self.replanner.plan(self.start, self.goal),
            plan(self.blocked, self.start, self.goal),
        )
        if isinstance(outcome, NoPath) or isinstance(expected, NoPath):
            return outcome == expected
        self.path = outcome
        if outcome.length == pytest.approx(expected.length, rel=1e-12):
            assert_is_a_path(outcome, self.blocked, self.start, self.goal)
            return True
        return False


@law(60)
@given(grids(SIDES), SEEDS)
def test_the_sentinel_lies_along_the_new_path_and_nowhere_else(
    blocked: BoolGrid, seed: int
) -> None:
    generator = np.random.default_rng(seed)
    goal, sentinel, old = (
        free_cell(generator, blocked),
        np.zeros_like(FreeSpace.of(blocked).sentinel),
        NOWHERE,
    )
    for _ in range(4):
        start = free_cell(generator, blocked)
        if start is None or goal is None:
            return
        outcome, expected = plan(blocked, start, goal), np.zeros_like(sentinel)
        new = outcome.cells if isinstance(outcome, Path) else NOWHERE
        call_move_sentinel(sentinel, old, new, call_common_cells(old, new))
        call_move_sentinel(expected, NOWHERE, new, 0)
        np.testing.assert_array_equal(sentinel, expected)
        blocked[tuple(some_cells(generator, blocked.shape, 6).T)] = True
        old = new


@law(250)
@given(grids(SIDES), SEEDS)
def test_a_replanned_path_is_as_long_as_one_planned_from_scratch(
    blocked: BoolGrid, seed: int
) -> None:
    drive = Drive(blocked, seed)
    if not drive.reset():
        return
    for _ in range(12):
        assert drive.agrees()
        drive.change()


def test_a_freed_cell_that_only_opens_a_diagonal_past_it_is_noticed() -> None:
    blocked = np.zeros((6, 6), dtype=np.bool_)
    blocked[0, 1] = True
    space = FreeSpace.of(blocked)
    replanner = Replanner(space)
    first = replanner.plan((0, 0), (5, 5))
    assert isinstance(first, Path)
    assert call_octile(0, 1) + call_octile(5, 4) > first.length * UNIT - 1, (
        "control: a path through the cell itself is no shorter"
    )
    space.set_cells(np.array([[0, 1]]), False)
    second = replanner.plan((0, 0), (5, 5))
    assert isinstance(second, Path)
    assert second.length == pytest.approx(5 * 2**0.5)


def open_field() -> tuple[FreeSpace, Replanner]:
    space = FreeSpace.of(np.zeros((80, 80), dtype=np.bool_))
    return space, Replanner(space)


def cells_of(outcome: Path | NoPath) -> list[Cell]:
    assert isinstance(outcome, Path)
    return [(int(row), int(col)) for row, col in outcome.cells]


def test_a_robot_that_follows_its_path_searches_once() -> None:
    _, replanner = open_field()
    path = cells_of(replanner.plan((5, 5), (70, 30)))
    for index, cell in enumerate(path):
        assert cells_of(replanner.plan(cell, (70, 30))) == path[index:]
    assert replanner.searches == 1


def test_obstacles_beside_the_path_and_gaps_far_from_it_cost_no_search() -> None:
    space, replanner = open_field()
    path = cells_of(replanner.plan((5, 5), (70, 30)))
    beside = np.array(
        [
            [row, col]
            for row in range(80)
            for col in range(80)
            if col > 50 and (row, col) not in path
        ]
    )
    space.set_cells(beside, True)
    assert cells_of(replanner.plan((5, 5), (70, 30))) == path
    space.set_cells(beside[-10:], False)
    assert cells_of(replanner.plan((5, 5), (70, 30))) == path
    assert replanner.searches == 1


def test_an_obstacle_on_the_path_costs_a_search() -> None:
    space, replanner = open_field()
    path = cells_of(replanner.plan((5, 5), (70, 30)))
    space.set_cells(np.array([path[20]]), True)
    assert path[20] not in cells_of(replanner.plan((5, 5), (70, 30)))
    assert replanner.searches == 2


def test_a_robot_beside_its_path_goes_back_to_it_if_that_is_no_longer() -> None:
    _, replanner = open_field()
    path = cells_of(replanner.plan((5, 5), (70, 30)))
    beside = (12, 5) if (12, 5) not in path else (12, 12)
    back = cells_of(replanner.plan(beside, (70, 30)))
    assert replanner.searches == 2
    assert set(path[-30:]) <= set(back)


def test_a_goal_shut_in_is_not_searched_for_again_until_a_cell_is_freed() -> None:
    blocked = np.zeros((30, 30), dtype=np.bool_)
    blocked[:, 15] = True
    space = FreeSpace.of(blocked)
    replanner = Replanner(space)
    for _ in range(3):
        assert replanner.plan((3, 3), (3, 28)) == NoPath(reason=Reason.UNREACHABLE)
    space.set_cells(np.array([[9, 9]]), True)
    assert replanner.plan((3, 3), (3, 28)) == NoPath(reason=Reason.UNREACHABLE)
    assert replanner.searches == 1
    space.set_cells(np.array([[20, 15]]), False)
    assert isinstance(replanner.plan((3, 3), (3, 28)), Path)
    space.set_cells(np.array([[3, 28]]), True)
    assert replanner.plan((3, 3), (3, 28)) == NoPath(reason=Reason.GOAL_BLOCKED)


def test_a_search_given_up_says_so_and_the_next_one_is_unharmed() -> None:
    blocked = np.random.default_rng(0).random((80, 80)) < 0.3
    blocked[0, 0] = blocked[79, 79] = False
    replanner = Replanner(FreeSpace.of(blocked))
    expected = plan(blocked, (0, 0), (79, 79))
    assert replanner.plan((0, 0), (79, 79), max_expansions=5) == NoPath(reason=Reason.TIMEOUT)
    outcome = replanner.plan((0, 0), (79, 79))
    assert isinstance(outcome, Path) == isinstance(expected, Path)
    if isinstance(outcome, Path) and isinstance(expected, Path):
        np.testing.assert_array_equal(outcome.cells, expected.cells)
