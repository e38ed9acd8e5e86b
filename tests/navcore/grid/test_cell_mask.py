"""Packed sets of cells are the bool grids they were made of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.cell_mask import CellMask
from tests.navcore.laws import law


@law(60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 200), st.integers(1, 200))
def test_a_mask_and_every_window_of_it_equal_the_grid(seed: int, rows: int, cols: int) -> None:
    rng = np.random.default_rng(seed)
    grid = rng.random((rows, cols)) < 0.3
    mask = CellMask.of(grid)
    np.testing.assert_array_equal(mask.bools, grid)
    top, bottom = np.sort(rng.integers(0, rows + 1, 2))
    left, right = np.sort(rng.integers(0, cols + 1, 2))
    np.testing.assert_array_equal(
        mask.window(top, left, bottom, right), grid[top:bottom, left:right]
    )


def test_a_mask_cannot_be_written_to_and_does_not_follow_what_it_was_copied_from() -> None:
    first = CellMask.of(np.eye(5, dtype=np.bool_))
    plane = first.plane.copy()
    copy = CellMask.copied(plane, 5, 5)
    plane[:] = 0
    np.testing.assert_array_equal(copy.bools, np.eye(5, dtype=np.bool_))
    with pytest.raises(ValueError, match="read-only"):
        copy.bools[0, 0] = False
    with pytest.raises(ValueError, match="read-only"):
        copy.plane[0, 0] = 1


def test_an_empty_set_has_the_windows_of_any_other() -> None:
    rows, cols = 70, 130
    nothing = np.zeros((rows, cols), dtype=np.bool_)
    for empty in (CellMask.empty(rows, cols), CellMask.of(nothing)):
        assert not empty.bools.any()
        assert empty.bools.shape == (rows, cols)
        assert np.array_equal(empty.window(3, 5, 60, 100), nothing[3:60, 5:100])
    one = nothing.copy()
    one[4, 6] = True
    assert CellMask.of(one).window(3, 5, 60, 100)[1, 1]
    assert CellMask.empty(rows, cols).plane.shape == CellMask.of(one).plane.shape
