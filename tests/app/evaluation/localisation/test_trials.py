"""The judgement of robots that are switched on anywhere, have a wrong map, or are carried away."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from app.evaluation.localisation import suite, trials
from app.evaluation.localisation.carried_away import carried_away
from app.evaluation.localisation.drives import Drive
from app.evaluation.localisation.pushed import pushed
from app.evaluation.localisation.recording import Recording, mirrored
from app.evaluation.localisation.replay import Run, keyframes_of
from app.evaluation.localisation.suite import MIRRORED, SAVED, LocalisationSuite, Site
from app.evaluation.localisation.trials import SavedMap, disturbed, started_in
from navcore.config.localisation.localisation import LocalisationConfig
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationState
from navcore.localisation.scans.scan import Keyframe
from navcore.localisation.tracking.scan_to_scan.push_search import PushSearch
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.beware_list import BewareList
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario
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


@pytest.mark.long
def test_switched_on_in_its_map_the_robot_is_right_and_in_a_mirrored_one_refused() -> None:
    run, keyframes, ids = toured()
    saved = SavedMap(keyframes=keyframes, poses=ids.array())
    turned = saved.mirrored()
    started = partial(started_in, run, config=NavigatorConfig(), count=2, searches=True)
    found = started(saved)
    assert found["right"] >= 1 and found["wrong"] == 0 and found["median_m"] <= 10.0
    assert started(turned, is_here=False)["refused"] == 2
    # The count can fail: what is found in a map that is said to be wrong is wrong.
    assert started(saved, is_here=False)["wrong"] == found["right"]


def test_keyframes_of_each_map_lie_at_its_own_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    run, keyframes, ids = toured()
    saved = SavedMap(keyframes=keyframes, poses=ids.array())
    elsewhere = saved.moved(Pose2(x_m=30.0, y_m=-20.0, yaw_rad=1.0))
    monkeypatch.setattr(suite, "load_scenario", lambda name: name)
    monkeypatch.setattr(LocalisationSuite, "recording", lambda _, world: world)
    monkeypatch.setattr(LocalisationSuite, "saved", lambda *_: elsewhere)
    measured = LocalisationSuite(
        grade=OdometryGrade.TYPICAL,
        episodes=1,
        seed=0,
        drives=Path("drives"),
        beware=BewareList(classes=()),
        config=NavigatorConfig(),
    )
    here = Site(
        suite=measured, scenario=load_scenario("empty_room"), first=run, second=run, saved=saved
    )
    maps = [here.map(which) for which in (SAVED, MIRRORED, "indoor")]
    for one in maps:
        for frame in one.keyframes:
            x_m, y_m, _ = one.poses[frame.pose_id]
            assert frame.T_map_base.distance_to(x_m, y_m) < 0.15
    assert len({one.poses.tobytes() for one in maps}) == 3


@pytest.mark.parametrize("state", LocalisationState)
def test_a_disturbed_robot_that_does_not_know_its_place_is_lost_wherever_it_is(
    state: LocalisationState, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, keyframes, ids = toured()
    still = np.zeros((1, 3))
    ended = Run(
        errors=still,
        odometry_errors=still,
        nees=still[:, 0],
        states=(state,),
        durations_s=still[:, 0],
        true_poses=still,
        loops=(0, 0),
    )
    monkeypatch.setattr(trials, "follow", lambda *_: ended)
    found = disturbed(run, SavedMap(keyframes=keyframes, poses=ids.array()), NavigatorConfig(), 1)
    is_known = state in (LocalisationState.LOCATED, LocalisationState.DEAD_RECKONING)
    assert [end["right"] for end in found.values()] == [int(is_known)] * 4
    assert [end["lost"] for end in found.values()] == [int(not is_known)] * 4


def test_a_map_that_is_mirrored_twice_is_the_map() -> None:
    _, saved, _ = toured()
    for once, twice in zip(saved, mirrored(mirrored(saved)), strict=True):
        assert once.T_map_base == twice.T_map_base
        np.testing.assert_array_equal(once.scan.points_base, twice.scan.points_base)


@pytest.mark.long
def test_a_robot_that_is_carried_through_its_saved_map_notices_and_one_that_is_not_does_not() -> (
    None
):
    run, keyframes, ids = toured()
    saved = SavedMap(keyframes=keyframes, poses=ids.array())
    found = carried_away(run, saved, NavigatorConfig(), 3)
    assert found["carried"] >= 3
    assert found["noticed"] + found["right_again"] >= found["carried"] - 1
    assert found["false_alarms"] == 0 and found["not_carried"] == 2


@pytest.mark.long
def test_pushes_in_a_new_map_are_counted_and_without_the_search_all_of_them_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run, _, _ = toured()
    found = pushed(run, NavigatorConfig(), 4)
    assert found["pushes"] == found["not_pushed"] == 4 and found["false"] == 0
    assert sum(found["told"]) >= 4
    monkeypatch.setattr(PushSearch, "find", lambda *_: None)
    control = pushed(run, NavigatorConfig(), 4)
    assert control["told"] == [0, 0, 0]
    for left_m, control_m, length_m in zip(
        found["left_m"], control["left_m"], found["lengths_m"], strict=True
    ):
        assert control_m == pytest.approx(length_m, rel=0.5)
        assert left_m <= control_m
