"""How uncertain the filter's pose has become relative to where it was."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.geometry.arrays import Floats
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.tracking.pose_filter import PoseFilter

DRIFTED_M, FIX_M = 0.3, 0.05
DRIFTED = np.diag([DRIFTED_M, DRIFTED_M, 0.01]) ** 2
FIX = FIX_M**2 * np.eye(2)


def relative(own: PoseFilter) -> Floats:
    return np.asarray(own.covariance_by_motion[:2, :2] + own.offset)


def fixed(own: PoseFilter, measured: Floats) -> None:
    """Fuse a measured position."""
    residual = measured - np.array([own.pose.x_m, own.pose.y_m])
    own.fuse_position(residual, np.eye(3)[:2], FIX)


def test_relative_to_where_it_was_the_pose_errs_by_what_a_fix_has_moved_it() -> None:
    """What was drawn beside the robot before the fix stays where it was drawn."""
    rng, apart = np.random.default_rng(4), []
    for _ in range(400):
        own = PoseFilter(IDENTITY)
        true = DRIFTED_M * rng.standard_normal(2)  # the estimate is at the origin
        own.place(IDENTITY, DRIFTED)
        before = relative(own)
        fixed(own, true + FIX_M * rng.standard_normal(2))
        apart.append((own.pose.x_m, own.pose.y_m))
    told = relative(own) - before
    np.testing.assert_allclose(np.cov(np.array(apart).T), told, atol=0.015)
    assert np.sqrt(told[0, 0]) == pytest.approx(DRIFTED_M, rel=0.05)
    np.testing.assert_allclose(own.moved, told, atol=1e-3)


def test_a_pose_that_is_set_is_as_uncertain_relative_to_before_as_it_has_jumped() -> None:
    own = PoseFilter(IDENTITY)
    own.place(IDENTITY, DRIFTED)
    before, moved = relative(own), own.moved
    own.place(Pose2(x_m=2.0, y_m=0.0, yaw_rad=0.0), 1e-4 * np.eye(3))
    assert np.sqrt((relative(own) - before)[0, 0]) == pytest.approx(2.0, rel=0.05)
    assert np.sqrt((own.moved - moved)[0, 0]) == pytest.approx(2.0, rel=0.05)


def test_a_correction_of_map_and_pose_together_adds_nothing() -> None:
    own = PoseFilter(IDENTITY)
    own.place(IDENTITY, DRIFTED)
    before, moved = relative(own), own.moved
    own.place(IDENTITY, 1e-4 * np.eye(3), with_map=True)
    np.testing.assert_allclose(relative(own), before, atol=1e-6)
    np.testing.assert_allclose(own.moved, moved)


def test_a_push_counts_as_a_motion_that_odometry_has_not_told() -> None:
    own = PoseFilter(IDENTITY)
    spread = np.diag([0.02, 0.03, 0.01]) ** 2
    own.push(Pose2(x_m=0.2, y_m=0.0, yaw_rad=0.0), spread)
    np.testing.assert_allclose(own.moved, spread[:2, :2])
    np.testing.assert_allclose(own.offset, 0.0)
