"""Odometry of the last second: the motion since a stamp."""

from __future__ import annotations

import pytest

from navcore.geometry.transform import Pose2
from navcore.localisation.tracking.recent_odometry import LIFE_NS, RecentOdometry

PERIOD_NS = 200_000_000


def driven(frames: int) -> RecentOdometry:
    """Odometry of a robot that drives 0.2 m from each frame to the next."""
    odometry = RecentOdometry()
    for k in range(frames):
        odometry.add(Pose2(x_m=0.2 * k, y_m=0.0, yaw_rad=0.0), k * PERIOD_NS)
    return odometry


def test_between_two_frames_the_way_is_interpolated_and_after_the_last_there_is_none() -> None:
    odometry = driven(20)
    for age, way_m in ((0.0, 0.0), (0.5, 0.1), (1.0, 0.2), (2.25, 0.45), (-1.0, 0.0)):
        motion = odometry.since(round((19 - age) * PERIOD_NS))
        assert motion is not None
        assert motion.x_m == pytest.approx(way_m)


def test_a_second_is_kept_and_nothing_from_before_a_clock_was_set_back() -> None:
    odometry = driven(20)
    assert odometry.since(19 * PERIOD_NS - LIFE_NS) is not None
    assert odometry.since(18 * PERIOD_NS - LIFE_NS) is None
    odometry.add(Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), 5 * PERIOD_NS)
    assert odometry.since(4 * PERIOD_NS) is None
