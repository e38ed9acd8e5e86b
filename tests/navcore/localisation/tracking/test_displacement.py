"""A robot that is not where its odometry has it, but beside it, or where the saved map is bent."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.scans.scan import Keyframe
from navcore.localisation.tracking.localiser import Localiser
from navcore.mapping.points.pose_ids import PoseIds
from tests.navcore.localisation.plan_worlds import drive, office
from tests.navcore.localisation.tracking.test_localiser import frame_at

WORLD = office(3)
ROUTE = drive([(1.5, 0.0), (12.0, 0.0)])
PUSHED = Pose2(x_m=-0.3, y_m=0.15, yaw_rad=0.08)
HALF = len(ROUTE) // 2
RIGHT_M = 0.15
"""As in the evaluation."""


def saved_map(bend: Pose2 = IDENTITY) -> list[Keyframe]:
    """The map of the corridor, whose second half is displaced by `bend`."""
    rng = np.random.default_rng(1)
    return [
        Keyframe(
            pose_id=k, T_map_base=bend @ pose if k > HALF else pose, scan=WORLD.scan(pose, rng)
        )
        for k, pose in enumerate(ROUTE)
    ]


def driven(saved: list[Keyframe], motion: Pose2) -> list[LocalisationEstimate]:
    """The estimates of a robot that drives along the corridor, and is pushed by `motion` at half of
    its way without its odometry noticing; it stands as long as a correction waits for that."""
    ids, rng = PoseIds(0.25, 10.0), np.random.default_rng(2)
    for keyframe in saved:
        ids.id_of(keyframe.T_map_base)
    robot, estimates = Localiser(ids, LocalisationConfig()), list[LocalisationEstimate]()
    robot.load(saved)
    for k, pose in enumerate(ROUTE):
        there = pose @ motion if k > HALF else pose
        estimates.append(robot.follow(frame_at(pose, len(estimates)), WORLD.scan(there, rng)))
        while robot.pending is not None:
            frame = frame_at(pose, len(estimates))
            estimates.append(robot.follow(frame, WORLD.scan(there, rng)))
    return estimates


def test_a_robot_that_is_pushed_corrects_its_place_without_being_lost() -> None:
    estimates = driven(saved_map(), PUSHED)
    told = [one.place_correction for one in estimates if one.place_correction is not None]
    assert [one.source for one in told] == [None]
    assert told[0].shift_m == pytest.approx(np.hypot(PUSHED.x_m, PUSHED.y_m), abs=0.1)
    assert all(one.is_known for one in estimates)
    end, last = ROUTE[-1] @ PUSHED, estimates[-1]
    assert last.state is LocalisationState.LOCATED
    assert last.T_map_base.distance_to(end.x_m, end.y_m) < RIGHT_M


def test_two_scans_with_a_gap_between_them_correct_no_place() -> None:
    ids, rng = PoseIds(0.25, 10.0), np.random.default_rng(2)
    for pose in ROUTE:
        ids.id_of(pose)
    robot, here = Localiser(ids, LocalisationConfig()), ROUTE[HALF]
    robot.load(saved_map())
    for k in range(10):
        robot.follow(frame_at(here, k), WORLD.scan(here, rng))
    told = []
    for k in (15, 21, 22, 23, 24):
        estimate = robot.follow(frame_at(here, k), WORLD.scan(here @ PUSHED, rng))
        told.append(estimate.place_correction is not None)
    assert told == [False, False, False, False, True]


def test_one_that_is_carried_far_is_lost() -> None:
    away = Pose2(x_m=-4.0, y_m=3.0, yaw_rad=2.0)
    estimates = driven(saved_map(), away)
    assert estimates[-1].state is LocalisationState.LOST
    assert not any(one.place_correction for one in estimates)


def test_where_the_saved_map_is_bent_the_robot_follows_it() -> None:
    bend = Pose2(x_m=0.1, y_m=0.4, yaw_rad=0.02)
    estimates = driven(saved_map(bend), IDENTITY)
    assert all(one.is_known for one in estimates)
    end = bend @ ROUTE[-1]
    assert estimates[-1].T_map_base.distance_to(end.x_m, end.y_m) < RIGHT_M


def test_nothing_is_corrected_where_the_scans_fit() -> None:
    assert not any(one.place_correction for one in driven(saved_map(), IDENTITY))
