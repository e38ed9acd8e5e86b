"""Polylines: points along them against numpy's interpolation."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.geometry.polyline import length_m, metres_along, points_at, resample, subdivided
from tests.navcore.laws import law

SEEDS = st.integers(0, 2**32 - 1)


@law(60)
@given(SEEDS, st.integers(1, 12))
def test_points_at_stations_are_those_that_numpy_interpolates(seed: int, corners: int) -> None:
    generator = np.random.default_rng(seed)
    line = generator.uniform(-3, 3, (corners, 2))
    line = np.repeat(line, generator.integers(1, 3, corners), axis=0)  # a corner may come twice
    metres = metres_along(line)
    np.testing.assert_array_equal(
        metres, np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    )
    stations = np.sort(np.concatenate([generator.uniform(-1, metres[-1] + 1, 20), metres]))
    expected = np.column_stack([np.interp(stations, metres, line[:, axis]) for axis in (0, 1)])
    np.testing.assert_allclose(points_at(line, metres, stations), expected, rtol=0, atol=1e-12)


def test_even_points_keep_the_ends_and_are_no_farther_apart_than_asked_for() -> None:
    line = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.55]])
    points = resample(line, 0.1)
    np.testing.assert_array_equal(points[[0, -1]], line[[0, -1]])
    assert len(points) == 17
    assert np.hypot(*np.diff(points, axis=0).T).max() <= 0.1 + 1e-12


def test_a_line_of_one_point_is_that_point_twice() -> None:
    np.testing.assert_array_equal(resample(np.array([[2.0, 3.0]]), 0.1), [[2.0, 3.0]] * 2)


def test_the_length_is_the_arc_length_at_the_last_point() -> None:
    line = np.random.default_rng(3).normal(size=(50, 2))
    assert length_m(line) == pytest.approx(metres_along(line)[-1])
    assert length_m(line[:1]) == 0.0


@law(60)
@given(SEEDS, st.integers(1, 12))
def test_a_subdivided_line_keeps_its_points_and_is_even_on_each_segment(
    seed: int, corners: int
) -> None:
    line = np.random.default_rng(seed).uniform(-3, 3, (corners, 2))
    points, at = subdivided(line, 0.3)
    np.testing.assert_array_equal(points[at], line)
    steps = np.hypot(*np.diff(points, axis=0).T)
    assert steps.max(initial=0.0) <= 0.3 + 1e-9
    for first, last in pairwise(at):
        np.testing.assert_allclose(steps[first:last], steps[first])
    assert length_m(points) == pytest.approx(length_m(line))
