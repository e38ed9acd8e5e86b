"""What is known about diagonals is true, also after changes, and searches do make use of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.bitplane import PAD
from navcore.grid.free_space import DEAD_END_AHEAD, DEAD_END_BACK, SQUARE, FreeSpace, find_dead_ends
from navcore.grid.grid import BoolGrid
from navcore.planning.path import Path
from navcore.planning.planner import plan, plan_in
from navcore.planning.search.diagonals import OWNER
from navcore.planning.search.open_list import SearchWorkspace
from tests.kernels import from_python
from tests.navcore.grid.random_grids import free_cell, grids, some_cells
from tests.navcore.laws import law

call_find_dead_ends = from_python(find_dead_ends)


def bit(words: npt.NDArray[np.uint64], at: int) -> int:
    return int(words[at >> 6]) >> (at & 63) & 1


def passed(space: FreeSpace) -> Iterator[tuple[int, int, int, int]]:
    """(row, col, west, north), in the planes, of all cells that diagonal walks pass unexamined."""
    lines, epoch = space.across.shape[1], int(space.across[DEAD_END_BACK, 0, OWNER])
    for rising in (0, 1):
        owners = space.diagonal_ends[2 * rising, :, OWNER].astype(np.int64)
        for slot in np.flatnonzero((owners >> 32 == epoch) & (owners != 0)):
            line = int(owners[slot]) & 0xFFFFFFFF
            for north in (0, 1):
                words = space.diagonal_ends[2 * rising + north, slot]
                for row in range(PAD, 64 * len(words)):
                    col = line - row if rising else line - lines + row
                    if (
                        bit(words, row)
                        and not bit(space.along[DEAD_END_AHEAD, 0], row)
                        and not bit(space.across[DEAD_END_AHEAD, 0], col)
                    ):
                        yield row, col, rising ^ north, north


def assert_passed_for_good_reason(space: FreeSpace) -> int:
    """Number of cells that are passed."""
    fresh, count = FreeSpace.of(space.blocked()), 0
    for planes in (fresh.across, fresh.along):
        for line in range(PAD, planes.shape[1] - PAD):
            call_find_dead_ends(planes, line)
    for row, col, west, north in passed(space):
        assert bit(fresh.across[DEAD_END_AHEAD + west, row], col), (
            "the walk along the row leads nowhere"
        )
        assert bit(fresh.along[DEAD_END_AHEAD + north, col], row), (
            "the walk along the column leads nowhere"
        )
        assert bit(fresh.across[SQUARE, row - north], col - west), "one can step on"
        count += 1
    return count


def search_often(space: FreeSpace, generator: np.random.Generator, times: int) -> None:
    """Search between random cells, and compare the lengths with those on a newly built space."""
    workspace, blocked = SearchWorkspace(space), space.blocked()
    for _ in range(times):
        start, goal = (free_cell(generator, blocked) for _ in range(2))
        if start is None or goal is None:
            return
        outcome, expected = plan_in(space, workspace, start, goal), plan(blocked, start, goal)
        assert isinstance(outcome, Path) == isinstance(expected, Path)
        if isinstance(outcome, Path) and isinstance(expected, Path):
            np.testing.assert_array_equal(outcome.cells, expected.cells)


@law(25)
@given(grids(), st.integers(0, 2**32 - 1))
def test_cells_are_passed_only_where_no_walk_leads_anywhere(blocked: BoolGrid, seed: int) -> None:
    generator, space = np.random.default_rng(seed), FreeSpace.of(blocked)
    for _ in range(3):
        search_often(space, generator, 12)
        assert_passed_for_good_reason(space)
        space.set_cells(some_cells(generator, blocked.shape, 3), bool(generator.random() < 0.6))


@pytest.mark.parametrize("shape", [(200, 330), (330, 200)])
def test_diagonals_that_are_walked_often_get_known_and_stay_so_beside_a_small_change(
    shape: tuple[int, int],
) -> None:
    generator = np.random.default_rng(5)
    blocked = generator.random(shape) < 0.003
    space = FreeSpace.of(blocked)
    search_often(space, generator, 1000)
    known = assert_passed_for_good_reason(space)
    assert known > 2000
    space.set_cells(np.array([[100, 150]]), not blocked[100, 150])
    search_often(space, generator, 5)
    assert 0.8 * known < assert_passed_for_good_reason(space) < 1.2 * known


def test_all_is_surveyed_again_once_many_lines_have_changed() -> None:
    generator = np.random.default_rng(6)
    space = FreeSpace.of(generator.random((200, 200)) < 0.003)
    search_often(space, generator, 1000)
    known = assert_passed_for_good_reason(space)
    space.set_cells(np.column_stack([np.arange(0, 200, 2)] * 2), True)
    search_often(space, generator, 1)
    assert assert_passed_for_good_reason(space) < known / 10


def test_diagonals_take_turns_where_there_is_no_memory_for_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("navcore.grid.free_space.MAX_DIAGONAL_WORDS", 1024)
    generator = np.random.default_rng(7)
    space = FreeSpace.of(generator.random((150, 170)) < 0.003)
    assert space.diagonal_ends.shape[1] == 128, "of 640 diagonals of each kind"
    search_often(space, generator, 1000)
    assert assert_passed_for_good_reason(space) > 0
