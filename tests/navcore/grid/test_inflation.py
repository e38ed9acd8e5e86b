"""Incremental inflation equals full inflation, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.bitplane import empty_plane, pack, unpack
from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import BoolGrid, inflate
from navcore.grid.inflation import InflatedGrid, inflated
from tests.navcore.grid.random_grids import grids, some_cells
from tests.navcore.grid.test_free_space import assert_same_space
from tests.navcore.laws import law

RADII = st.lists(
    st.one_of(st.integers(0, 12), st.integers(60, 70)), min_size=1, max_size=3, unique=True
)
SEEDS = st.integers(0, 2**32 - 1)


def fully_inflated(masks: dict[int, BoolGrid]) -> BoolGrid:
    """Return the reference, inflated by OpenCV."""
    blocked = np.zeros_like(next(iter(masks.values())))
    for radius, mask in masks.items():
        blocked |= inflate(mask, radius)
    return blocked


@law(60)
@given(grids(), RADII, SEEDS)
def test_layers_updated_by_cells_block_what_full_inflation_blocks(
    shape_of: BoolGrid, radii: list[int], seed: int
) -> None:
    generator, grid = np.random.default_rng(seed), InflatedGrid(*shape_of.shape)
    masks = {radius: np.zeros_like(shape_of) for radius in radii}
    for _ in range(3):
        for radius, mask in masks.items():
            cells, occupied = some_cells(generator, mask.shape, 6), bool(generator.random() < 0.6)
            grid.set_cells(radius, cells, occupied)
            mask[cells[:, 0], cells[:, 1]] = occupied
        np.testing.assert_array_equal(grid.space.blocked(), fully_inflated(masks))
    assert_same_space(grid.space, FreeSpace.of(fully_inflated(masks)))


@law(60)
@given(grids(), RADII, SEEDS)
def test_layers_updated_by_grids_block_what_full_inflation_blocks(
    first: BoolGrid, radii: list[int], seed: int
) -> None:
    generator, grid = np.random.default_rng(seed), InflatedGrid(*first.shape)
    masks = {radius: first & (generator.random(first.shape) < 0.05) for radius in radii}
    for share in (0.0, 0.0005, 0.002):
        masks = {
            radius: mask ^ (generator.random(first.shape) < share) for radius, mask in masks.items()
        }
        grid.update(masks)
        np.testing.assert_array_equal(grid.space.blocked(), fully_inflated(masks))
    assert_same_space(grid.space, FreeSpace.of(fully_inflated(masks)))


def test_a_radius_that_is_no_longer_named_blocks_nothing() -> None:
    grid, mask = InflatedGrid(40, 40), np.eye(40, dtype=np.bool_)
    grid.update({2: mask, 5: mask})
    grid.update({2: mask})
    np.testing.assert_array_equal(grid.space.blocked(), inflate(mask, 2))
    grid.update({})
    assert not grid.space.blocked().any()


def test_a_radius_that_was_tried_once_widens_no_later_change() -> None:
    grid, mask = InflatedGrid(300, 300), np.zeros((300, 300), dtype=np.bool_)
    mask[150, 150] = True
    grid.update({2: mask, 90: mask})
    grid.update({2: mask})
    grid.set_cells(2, np.array([[10, 10]]), True)
    mask[10, 10] = True
    np.testing.assert_array_equal(grid.space.blocked(), inflate(mask, 2))
    assert grid.reach == 2
    grid.update({2: mask, 5: mask})
    np.testing.assert_array_equal(grid.space.blocked(), inflate(mask, 5))
    assert grid.reach == 5


def test_a_mask_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected the grid's shape \(40, 40\), got \(40, 41\)"):
        InflatedGrid(40, 40).update({2: np.zeros((40, 41), dtype=np.bool_)})


@law(60)
@given(grids(), RADII)
def test_inflating_packed_cells_once_gives_the_same(mask: BoolGrid, radii: list[int]) -> None:
    rng = np.random.default_rng(len(radii))
    masks = {radius: mask & (rng.random(mask.shape) < 0.2) for radius in radii}
    planes = {}
    for radius, cells in masks.items():
        planes[radius] = empty_plane(*cells.shape)
        pack(cells, planes[radius])
    made = inflated(planes, *mask.shape)
    np.testing.assert_array_equal(unpack(made, *mask.shape), fully_inflated(masks))
    assert int(np.bitwise_count(made).sum()) == int(fully_inflated(masks).sum()), (
        "the padding is empty"
    )
