"""The taut path is never longer than the path, never leaves the free cells, is straight on free
ground, and has no corner that it does not need."""

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
from navcore.planning.string_pulling import line_of_sight, taut_corners
from tests.kernels import from_python
from tests.navcore.laws import law

call_line_of_sight = from_python(line_of_sight)

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
    seen = bool(call_line_of_sight(CellMask.of(~blocked).plane, here, there))
    assert not seen or clear
    if (
        clear and not seen
    ):  # only a line through a corner point may be refused although it crosses free cells alone
        assert (there[0] - here[0]) != 0
        assert (there[1] - here[1]) != 0


def pulled(seed: int) -> tuple[Path, Ints, BoolGrid] | None:
    """A path across random rectangles and specks, its corners and the blocked cells."""
    rng = np.random.default_rng(seed)
    blocked: BoolGrid = rng.random((30, 30)) < rng.choice([0.0, 0.05, 0.2])
    for row, col, high, wide in rng.integers((0, 0, 1, 1), (30, 30, 9, 9), (4, 4)):
        blocked[row : row + high, col : col + wide] = True
    start, goal = ((int(r), int(c)) for r, c in rng.integers(0, 30, (2, 2)))
    blocked[start] = blocked[goal] = False
    path = plan(blocked, start, goal)
    if not isinstance(path, Path):
        return None
    return path, taut_corners(path.cells, CellMask.of(~blocked).plane), blocked


@law(100)
@given(st.integers(0, 2**32 - 1))
def test_the_corners_are_cells_of_the_path_in_order_with_both_ends(seed: int) -> None:
    if (found := pulled(seed)) is None:
        return
    path, corners, _ = found
    order = [path.cells.tolist().index(cell) for cell in corners.tolist()]
    assert (order[0], order[-1]) == (0, len(path.cells) - 1)
    assert order == sorted(set(order))


@law(100)
@given(st.integers(0, 2**32 - 1))
def test_the_line_through_the_corners_is_no_longer_and_crosses_free_cells_only(seed: int) -> None:
    if (found := pulled(seed)) is None:
        return
    path, corners, blocked = found
    assert length(corners) <= path.length + 1e-9
    for here, there in pairwise(corners):
        assert not any(blocked[cell] for cell in crossed(here, there))


@law(100)
@given(st.integers(0, 2**32 - 1))
def test_no_corner_can_be_left_out(seed: int) -> None:
    if (found := pulled(seed)) is None:
        return
    _, corners, blocked = found
    plane = CellMask.of(~blocked).plane
    for before, after in zip(corners, corners[2:], strict=False):
        assert not call_line_of_sight(plane, before, after)


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_on_free_ground_there_is_no_corner_between(seed: int) -> None:
    start, goal = np.random.default_rng(seed).integers(0, 300, (2, 2))
    free = np.ones((300, 300), dtype=np.bool_)
    path = plan(~free, (int(start[0]), int(start[1])), (int(goal[0]), int(goal[1])))
    assert isinstance(path, Path)
    corners = taut_corners(path.cells, CellMask.of(free).plane)
    expected = [start, goal] if len(path.cells) > 1 else [start]
    np.testing.assert_array_equal(corners, expected)


def test_round_a_wall_there_are_two_corners_where_the_staircase_has_many() -> None:
    blocked = np.zeros((40, 60), dtype=np.bool_)
    blocked[:30, 28:32] = True
    path = plan(blocked, (3, 7), (12, 55))
    assert isinstance(path, Path)
    corners = taut_corners(path.cells, CellMask.of(~blocked).plane)
    assert len(corners) == 4
    assert (abs(corners[1:3] - (30, 29.5)) < 10).all()
