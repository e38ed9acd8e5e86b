"""Grids and edits for the laws of the search."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from hypothesis import strategies as st

from navcore.grid.grid import BoolGrid, Cell

SHARES = st.sampled_from([0.0, 0.02, 0.1, 0.3, 0.5])


SIDES = st.one_of(st.integers(1, 24), st.integers(60, 70), st.integers(120, 200))


@st.composite
def grids(draw: st.DrawFn, sides: st.SearchStrategy[int] = SIDES) -> BoolGrid:
    """Return random grids of all sizes up to a few words, with single cells and rectangles."""
    rows, cols = draw(sides), draw(sides)
    generator = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    blocked: BoolGrid = generator.random((rows, cols)) < draw(SHARES)
    for _ in range(draw(st.integers(0, 8))):
        top, left = int(generator.integers(rows)), int(generator.integers(cols))
        height, width = generator.integers(1, 20, 2)
        blocked[top : top + height, left : left + width] = bool(generator.random() < 0.7)
    return blocked


def some_cells(
    generator: np.random.Generator, shape: tuple[int, int], most: int
) -> npt.NDArray[np.int64]:
    """Return (N, 2), up to `most`, random cells of the grid."""
    count = int(generator.integers(0, most + 1))
    return np.column_stack([generator.integers(0, side, count) for side in shape])


def free_cell(generator: np.random.Generator, blocked: BoolGrid) -> Cell | None:
    """Return a random free cell; None if there is none."""
    free = np.argwhere(~blocked)
    if len(free) == 0:
        return None
    row, col = free[generator.integers(len(free))]
    return int(row), int(col)
