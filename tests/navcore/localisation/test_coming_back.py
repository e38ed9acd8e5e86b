"""A robot that comes back to a map, or whose gyro drifts at standstill."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.localisation import Localisation
from navcore.localisation.scans.scan import Scan
from navcore.localisation.tasks import PrepareSearch, SearchPlaces
from navcore.robot.profile import HUSKY
from tests.navcore.localisation.starts import ROUTE, WORLD, kept_map, started
from tests.navcore.localisation.tracking.test_localiser import frame_at

DRIFT_RAD = 0.0007
"""Turn of a gyro between two frames of a robot that stands, radians."""


def stands_in_drift(robot: Localisation, scan: Scan, k: int) -> tuple[Pose2, int]:
    """The pose by odometry and the number of frames after a robot has stood for 200 frames more."""
    pose = ROUTE[40]
    for _ in range(200):
        pose, k = pose @ Pose2(x_m=0.0, y_m=0.0, yaw_rad=DRIFT_RAD), k + 1
        robot.follow(frame_at(pose, k), scan)
    return pose, k


def test_the_gyros_drift_at_standstill_is_no_turn_for_the_search_beside_the_start() -> None:
    localisation, scan, _ = started()
    prepare = localisation.next_task()
    assert isinstance(prepare, PrepareSearch)
    localisation.take(prepare.run(lambda: False))
    pose, k = stands_in_drift(localisation, scan, 10)
    estimate = localisation.follow(frame_at(pose, k + 1), scan)
    search = localisation.next_task()
    assert isinstance(search, SearchPlaces)
    assert search.task.given is not None
    assert abs(search.task.given.yaw_rad - estimate.T_map_base.yaw_rad) < 0.01


def test_a_robot_that_comes_back_to_a_map_is_not_turned_by_the_gyros_drift_meanwhile() -> None:
    localisation, scan, before = started()
    localisation.load(())
    pose, k = stands_in_drift(localisation, scan.emptied(), 10)
    localisation.load(kept_map()[1], kept=before)
    estimate = localisation.follow(frame_at(pose, k + 1), scan.emptied())
    assert abs(estimate.T_map_base.yaw_rad - before.T_map_base.yaw_rad) < 0.01


def comes_back(driven_m: float) -> tuple[LocalisationEstimate, LocalisationEstimate]:
    """The estimates of before and after a robot has used another map, in which it has driven, by
    half of it forth and by half of it back."""
    localisation, scan, before = started()
    localisation.load(())
    step_m, start = 0.1, before.T_map_odom.inverse() @ before.T_map_base
    forth = [k * step_m for k in range(round(driven_m / 2 / step_m) + 1)]
    for number, x_m in enumerate([*forth, *forth[::-1]]):
        pose = start @ Pose2(x_m=-x_m, y_m=0.0, yaw_rad=0.0)
        localisation.follow(frame_at(pose, 100 + number), scan.emptied())
    localisation.load(kept_map()[1], kept=before)
    return before, localisation.follow(frame_at(pose, 101 + number), scan.emptied())


def test_a_robot_that_comes_back_to_a_map_is_as_uncertain_as_it_has_become_by_its_way() -> None:
    for driven_m in (1.0, 8.0):
        before, after = comes_back(driven_m)
        assert after.is_known
        assert after.sigma_m == pytest.approx(
            math.hypot(before.sigma_m, 0.02 * driven_m), abs=0.012 * math.sqrt(driven_m) + 0.02
        )


def test_after_a_long_way_its_place_is_checked_as_that_of_a_start() -> None:
    _, after = comes_back(40.0)
    assert after.state is LocalisationState.CHECKING


def test_the_place_that_an_operator_shows_counts_before_a_kept_one() -> None:
    ids, keyframes = kept_map()
    localisation = Localisation(ids, LocalisationConfig(), HUSKY.depth_sensor)
    localisation.load(keyframes, kept=LocalisationEstimate())
    shown, frame = ROUTE[40], frame_at(ROUTE[40], 0)
    localisation.place(shown, 0.01 * np.eye(3), frame)
    estimate = localisation.follow(frame, WORLD.scan(shown, np.random.default_rng(2)))
    assert estimate.T_map_base.distance_to(shown.x_m, shown.y_m) < 0.05
