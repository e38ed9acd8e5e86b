"""The path moves away from obstacles too near to turn there, and otherwise stays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.planning import ElasticBandConfig
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec
from navcore.planning.elastic_band import relax
from tests.navcore.laws import law

SPEC = GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.05)
WANTED_M = 0.2
Points = npt.NDArray[np.float64]


def spaced(*corners: tuple[float, float]) -> Points:
    """Points every 5 cm along a line of corners."""
    ends = np.array(corners)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ends, axis=0).T))])
    stations = np.linspace(0.0, along[-1], round(along[-1] / 0.05) + 1)
    return np.column_stack([np.interp(stations, along, ends[:, axis]) for axis in (0, 1)])


def free_without(*boxes: tuple[float, float, float, float]) -> npt.NDArray[np.bool_]:
    """Free cells but for boxes (x from, x to, y from, y to), metres."""
    x, y = SPEC.centres(np.argwhere(np.ones((SPEC.rows, SPEC.cols)))).T
    free = np.ones(len(x), dtype=np.bool_)
    for left, right, low, high in boxes:
        free &= ~((left <= x) & (x <= right) & (low <= y) & (y <= high))
    return free.reshape(SPEC.rows, SPEC.cols)


def relaxed(track: Points, free: npt.NDArray[np.bool_], stretch_m: float = 8.0) -> Points:
    config = ElasticBandConfig(stretch_m=stretch_m)
    return relax(track, CellMask.of(free).plane, SPEC, wanted_m=WANTED_M, config=config)


def clearance_m(points: Points, free: npt.NDArray[np.bool_]) -> Points:
    taken = SPEC.centres(np.argwhere(~free))
    return np.asarray(np.hypot(*(points[:, None] - taken).transpose(2, 0, 1)).min(axis=1))


def test_in_the_open_the_track_stays_as_it_is() -> None:
    track = spaced((-3.0, -1.0), (2.0, 1.0), (3.0, 3.0))
    np.testing.assert_allclose(
        relaxed(spaced((-3.0, 1.0), (3.0, 2.0)), free_without()), spaced((-3.0, 1.0), (3.0, 2.0))
    )
    assert (
        np.abs(relaxed(track, free_without()) - track).max() < 0.3
    )  # but for its corner, which it cuts a little


def test_round_a_corner_it_keeps_the_clearance_that_is_wanted() -> None:
    free = free_without((-4.0, 0.0, -4.0, 0.0))
    track = spaced((-3.0, 0.06), (0.04, 0.06), (0.06, -3.0))
    moved = relaxed(track, free)
    assert clearance_m(track[5:-5], free).min() < 0.1
    assert clearance_m(moved[12:-12], free).min() > 0.8 * WANTED_M
    np.testing.assert_allclose(moved[[0, -1]], track[[0, -1]])


def test_it_passes_a_door_at_its_middle_and_at_a_right_angle() -> None:
    """The wall runs along y with a gap of 30 cm; the path on the grid passes by one post,
    slantwise, and turns off at once."""
    free = free_without((-0.1, 0.1, -4.0, -0.15), (-0.1, 0.1, 0.15, 4.0))
    track = spaced((-2.0, -0.6), (-0.13, -0.12), (0.13, -0.12), (0.14, -2.0))
    moved = relaxed(track, free)
    within = moved[np.abs(moved[:, 0]) < 0.1]
    assert np.abs(within[:, 1]).max() < 0.04
    along_the_wall = moved[(moved[:, 1] < -0.8) & (moved[:, 1] > -1.7)]
    assert len(along_the_wall) > 10 and clearance_m(along_the_wall, free).min() > 0.7 * WANTED_M


@pytest.mark.parametrize("stretch_m", [0.0, 0.05, 2.0])
def test_the_path_beyond_the_stretch_stays(stretch_m: float) -> None:
    free, track = free_without((-4.0, 4.0, -4.0, 0.0)), spaced((-3.0, 0.05), (3.0, 0.05))
    moved = relaxed(track, free, stretch_m=stretch_m)
    beyond = track[:, 0] > -3.0 + stretch_m + 0.1
    np.testing.assert_array_equal(moved[beyond], track[beyond])
    assert len(moved) == len(track)
    assert (np.abs(moved - track).max() > 0.05) == (stretch_m == 2.0)


@pytest.mark.parametrize("wanted_m", [0.0, -0.6])
def test_where_no_more_clearance_is_wanted_it_stays(wanted_m: float) -> None:
    free, track = (
        free_without((-4.0, 0.0, -4.0, 0.0)),
        spaced((-3.0, 0.06), (0.04, 0.06), (0.06, -3.0)),
    )
    np.testing.assert_array_equal(
        relax(track, CellMask.of(free).plane, SPEC, wanted_m=wanted_m), track
    )


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_it_never_leaves_the_free_cells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    free = np.ones((SPEC.rows, SPEC.cols), dtype=np.bool_)
    for row, col, high, wide in zip(
        *(rng.integers(0, n, 25) for n in (SPEC.rows, SPEC.cols, 20, 20)), strict=True
    ):
        free[row : row + high, col : col + wide] = False
    corners = rng.uniform(-3.9, 3.9, (4, 2))
    track = spaced(*map(tuple, corners))
    cells = np.floor((track - (SPEC.origin_x_m, SPEC.origin_y_m)) / SPEC.resolution_m).astype(int)
    free[cells[:, 1], cells[:, 0]] = True
    moved = relaxed(track, free)
    at = np.floor((moved - (SPEC.origin_x_m, SPEC.origin_y_m)) / SPEC.resolution_m).astype(int)
    assert free[at[:, 1], at[:, 0]].all()
    np.testing.assert_array_equal(moved, relaxed(track, free))


def test_a_robot_that_stands_where_no_path_may_be_is_led_out() -> None:
    free, track = free_without((-4.0, 0.0, -4.0, 0.4)), spaced((-1.0, 0.0), (-1.0, 0.5), (3.0, 0.5))
    moved = relaxed(track, free)
    np.testing.assert_array_equal(moved[0], track[0])
    assert clearance_m(moved[20:-12], free).min() > 0.5 * WANTED_M
