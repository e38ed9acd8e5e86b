"""On a grid that grows where a path asks for it, every path is as short as on an endless grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.bitplane import PAD
from navcore.grid.free_space import FREE, FreeSpace
from navcore.grid.grid import BoolGrid, Cell, GridSpec
from navcore.grid.growth import Growth
from navcore.planning.border import BOTTOM, LEFT, TOP, lacking_cells, sides_to_pass
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan
from navcore.planning.replanner import Replanner
from tests.navcore.grid.random_grids import free_cell, grids
from tests.navcore.laws import law

ENDLESS = 80
"""Cells around a grid: no path around a grid of at most 24 × 24 cells goes farther."""
SIDES = st.integers(2, 24)


def planned(blocked: BoolGrid, start: Cell, goal: Cell) -> tuple[Path | NoPath, int]:
    """Plan as the navigator does, but grow by single lines; return the outcome and their number."""
    lines = 0
    while True:
        outcome = plan(blocked, start, goal)
        part = lacking_cells(FreeSpace.of(blocked), start, goal, outcome)
        if part is None:
            return outcome, lines
        top, left, bottom, right = part
        blocked = np.pad(
            blocked, ((-top, bottom - blocked.shape[0]), (-left, right - blocked.shape[1]))
        )
        start, goal = (start[0] - top, start[1] - left), (goal[0] - top, goal[1] - left)
        lines += 1
        assert lines < ENDLESS


@law(300)
@given(grids(SIDES), st.integers(0, 2**32 - 1))
def test_a_believed_path_is_as_short_as_on_an_endless_grid(blocked: BoolGrid, seed: int) -> None:
    generator = np.random.default_rng(seed)
    start, goal = free_cell(generator, blocked), free_cell(generator, blocked)
    if start is None or goal is None:
        return
    outcome, _ = planned(blocked, start, goal)
    far = (start[0] + ENDLESS, start[1] + ENDLESS), (goal[0] + ENDLESS, goal[1] + ENDLESS)
    endless = plan(np.pad(blocked, ENDLESS), *far)
    if isinstance(outcome, NoPath):
        assert outcome == endless
    else:
        assert isinstance(endless, Path)
        assert outcome.length == pytest.approx(endless.length, rel=1e-12)


def test_a_path_around_a_wall_at_the_border_leads_outside_and_a_fixed_grid_misses_it() -> None:
    blocked = np.zeros((20, 21), dtype=np.bool_)
    blocked[:18, 10] = True
    start, goal = (2, 5), (2, 15)
    inside, (outcome, lines) = plan(blocked, start, goal), planned(blocked, start, goal)
    assert isinstance(inside, Path) and isinstance(outcome, Path)
    assert outcome.length < inside.length and lines == 1
    blocked[:, 10] = True
    assert plan(blocked, start, goal) == NoPath(reason=Reason.UNREACHABLE)
    assert isinstance(planned(blocked, start, goal)[0], Path)


def test_a_closed_room_is_believed_and_so_is_a_path_that_no_border_could_shorten() -> None:
    blocked = np.zeros((30, 30), dtype=np.bool_)
    blocked[0] = True
    blocked[10:15, 10:15] = True
    blocked[11:14, 11:14] = False
    for start, goal in (((5, 5), (12, 12)), ((12, 12), (5, 5)), ((20, 2), (20, 25))):
        assert planned(blocked, start, goal)[1] == 0


def test_only_sides_with_blocked_cells_near_the_path_are_passed() -> None:
    blocked = np.zeros((40, 40), dtype=np.bool_)
    blocked[:, 0] = blocked[-1, 30] = True
    free = FreeSpace.of(blocked).across[FREE]
    assert sides_to_pass(free, 40, 40, 30, 30, 35, 30, np.inf) == TOP | LEFT | BOTTOM
    assert sides_to_pass(free, 40, 40, 30, 30, 35, 30, 20.0) == BOTTOM
    assert sides_to_pass(free, 40, 40, 30, 30, 35, 30, 5.0) == 0


@law(60)
@given(grids(), st.integers(0, 2**32 - 1))
def test_growing_keeps_the_present_path_without_a_search_and_forgets_failures(
    blocked: BoolGrid, seed: int
) -> None:
    generator, (rows, cols) = np.random.default_rng(seed), blocked.shape
    start, goal = free_cell(generator, blocked), free_cell(generator, blocked)
    if start is None or goal is None:
        return
    space = FreeSpace.of(blocked)
    space.notes[:] = 0
    replanner = Replanner(space)
    before, searches = replanner.plan(start, goal), replanner.searches
    old = GridSpec(resolution_m=0.1, rows=rows, cols=cols, origin_x_m=0.0, origin_y_m=0.0)
    growth = Growth(old=old, new=old.part(-64, -128, rows, cols + 3), rows=64, cols=128)
    # Blocked cells around it, so that the shortest path stays what it was.
    wide = np.pad(blocked, ((64, 0), (128, 3)), constant_values=True)
    grown = FreeSpace.of(wide)
    grown.adopt(space, growth)
    replanner.grow(grown, growth)
    ends = (start[0] + 64, start[1] + 128), (goal[0] + 64, goal[1] + 128)
    after = replanner.plan(*ends)
    if isinstance(before, NoPath):
        assert after == before and replanner.searches == searches + 1
        return
    assert isinstance(after, Path) and replanner.searches == searches
    np.testing.assert_array_equal(after.cells, before.cells + growth.shift)
    # What is blocked on the path after growing is noticed.
    cell = after.cells[len(after.cells) // 2]
    grown.set_cells(cell[None], True)
    wide[tuple(cell)] = True
    again, expected = replanner.plan(*ends), plan(wide, *ends)
    assert isinstance(again, Path) == isinstance(expected, Path)
    if isinstance(again, Path) and isinstance(expected, Path):
        assert again.length == pytest.approx(expected.length)
    assert (grown.sentinel[:PAD] == 0).all()
