"""A grid that has grown equals one that had the larger size from the beginning."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.bitplane import MOST_CELLS, empty_plane, pack, unpack
from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import BoolGrid, Box, GridSpec, inflate
from navcore.grid.growth import TILE, Growth, growth_into, growth_to, is_possible, reaching
from navcore.grid.inflation import InflatedGrid
from tests.navcore.grid.random_grids import grids, some_cells
from tests.navcore.grid.test_free_space import assert_same_space
from tests.navcore.laws import law

BEYOND = st.sampled_from([0, 0, 1, 300])
BEYONDS = st.tuples(BEYOND, BEYOND, BEYOND, BEYOND)


def spec_of(grid: BoolGrid) -> GridSpec:
    rows, cols = grid.shape
    return GridSpec(resolution_m=0.05, rows=rows, cols=cols, origin_x_m=-3.1, origin_y_m=2.35)


def growth_by(grid: BoolGrid, beyond: Box) -> Growth:
    """Return the growth by some cells on each side; none at all is a growth too."""
    spec, (above, before, below, after) = spec_of(grid), beyond
    part = -above, -before, spec.rows + below, spec.cols + after
    return growth_to(spec, part) or Growth(old=spec, new=spec, rows=0, cols=0)


def padded(grid: BoolGrid, growth: Growth) -> BoolGrid:
    """Return (rows, cols) of the new grid with the old cells in their places."""
    whole = np.zeros((growth.new.rows, growth.new.cols), dtype=np.bool_)
    whole[growth.rows : growth.rows + grid.shape[0], growth.cols : growth.cols + grid.shape[1]] = (
        grid
    )
    return whole


@law(60)
@given(grids(), BEYONDS)
def test_whole_tiles_are_added_where_cells_are_needed_and_nowhere_else(
    grid: BoolGrid, beyond: Box
) -> None:
    spec, growth = spec_of(grid), growth_by(grid, beyond)
    rows, cols = growth.new.rows - spec.rows, growth.new.cols - spec.cols
    assert rows == sum(-(-side // TILE) * TILE for side in beyond[::2])
    assert cols == sum(-(-side // TILE) * TILE for side in beyond[1::2])
    again = growth_into(spec, growth.new)
    assert again is not None and (again.rows, again.cols) == (growth.rows, growth.cols)
    for row, col in ((0, 0), (spec.rows - 1, spec.cols - 1)):
        x_m, y_m = spec.centre(row, col)
        assert growth.new.cell(x_m, y_m) == (row + growth.rows, col + growth.cols)


@law(60)
@given(grids(), BEYONDS)
def test_cells_keep_their_places_in_the_map_frame(grid: BoolGrid, beyond: Box) -> None:
    growth, plane = growth_by(grid, beyond), empty_plane(*grid.shape)
    pack(grid, plane)
    whole = unpack(growth.plane(plane), growth.new.rows, growth.new.cols)
    np.testing.assert_array_equal(whole, padded(grid, growth))
    flat = growth.flat(np.flatnonzero(grid))
    np.testing.assert_array_equal(flat, np.flatnonzero(padded(grid, growth)))


@law(60)
@given(grids(), BEYONDS, st.integers(0, 2**32 - 1))
def test_a_grown_inflation_equals_one_made_on_the_larger_grid_and_goes_on_as_it_does(
    shape_of: BoolGrid, beyond: Box, seed: int
) -> None:
    generator, growth = np.random.default_rng(seed), growth_by(shape_of, beyond)
    grid, masks = InflatedGrid(*shape_of.shape), {}
    for radius in (3, 9):
        masks[radius] = shape_of & (generator.random(shape_of.shape) < 0.1)
    grid.update(masks)
    grid.grow(growth)
    masks = {radius: padded(mask, growth) for radius, mask in masks.items()}
    expected = np.logical_or.reduce([inflate(mask, radius) for radius, mask in masks.items()])
    np.testing.assert_array_equal(grid.space.blocked(), expected)
    assert_same_space(grid.space, FreeSpace.of(expected))
    cells = some_cells(generator, expected.shape, 20)
    grid.set_cells(3, cells, True)
    masks[3][cells[:, 0], cells[:, 1]] = True
    expected = np.logical_or.reduce([inflate(mask, radius) for radius, mask in masks.items()])
    assert_same_space(grid.space, FreeSpace.of(expected))


def test_a_grid_grows_for_kilometres_in_one_direction_and_not_beyond_its_memory() -> None:
    spec = GridSpec.centred(size_m=(30.0, 20.0), resolution_m=0.05)
    assert is_possible(reaching(spec, [(2000.0, 0.0)]))
    assert is_possible(reaching(spec, [(380.0, 380.0)]))
    assert not is_possible(reaching(spec, [(2000.0, 2000.0)]))
    assert growth_to(spec, (0, 0, 1, 60_000)) is not None
    assert growth_to(spec, (0, 0, 1, 66_000)) is None
    assert growth_to(spec, (0, 0, MOST_CELLS // 1000, 1000)) is None


def test_only_a_grid_with_the_same_cells_is_a_growth() -> None:
    spec = GridSpec.centred(size_m=(30.0, 20.0), resolution_m=0.05)
    for other in (
        GridSpec.centred(size_m=(60.0, 40.0), resolution_m=0.1),
        GridSpec.centred(size_m=(30.0, 20.1), resolution_m=0.05),
        spec.part(0, 0, spec.rows - 1, spec.cols),
        spec.part(-1, -64, spec.rows, spec.cols),
    ):
        assert growth_into(spec, other) is None
    assert growth_into(spec, spec.part(-64, -128, spec.rows, spec.cols + 5)) is not None
    assert growth_into(spec, spec) == Growth(old=spec, new=spec, rows=0, cols=0)


@pytest.mark.parametrize("times", [1, 7])
def test_the_corner_does_not_depend_on_the_order_of_growth(times: int) -> None:
    spec = GridSpec.centred(size_m=(30.1, 20.3), resolution_m=0.05)
    once, grown = spec, growth_to(spec, (-times * TILE, 0, 1, 1))
    assert grown is not None
    for _ in range(times):
        growth = growth_to(once, (-1, 0, 1, 1))
        assert growth is not None
        once = growth.new
    assert once == grown.new
