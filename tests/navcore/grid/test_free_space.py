"""An updated free space equals a rebuilt one, bit for bit, and its marks are the ends of walks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.bitplane import PAD
from navcore.grid.free_space import (
    AHEAD,
    DEAD_END_AHEAD,
    DEAD_END_BACK,
    FREE,
    SQUARE,
    FreeSpace,
    find_dead_ends,
)
from navcore.grid.grid import BoolGrid
from tests.kernels import from_python
from tests.navcore.grid.random_grids import grids, some_cells
from tests.navcore.laws import law

call_find_dead_ends = from_python(find_dead_ends)

SEEDS = st.integers(0, 2**32 - 1)


def assert_same_space(space: FreeSpace, other: FreeSpace) -> None:
    """Assert equality of everything that a search reads."""
    rows, cols = slice(PAD, PAD + space.rows), slice(PAD, PAD + space.cols)
    np.testing.assert_array_equal(
        space.across[:DEAD_END_AHEAD, rows], other.across[:DEAD_END_AHEAD, rows]
    )
    np.testing.assert_array_equal(
        space.along[:DEAD_END_AHEAD, cols], other.along[:DEAD_END_AHEAD, cols]
    )
    np.testing.assert_array_equal(space.across[SQUARE], other.across[SQUARE])


@law(60)
@given(grids(), SEEDS)
def test_a_space_updated_by_cells_equals_a_rebuilt_one(blocked: BoolGrid, seed: int) -> None:
    space, generator = FreeSpace.of(blocked), np.random.default_rng(seed)
    for _ in range(4):
        cells, block = some_cells(generator, blocked.shape, 30), bool(generator.random() < 0.5)
        space.set_cells(cells, block)
        blocked[cells[:, 0], cells[:, 1]] = block
        np.testing.assert_array_equal(space.blocked(), blocked)
        assert_same_space(space, FreeSpace.of(blocked))


@law(60)
@given(grids(), SEEDS)
def test_a_space_updated_by_grids_equals_a_rebuilt_one(blocked: BoolGrid, seed: int) -> None:
    space, generator = FreeSpace.of(blocked), np.random.default_rng(seed)
    for share in (0.5, 0.001, 0.01):
        blocked ^= generator.random(blocked.shape) < share
        space.update(blocked)
        np.testing.assert_array_equal(space.blocked(), blocked)
        assert_same_space(space, FreeSpace.of(blocked))


@law(60)
@given(grids(), SEEDS)
def test_the_log_has_every_freed_cell(blocked: BoolGrid, seed: int) -> None:
    space, generator = FreeSpace.of(blocked), np.random.default_rng(seed)
    space.notes[:] = 0
    cells = some_cells(generator, blocked.shape, 40)
    space.set_cells(cells, False)
    freed = {(int(row), int(col)) for row, col in cells if blocked[row, col]}
    noted = space.freed[: space.notes[0]]
    assert {(int(cell) >> 32, int(cell) & 0xFFFFFFFF) for cell in noted} == freed
    assert space.notes[1] == 0


@law(40)
@given(grids(), SEEDS)
def test_only_blocked_cells_of_the_sentinel_are_counted(blocked: BoolGrid, seed: int) -> None:
    space, generator = FreeSpace.of(blocked), np.random.default_rng(seed)
    row, col = (int(generator.integers(side)) for side in blocked.shape)
    space.sentinel[row + PAD, (col + PAD) >> 6] = np.uint64(1) << np.uint64(col & 63)
    others = np.argwhere(~blocked & ~one_cell(blocked.shape, row, col))
    space.notes[:] = 0
    space.set_cells(others, True)
    assert space.notes[1] == 0
    space.set_cells(np.array([[row, col]]), True)
    assert space.notes[1] == (not blocked[row, col])


def one_cell(shape: tuple[int, int], row: int, col: int) -> BoolGrid:
    mask = np.zeros(shape, dtype=np.bool_)
    mask[row, col] = True
    return mask


def ends_at_a_jump_point(
    space: FreeSpace, blocked: BoolGrid, row: int, col: int, step: int
) -> bool:
    """Return the reference, found by walking the row cell by cell."""
    free = np.pad(~blocked, 1)
    at, row = col + 1, row + 1
    while free[row, at + step]:
        at += step
        for side in (row - 1, row + 1):
            if free[side, at] and not free[side, at - step]:
                return True
    return False


@law(40)
@given(grids(st.integers(1, 70)))
def test_a_walk_is_a_dead_end_where_walking_cell_by_cell_meets_an_obstacle_first(
    blocked: BoolGrid,
) -> None:
    space = FreeSpace.of(blocked)
    row = blocked.shape[0] // 2
    call_find_dead_ends(space.across, row + PAD)
    for col in np.nonzero(~blocked[row])[0]:
        for plane, step in ((DEAD_END_AHEAD, 1), (DEAD_END_BACK, -1)):
            word = int(space.across[plane, row + PAD, (col + PAD) >> 6])
            vain = word >> (int(col) & 63) & 1
            assert vain != ends_at_a_jump_point(space, blocked, row, int(col), step)


def test_a_change_drops_the_dead_ends_of_the_lines_around_it() -> None:
    space = FreeSpace.of(np.zeros((100, 100), dtype=np.bool_))
    for line in range(PAD, PAD + 100):
        call_find_dead_ends(space.across, line)
    space.set_cells(np.array([[50, 50]]), True)
    forgotten = np.nonzero(space.across[DEAD_END_AHEAD, PAD : PAD + 100, 0] == 0)[0]
    assert forgotten.tolist() == [49, 50, 51]
    assert (space.across[DEAD_END_AHEAD, PAD + 49 : PAD + 52] == 0).all()


def test_a_grid_too_large_for_the_numbering_of_its_cells_is_refused() -> None:
    with pytest.raises(ValueError, match="use a coarser resolution"):
        FreeSpace(70_000, 10)


def test_an_empty_grid_stops_walks_only_at_its_rim() -> None:
    space = FreeSpace.of(np.zeros((3, 64), dtype=np.bool_))
    assert space.across[FREE, PAD, 1] == np.uint64(2**64 - 1)
    assert space.across[AHEAD, PAD + 1, 1] == 1, "beside the first cell the padding has just ended"
