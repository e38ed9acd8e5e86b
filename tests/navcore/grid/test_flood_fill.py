"""Flood fill on packed bits reaches what OpenCV calls connected, and `beside` one step more."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.bitplane import (
    PAD,
    BitPlane,
    cells_of,
    contains,
    empty_plane,
    pack,
    plane_of,
    unpack,
)
from navcore.grid.flood_fill import are_separate, beside, flood
from navcore.grid.grid import BoolGrid
from tests.kernels import from_python
from tests.navcore.grid.random_grids import grids
from tests.navcore.laws import law

call_are_separate = from_python(are_separate)
call_beside = from_python(beside)

SEEDS = st.integers(0, 2**32 - 1)


def packed(mask: BoolGrid) -> BitPlane:
    plane = empty_plane(*mask.shape)
    pack(mask, plane)
    return plane


@law(100)
@given(grids(), SEEDS)
def test_a_flood_reaches_what_is_connected_with_where_it_begins(free: BoolGrid, seed: int) -> None:
    begin = np.random.default_rng(seed).random(free.shape) < 3 / free.size
    reached = np.zeros_like(packed(free))
    flood(packed(free), reached, packed(begin))
    _, regions = cv2.connectedComponents(free.view(np.uint8), connectivity=4)
    wanted = np.isin(regions, np.unique(regions[begin & free])) & free
    np.testing.assert_array_equal(unpack(reached, *free.shape), wanted | begin)
    # What is added later goes on from there, and from nowhere else.
    more = np.random.default_rng(seed + 1).random(free.shape) < 3 / free.size
    flood(packed(free), reached, packed(more))
    wanted |= np.isin(regions, np.unique(regions[more & free])) & free
    np.testing.assert_array_equal(unpack(reached, *free.shape), wanted | begin | more)


@law(50)
@given(grids(), SEEDS)
def test_two_cells_are_separate_if_they_lie_in_two_regions(free: BoolGrid, seed: int) -> None:
    cells = np.argwhere(free)
    if not len(cells):
        return
    one, other = np.random.default_rng(seed).choice(cells, 2)
    ends = (int(one[0]) + PAD, int(one[1]) + PAD), (int(other[0]) + PAD, int(other[1]) + PAD)
    _, regions = cv2.connectedComponents(free.view(np.uint8), connectivity=4)
    apart = bool(regions[tuple(one)] != regions[tuple(other)])
    assert call_are_separate(packed(free), *ends, free.size) == apart
    # What a few sweeps do not tell may be connected.
    assert apart or not call_are_separate(packed(free), *ends, 1)


def test_a_long_winding_corridor_is_flooded_to_its_end() -> None:
    free = np.ones((65, 200), dtype=np.bool_)
    free[1::4, :-1] = free[3::4, 1:] = False
    reached = np.zeros_like(packed(free))
    flood(packed(free), reached, plane_of((64, 199), like=reached))
    np.testing.assert_array_equal(unpack(reached, *free.shape), free)


@law(60)
@given(grids())
def test_beside_are_the_cells_one_straight_step_away(cells: BoolGrid) -> None:
    framed = np.pad(cells, 1)
    wanted = framed[:-2, 1:-1] | framed[2:, 1:-1] | framed[1:-1, :-2] | framed[1:-1, 2:]
    np.testing.assert_array_equal(unpack(call_beside(packed(cells)), *cells.shape), wanted)


@law(60)
@given(grids())
def test_the_cells_of_a_plane_are_those_it_was_packed_from(cells: BoolGrid) -> None:
    plane = packed(cells)
    np.testing.assert_array_equal(cells_of(plane), np.argwhere(cells))
    for row, col in np.argwhere(cells)[:5].tolist():
        assert contains(plane, (row, col))
        np.testing.assert_array_equal(cells_of(plane_of((row, col), like=plane)), [[row, col]])
    for row, col in np.argwhere(~cells)[:5].tolist():
        assert not contains(plane, (row, col))
