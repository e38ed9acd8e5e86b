"""Cells, inflation and margins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from navcore.grid.grid import GridSpec, OccupancyGrid, inflate, inflate_layers, inflation_radius
from tests.navcore.laws import law

specs = st.builds(
    GridSpec,
    resolution_m=st.sampled_from([0.05, 0.1, 0.17, 1.0]),
    rows=st.integers(1, 2000),
    cols=st.integers(1, 2000),
    origin_x_m=st.floats(-100, 100),
    origin_y_m=st.floats(-100, 100),
)


@law(300)
@given(specs, st.data())
def test_the_centre_of_a_cell_is_in_that_cell(spec: GridSpec, data: st.DataObject) -> None:
    row, col = data.draw(st.integers(0, spec.rows - 1)), data.draw(st.integers(0, spec.cols - 1))
    assert spec.cell(*spec.centre(row, col)) == (row, col)
    assert spec.contains(*spec.centre(row, col))
    np.testing.assert_allclose(spec.centres(np.array([[row, col]])), [spec.centre(row, col)])


@law(300)
@given(specs, st.floats(-400, 400), st.floats(-400, 400))
def test_a_point_on_the_map_has_a_cell_on_the_grid_and_no_other_point_has(
    spec: GridSpec, x: float, y: float
) -> None:
    row, col = spec.cell(x, y)
    assert spec.contains(x, y) == (0 <= row < spec.rows and 0 <= col < spec.cols)


def test_the_last_point_inside_the_border_has_a_cell_on_the_grid() -> None:
    for resolution_m in (0.05, 0.1, 0.17):
        for cells in range(1, 2000):
            spec = GridSpec(
                resolution_m=resolution_m, rows=1, cols=cells, origin_x_m=0.0, origin_y_m=0.0
            )
            x_m = math.nextafter(cells * resolution_m, 0.0)
            assert not spec.contains(x_m, 0.0) or spec.cell(x_m, 0.0)[1] < cells, (
                f"{cells} cells of {resolution_m} m"
            )


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_no_point_that_is_not_finite_is_on_the_map(value: float) -> None:
    spec = GridSpec.centred(size_m=(10, 10), resolution_m=0.1)
    assert not spec.contains(value, 0.0)
    assert not spec.contains(0.0, value)
    assert spec.contains(0.0, 0.0)


@law(200)
@given(st.floats(-49.9, 49.9), st.floats(-29.9, 29.9))
def test_a_centred_grid_is_the_papers_formula(x: float, y: float) -> None:
    """The paper: (u, v) = ⌊(x, y) / r_g⌋ + (W, H) / 2, marked M(v, u)."""
    spec = GridSpec.centred(size_m=(100.0, 60.0), resolution_m=0.5)
    assert (spec.cols, spec.rows) == (200, 120)
    assume(min(abs(x / 0.5 - round(x / 0.5)), abs(y / 0.5 - round(y / 0.5))) > 1e-9)
    u, v = math.floor(x / 0.5) + 200 // 2, math.floor(y / 0.5) + 120 // 2
    assert spec.cell(x, y) == (v, u)


@pytest.mark.parametrize(
    ("side", "resolution", "cells"),
    [(100, 0.1, 1000), (150, 0.05, 3000), (2.2, 0.1, 22), (4.4, 0.1, 44)],
)
def test_a_centred_grid_is_as_large_as_asked(side: float, resolution: float, cells: int) -> None:
    assert GridSpec.centred(size_m=(side, side), resolution_m=resolution).cols == cells


@pytest.mark.parametrize(
    ("width", "margin", "resolution", "cells"),
    [
        (0.7, 0.1, 0.05, 9),
        (0.7, 0.1, 0.1, 5),
        (0.67, 0.1, 0.1, 5),
        (0.7, 0.15, 0.1, 5),
        (0.7, 0.151, 0.1, 6),
        (0.0, 0.0, 0.1, 0),
    ],
)
def test_the_inflation_radius_is_the_papers(
    width: float, margin: float, resolution: float, cells: int
) -> None:
    assert (
        inflation_radius(vehicle_width_m=width, safety_margin_m=margin, resolution_m=resolution)
        == cells
    )


@law(60)
@given(
    st.integers(1, 24),
    st.integers(1, 24),
    st.integers(0, 7),
    st.sampled_from([0.01, 0.05, 0.3]),
    st.integers(0, 2**32 - 1),
)
def test_inflation_is_the_disc_around_every_marked_cell(
    rows: int, cols: int, radius: int, share: float, seed: int
) -> None:
    mask = np.random.default_rng(seed).random((rows, cols)) < share
    expected = np.zeros_like(mask)
    for row, col in np.argwhere(mask):
        y, x = np.ogrid[:rows, :cols]
        expected |= (y - row) ** 2 + (x - col) ** 2 <= radius**2
    before = mask.copy()
    np.testing.assert_array_equal(inflate(mask, radius), expected)
    np.testing.assert_array_equal(mask, before)


def occupancy(seed: int, margin_m: float, wide_m: float | None) -> OccupancyGrid:
    rng = np.random.default_rng(seed)
    geometric, first, second, zone, wide = (rng.random((40, 40)) < 0.003 for _ in range(5))
    return OccupancyGrid(
        spec=GridSpec.centred(size_m=(4, 4), resolution_m=0.1),
        geometric=geometric,
        beware={1: first, 2: second},
        margins_m={1: margin_m, 2: 0.0},
        zones=zone if wide_m else zone | wide,
        wide_zones=((wide_m, wide),) if wide_m else (),
    )


@law(40)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1), st.floats(0, 1))
def test_blocked_is_every_layer_inflated_by_the_robot_and_its_own_margin(
    seed: int, margin_m: float, wide_m: float
) -> None:
    grid = occupancy(seed, margin_m, wide_m)

    def grown(extra_m: float) -> int:
        return math.ceil((0.35 + (0.1 + extra_m)) / 0.1 - 1e-9)

    expected = inflate(grid.geometric | grid.zones | grid.beware[2], 5) | inflate(
        grid.beware[1], grown(margin_m)
    )
    for room_m, mask in grid.wide_zones:
        expected |= inflate(mask, grown(room_m))
    np.testing.assert_array_equal(
        inflate_layers(grid, vehicle_width_m=0.7, safety_margin_m=0.1), expected
    )


@law(40)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1), st.floats(0, 1))
def test_a_wider_margin_frees_no_cell_and_leaves_the_layers_as_they_were(
    seed: int, margin_m: float, more_m: float
) -> None:
    narrow, wide = (
        occupancy(seed, margin_m, margin_m or None),
        occupancy(seed, margin_m + more_m, margin_m + more_m or None),
    )
    blocked = inflate_layers(narrow, vehicle_width_m=0.7, safety_margin_m=0.1)
    assert not (blocked & ~inflate_layers(wide, vehicle_width_m=0.7, safety_margin_m=0.1)).any()
    np.testing.assert_array_equal(narrow.geometric, occupancy(seed, 0.0, None).geometric)
    np.testing.assert_array_equal(narrow.beware[1], occupancy(seed, 0.0, None).beware[1])


def test_a_margin_of_half_a_metre_blocks_half_a_metre_more() -> None:
    """Control: the law above would hold for margins that do nothing."""
    empty, one = np.zeros((40, 40), dtype=np.bool_), np.zeros((40, 40), dtype=np.bool_)
    one[20, 20] = True
    spec = GridSpec.centred(size_m=(4, 4), resolution_m=0.1)
    for margin_m, reach in ((0.0, 5), (0.5, 10)):
        grid = OccupancyGrid(
            spec=spec, geometric=empty, beware={3: one}, margins_m={3: margin_m}, zones=empty
        )
        row = inflate_layers(grid, vehicle_width_m=0.7, safety_margin_m=0.1)[20]
        assert np.flatnonzero(row).tolist() == list(range(20 - reach, 21 + reach))


def test_occupied_is_the_union_of_all_plain_layers() -> None:
    grid = occupancy(7, 0.2, None)
    np.testing.assert_array_equal(
        grid.occupied(), grid.geometric | grid.zones | grid.beware[1] | grid.beware[2]
    )
