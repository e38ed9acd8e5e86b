"""What a stereo camera does not measure, and how exact the rest is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from sim.sensors.stereo_noise import PERFECT, StereoErrors, degrade_depth

FOCAL_PX = 220.0
BASELINE_M = PERFECT.baseline_m
STEP = np.full((6, 40), 3.0, dtype=np.float32)
"""A wall with something before it in the columns 20 to 29."""
STEP[:, 20:30] = 1.0


def degraded(depth_m: np.ndarray, errors: StereoErrors) -> np.ndarray:
    return degrade_depth(depth_m, FOCAL_PX, errors, np.random.default_rng(0))


def test_a_perfect_camera_measures_what_is_there() -> None:
    assert degraded(STEP, PERFECT) == pytest.approx(STEP, rel=1e-6)


def test_nothing_is_measured_beyond_the_range_or_too_near_to_be_matched() -> None:
    nearest_m = FOCAL_PX * BASELINE_M / PERFECT.largest_disparity_px
    depth_m = np.array([[0.9 * nearest_m, 1.1 * nearest_m, 5.9, 6.1]], dtype=np.float32)
    assert (degraded(depth_m, PERFECT) > 0).tolist() == [[False, True, True, False]]


def test_the_right_imager_does_not_see_what_is_hidden_to_the_left_of_something_near() -> None:
    hidden = degraded(STEP, dataclasses.replace(PERFECT, shadows=True)) == 0
    disparity = FOCAL_PX * BASELINE_M / np.array([1.0, 3.0])
    wide = int(disparity[0] - disparity[1])
    expected = [20 - wide <= j < 20 for j in range(40)]
    assert (hidden == expected).all()


def test_a_jump_of_disparity_is_not_measured_on_its_far_side_along_rows_and_columns() -> None:
    rims = dataclasses.replace(PERFECT, edge_px=2)
    beside = [j in (20, 21, 30, 31) for j in range(40)]
    assert ((degraded(STEP, rims) == 0) == beside).all()
    upright = degraded(np.ascontiguousarray(STEP.T), rims).T
    assert ((upright == 0) == beside).all()


def test_a_share_of_the_pixels_has_no_match() -> None:
    wall = np.full((200, 200), 3.0, dtype=np.float32)
    missing = degraded(wall, dataclasses.replace(PERFECT, speckle=0.1)) == 0
    assert missing.mean() == pytest.approx(0.1, abs=0.01)


def test_noise_grows_with_the_square_of_the_distance() -> None:
    noisy = dataclasses.replace(PERFECT, disparity_noise_px=0.08)
    spreads = []
    for depth_m in (1.5, 3.0):
        wall = np.full((200, 200), depth_m, dtype=np.float32)
        spreads.append(float((degraded(wall, noisy) - wall).std()))
    assert spreads[0] == pytest.approx(0.08 * 1.5**2 / (FOCAL_PX * BASELINE_M), rel=0.05)
    assert spreads[1] == pytest.approx(4 * spreads[0], rel=0.05)


def test_disparity_comes_in_steps() -> None:
    stepped = dataclasses.replace(PERFECT, disparity_step_px=0.5)
    depth_m = np.linspace(1.0, 5.0, 50, dtype=np.float32)[None]
    disparity = FOCAL_PX * BASELINE_M / degraded(depth_m, stepped)
    assert disparity * 2 == pytest.approx(np.round(disparity * 2), abs=1e-4)
