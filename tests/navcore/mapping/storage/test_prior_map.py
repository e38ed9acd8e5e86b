"""Prior map on the navigator's grid: every cell that an occupied pixel touches, and no other."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadGeometry
from navcore.formats.nav2_map import Nav2Map, State, map_from_cells
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.storage.prior_map import prior_layer
from tests.navcore.laws import law


def brute_layer(
    source: Nav2Map, spec: tuple[Fraction, ...], grid: GridSpec, place: tuple[Fraction, ...]
) -> BoolGrid:
    """Return the cells whose open square meets that of an occupied pixel, in exact arithmetic;
    (side, x, y) of map and grid."""
    occupied, layer = source.cells(State.OCCUPIED), np.zeros((grid.rows, grid.cols), dtype=np.bool_)
    for (row, col), (i, j) in itertools.product(
        np.ndindex(layer.shape), np.argwhere(occupied).tolist()
    ):
        (side, x, y), (pixel, px, py) = place, spec
        over_x = x + col * side < px + (j + 1) * pixel and px + j * pixel < x + (col + 1) * side
        over_y = y + row * side < py + (i + 1) * pixel and py + i * pixel < y + (row + 1) * side
        layer[row, col] |= over_x and over_y
    return layer


SIDES = st.sampled_from(["0.02", "0.03", "0.05", "0.07", "0.1", "0.13"])
STEPS = st.integers(-30, 30)


@law(80)
@given(SIDES, SIDES, STEPS, STEPS, st.integers(0, 2**32 - 1))
def test_a_prior_map_occupies_every_cell_that_an_occupied_pixel_covers_and_no_other(
    pixel: str, side: str, right: int, up: int, seed: int
) -> None:
    origin, offset = (
        (Fraction("-1.37"), Fraction("2.11")),
        (Fraction(right, 100), Fraction(up, 100)),
    )
    place = (Fraction(side), origin[0] + offset[0], origin[1] + offset[1])
    source = GridSpec(resolution_m=float(pixel), rows=5, cols=6, origin_x_m=-1.37, origin_y_m=2.11)
    grid = GridSpec(
        resolution_m=float(side),
        rows=6,
        cols=5,
        origin_x_m=float(place[1]),
        origin_y_m=float(place[2]),
    )
    occupied = np.random.default_rng(seed).random((5, 6)) < 0.3
    prior = map_from_cells(occupied=occupied, known=np.ones_like(occupied), spec=source)
    expected = brute_layer(prior, (Fraction(pixel), *origin), grid, place)
    try:
        layer = prior_layer(prior, grid)
    except BadGeometry:
        assert not expected.any()
        return
    np.testing.assert_array_equal(layer, expected)
    assert not layer.flags.writeable


def test_a_prior_map_on_the_same_grid_is_the_same_layer() -> None:
    spec = GridSpec.centred(size_m=(9.0, 7.0), resolution_m=0.05)
    occupied: npt.NDArray[np.bool_] = np.random.default_rng(1).random((spec.rows, spec.cols)) < 0.2
    np.testing.assert_array_equal(
        prior_layer(map_from_cells(occupied=occupied, known=occupied, spec=spec), spec), occupied
    )


def test_a_prior_map_without_overlap_is_refused_with_both_extents() -> None:
    cells = np.ones((4, 4), dtype=np.bool_)
    prior = map_from_cells(
        occupied=cells,
        known=cells,
        spec=GridSpec(resolution_m=1.0, rows=4, cols=4, origin_x_m=100.0, origin_y_m=0.0),
    )
    with pytest.raises(BadGeometry, match=r"x 100 to 104 m.*x -5 to 5 m"):
        prior_layer(prior, GridSpec.centred(size_m=(10.0, 10.0), resolution_m=0.5))
