"""The judgement of robots that are switched on anywhere, have a wrong map, or are carried away."""

from __future__ import annotations

from functools import cache

import numpy as np

from app.evaluation.localisation.drives import Drive
from app.evaluation.localisation.relocalisation import (
    Recording,
    carried_away,
    mirrored,
    place_map,
    switched_on,
)
from app.evaluation.localisation.replay import keyframes_of
from navcore.config.localisation.localisation import LocalisationConfig
from navcore.localisation.scans.scan import Keyframe
from navcore.mapping.points.pose_ids import PoseIds
from sim.robot.odometry_grade import OdometryGrade
from tests.navcore.localisation.plan_worlds import office, tour

CONFIG = LocalisationConfig()
ROOMS = 3


@cache
def toured() -> tuple[Recording, tuple[Keyframe, ...], PoseIds]:
    """A tour of an office and the map made on it."""
    world, rng = office(1, rooms=ROOMS), np.random.default_rng(5)
    poses = tour(1, rooms=ROOMS)
    drive = Drive(
        stamps_ns=tuple((k + 1) * 200_000_000 for k in range(len(poses))),
        by_odometry=tuple(poses),
        pitch_rad=(0.0,) * len(poses),
        true_poses=tuple(poses),
        scans=tuple(world.scan(pose, rng) for pose in poses),
    )
    run = Recording(drive=drive, grade=OdometryGrade.TYPICAL, seed=0)
    ids = PoseIds(0.1, 10.0)
    return run, keyframes_of(drive, ids, CONFIG), ids


def test_switched_on_in_its_map_the_robot_is_right_and_in_a_mirrored_one_refused() -> None:
    run, saved, _ = toured()
    here, rules = place_map(saved, CONFIG), CONFIG.relocalisation
    found = switched_on(run, here, rules, 2, is_here=True)
    assert found["right"] >= 1 and found["wrong"] == 0 and found["median_m"] <= 10.0
    wrong = switched_on(run, place_map(mirrored(saved), CONFIG), rules, 2, is_here=False)
    assert wrong["wrong"] == 0 and wrong["refused"] == 2
    # The count can fail: what is found in a map that is said to be wrong is wrong.
    assert switched_on(run, here, rules, 2, is_here=False)["wrong"] == found["right"]


def test_a_map_that_is_mirrored_twice_is_the_map() -> None:
    _, saved, _ = toured()
    for once, twice in zip(saved, mirrored(mirrored(saved)), strict=True):
        assert once.T_map_base == twice.T_map_base
        np.testing.assert_array_equal(once.scan.points_base, twice.scan.points_base)


def test_a_robot_that_is_carried_through_its_saved_map_notices_and_one_that_is_not_does_not() -> (
    None
):
    run, saved, ids = toured()
    found = carried_away(run, saved, CONFIG, ids, 2)
    assert found["carried"] >= 3
    assert found["noticed"] + found["right_again"] >= found["carried"] - 1
    assert found["false_alarms"] == 0 and found["not_carried"] == 2
