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
