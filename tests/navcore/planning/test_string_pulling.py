"""The taut track is never longer than the path, never leaves the free cells, and is straight on
free ground."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid
from navcore.planning.path import Path
from navcore.planning.planner import plan
from navcore.planning.string_pulling import line_of_sight, shortcut
from tests.navcore.laws import law

Ints = npt.NDArray[np.int64]


def crossed(here: Ints, there: Ints) -> set[tuple[int, int]]:
    """Cells whose inside the straight line between two centres crosses, by clipping it against each
    (slow and plain)."""
    cells = set()
    for row in range(min(here[0], there[0]), max(here[0], there[0]) + 1):
        for col in range(min(here[1], there[1]), max(here[1], there[1]) + 1):
            low, high = 0.0, 1.0
            for axis, cell in enumerate((row, col)):
                slope = float(there[axis] - here[axis])
                if slope == 0:
                    low, high = (low, high) if here[axis] == cell else (1.0, 0.0)
                    continue
                ends = sorted(((cell + side - here[axis]) / slope) for side in (-0.5, 0.5))
                low, high = max(low, ends[0]), min(high, ends[1])
            if high - low > 1e-9:
                cells.add((row, col))
    return cells


def length(corners: Ints) -> float:
    return float(np.hypot(*np.diff(corners, axis=0).T).sum())


@law(80)
@given(st.integers(0, 2**32 - 1))
def test_a_line_of_sight_crosses_the_cells_that_plain_clipping_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocked: BoolGrid = rng.random((12, 12)) < 0.15
    here, there = rng.integers(0, 12, 2), rng.integers(0, 12, 2)
    blocked[tuple(here)] = blocked[tuple(there)] = False
    clear = not any(blocked[cell] for cell in crossed(here, there))
    seen = bool(line_of_sight(CellMask.of(~blocked).plane, here, there))
    assert not seen or clear
    if (
        clear and not seen
    ):  # only a line through a corner point may be refused although it crosses free cells alone
        assert (there[0] - here[0]) != 0
        assert (there[1] - here[1]) != 0


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_the_track_is_no_longer_than_the_path_and_crosses_free_cells_only(seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocked: BoolGrid = rng.random((30, 30)) < 0.2
    blocked[0, 0] = blocked[29, 29] = False
    path = plan(blocked, (0, 0), (29, 29))
    if not isinstance(path, Path):
        return
    track = shortcut(path.cells, CellMask.of(~blocked).plane, stretch=60)
    assert track[0].tolist() == [0, 0]
    assert track[-1].tolist() == [29, 29]
    assert length(track) <= path.length + 1e-9
    for here, there in pairwise(track):
        assert not any(blocked[cell] for cell in crossed(here, there))


def test_on_free_ground_the_track_is_the_straight_line() -> None:
    path = plan(np.zeros((40, 40), dtype=np.bool_), (2, 3), (30, 11))
    assert isinstance(path, Path)
    track = shortcut(path.cells, CellMask.of(np.ones((40, 40), dtype=np.bool_)).plane, stretch=100)
    np.testing.assert_array_equal(track, [[2, 3], [30, 11]])


def test_beyond_the_stretch_the_track_is_the_path_itself() -> None:
    free = np.ones((10, 60), dtype=np.bool_)
    path = plan(~free, (5, 0), (5, 59))
    assert isinstance(path, Path)
    track = shortcut(path.cells, CellMask.of(free).plane, stretch=20)
    np.testing.assert_array_equal(track[:2], [[5, 0], [5, 20]])
    assert len(track) < len(path.cells)
    np.testing.assert_array_equal(track[-10:], path.cells[-10:])
