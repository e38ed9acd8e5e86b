"""A robot that is switched on elsewhere in its map than it believes stands until it knows where it
is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.console.site.place_editor import UNCHECKED
from app.episode.episode import Episode, EpisodeSettings
from app.runtime.record.map_persistence import load_map, save_map
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import Pose2, Twist
from navcore.localisation.scans.keyframe_store import stored
from navcore.localisation.start_check import Probation, StartCheck
from navcore.mapping.storage import map_file
from navcore.mapping.storage.map_state import MapState
from navcore.mission.beware_list import NOTHING, default_beware_list
from navcore.navigator import TickResult
from navcore.toml_config import from_table
from sim.scenario.load import load_scenario

BEWARE = default_beware_list()
DEFAULT = NavigatorConfig()
OFFICE = load_scenario("office")
CONFIRMED = np.diag([0.01, 0.01, 0.001])


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Pose2]:
    """The map of a short drive, and a place on the way."""
    first = Episode(OFFICE, EpisodeSettings(beware=BEWARE, max_time_s=14.0), seed=3)
    try:
        first.run()
        path = tmp_path_factory.mktemp("map") / "map.npz"
        save_map(first.controller.navigator.map, BEWARE, path)
        x_m, y_m = first.driven[len(first.driven) // 2]
        assert Pose2(x_m=x_m, y_m=y_m, yaw_rad=0.0).distance_to(*OFFICE.start[:2]) > 1.5
        return path, Pose2(x_m=x_m, y_m=y_m, yaw_rad=OFFICE.start_pose.yaw_rad + 1.0)
    finally:
        first.close()


def driven_m(
    kept: tuple[Path, Pose2],
    *,
    start: Pose2 | None,
    knows_scans: bool = True,
    last: Pose2 | None = None,
    max_time_s: float = 6.0,
) -> float:
    """Return how far the robot goes in some seconds of a mission in the kept map; its odometry says
    that it stands at the start of the world. `last`: where it stood at the end of the session
    before."""
    path, _ = kept
    settings = EpisodeSettings(
        beware=BEWARE, start=start, odometry_origin=OFFICE.start_pose, max_time_s=max_time_s
    )
    episode = Episode(OFFICE, settings, seed=3)
    try:
        navigator = episode.controller.navigator
        load_map(navigator.map, BEWARE, prior=None, kept=path)
        if not knows_scans:
            navigator.map.scans = lambda: stored(())
        navigator.adopt_map(last)
        episode.run()
        stood_there = last is not None and last == start
        assert navigator.place.is_known == (start is None or stood_there or not knows_scans)
        if navigator.place.is_known and knows_scans:
            true = episode.simulator.true_pose()
            assert navigator.place.T_map_base.distance_to(true.x_m, true.y_m) < 0.15
        return episode.simulator.referee.distance_m
    finally:
        episode.close()


def test_elsewhere_the_robot_stands_and_where_it_believes_to_be_it_drives(
    kept: tuple[Path, Pose2],
) -> None:
    assert driven_m(kept, start=kept[1]) < 0.05
    assert driven_m(kept, start=None) > 0.5


def test_where_it_stood_at_the_end_of_the_session_before_it_knows_its_place_again(
    kept: tuple[Path, Pose2],
) -> None:
    _, place = kept
    other = Pose2(x_m=place.x_m, y_m=place.y_m, yaw_rad=place.yaw_rad + 2.0)
    assert driven_m(kept, start=place, last=place, max_time_s=9.0) > 0.5
    assert driven_m(kept, start=place, last=other, max_time_s=9.0) < 0.05


def test_without_its_scans_the_robot_would_drive_off(kept: tuple[Path, Pose2]) -> None:
    assert driven_m(kept, start=kept[1], knows_scans=False) > 0.5


def seen_from(place: Pose2, path: Path, config: NavigatorConfig = DEFAULT) -> Episode:
    """An episode in the kept map whose robot stands at a place and has had a second to find that it
    stands at the start of the world."""
    settings = EpisodeSettings(
        beware=BEWARE,
        start=place,
        odometry_origin=OFFICE.start_pose,
        max_time_s=15.0,
        config=config,
    )
    episode = Episode(OFFICE, settings, seed=3)
    load_map(episode.controller.navigator.map, BEWARE, prior=None, kept=path)
    episode.controller.navigator.adopt_map()
    episode.observe(1.0)
    return episode


def contents(episode: Episode) -> MapState:
    return episode.controller.navigator.map.state()


@pytest.mark.parametrize("ends", ["the operator shows the place", "the place is given up"])
def test_what_was_seen_from_a_wrong_place_is_taken_back(
    kept: tuple[Path, Pose2], ends: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, place = kept
    saved = map_file.load(path).state
    monkeypatch.setattr(StartCheck, "after", lambda *_, **__: True)  # believes any place at once
    episode = seen_from(place, path)
    try:
        navigator = episode.controller.navigator
        wrong = contents(episode)
        assert navigator.map_is_on_trial
        assert not np.array_equal(wrong.points.points_map, saved.points.points_map)
        told: list[TickResult] = []
        episode.on_decision = lambda _, decision: told.append(decision)
        if ends == "the operator shows the place":
            episode.observe(episode.now_s + 0.2)
            navigator.place_robot(place, np.diag([0.01, 0.01, 0.001]), told[-1].frame)
        else:
            navigator.localisation.search(stamp_ns=0)
            episode.observe(episode.now_s + 0.5)
            assert sum(decision.taken_back for decision in told) == 1
        found = contents(episode)
        np.testing.assert_array_equal(found.poses, saved.poses)
        for name in ("points_map", "class_ids", "pose_ids"):
            np.testing.assert_array_equal(getattr(found.points, name), getattr(saved.points, name))
        np.testing.assert_array_equal(found.visible.bools, saved.visible.bools)
        np.testing.assert_array_equal(found.scans.pose_ids, saved.scans.pose_ids)
    finally:
        episode.close()


def points_of(state: MapState) -> set[tuple[float, ...]]:
    return {tuple(point) for point in state.points.points_map.tolist()}


def test_what_was_seen_before_a_correction_of_the_place_is_taken_back(
    kept: tuple[Path, Pose2], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, place = kept
    saved = map_file.load(path).state
    monkeypatch.setattr(StartCheck, "after", lambda *_, **__: True)
    episode = seen_from(place, path)
    try:
        localisation, told = episode.controller.navigator.localisation, list[TickResult]()
        episode.on_decision = lambda _, decision: told.append(decision)
        episode.observe(episode.now_s + 0.2)
        before = points_of(saved)
        wrong = points_of(contents(episode)) - before
        assert len(wrong) > 100, "it believes what it sees"
        estimate = told[-1].place
        true = OFFICE.start_pose
        T_map_odom = true @ (estimate.T_map_odom.inverse() @ estimate.T_map_base).inverse()
        localisation._beside = T_map_odom, np.diag([0.01, 0.01, 0.001])  # as a search finds it
        episode.observe(episode.now_s + 0.5)
        assert sum(decision.taken_back for decision in told) == 1
        found = points_of(contents(episode))
        assert not found & wrong
        assert len(found - before) > 100, "what is seen from the right place is kept"
    finally:
        episode.close()


def test_a_place_that_proves_right_keeps_what_was_seen_from_it(kept: tuple[Path, Pose2]) -> None:
    path, _ = kept
    settings = EpisodeSettings(beware=BEWARE, odometry_origin=OFFICE.start_pose, max_time_s=20.0)
    episode = Episode(OFFICE, settings, seed=3)
    try:
        navigator = episode.controller.navigator
        load_map(navigator.map, BEWARE, prior=None, kept=path)
        navigator.adopt_map()
        assert navigator.map_is_on_trial
        was_on_trial: list[bool] = []
        episode.on_decision = lambda *_: was_on_trial.append(navigator.map_is_on_trial)
        episode.run()
        assert not navigator.map_is_on_trial
        assert was_on_trial[0] and was_on_trial.index(False) > 10
        assert len(navigator.map.poses) > len(map_file.load(path).state.poses)
    finally:
        episode.close()


def test_a_place_that_is_never_confirmed_is_on_trial_for_some_metres_only(
    kept: tuple[Path, Pose2], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two places may be alike all the way: then the map would never be written."""
    monkeypatch.setattr(Probation, "after", lambda *_: None)
    config = from_table(NavigatorConfig, {"localisation": {"start": {"trial_m": 2.0}}}, "the test")
    episode = seen_from(OFFICE.start_pose, kept[0], config)
    try:
        navigator = episode.controller.navigator
        on_trial: list[tuple[float, bool]] = []
        episode.on_decision = lambda *_: on_trial.append(
            (episode.simulator.referee.distance_m, navigator.map_is_on_trial)
        )
        episode.run()
        ended_m = next(distance_m for distance_m, is_open in on_trial if not is_open)
        assert on_trial[0][1] and 0.3 < ended_m < 2.5
    finally:
        episode.close()


def test_an_edit_by_hand_ends_the_trial(
    kept: tuple[Path, Pose2], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(StartCheck, "after", lambda *_, **__: True)
    episode = seen_from(kept[1], kept[0])
    try:
        navigator = episode.controller.navigator
        navigator.map.edits.erase(np.array([0]), [NOTHING])
        wrong = contents(episode)
        navigator.localisation.search(stamp_ns=0)
        episode.observe(episode.now_s + 0.5)
        assert not navigator.map_is_on_trial
        found = contents(episode)
        np.testing.assert_array_equal(found.points.points_map, wrong.points.points_map)
    finally:
        episode.close()


def test_what_is_seen_from_a_forced_place_that_contradicts_is_taken_back_and_nothing_more(
    kept: tuple[Path, Pose2],
) -> None:
    """The robot has seen much in this session before it is put elsewhere."""
    path, _ = kept
    episode = seen_from(OFFICE.start_pose, path)
    try:
        navigator, told = episode.controller.navigator, list[TickResult]()
        episode.on_decision = lambda _, decision: told.append(decision)
        episode.observe(episode.now_s + 0.3)
        navigator.place_robot(episode.simulator.true_pose(), CONFIRMED, told[-1].frame)
        episode.drive_by_hand(Twist(v_mps=0.0, w_radps=0.5), episode.now_s + 3.0)
        episode.observe(episode.now_s + 0.5)
        before, here = contents(episode), episode.simulator.true_pose()
        assert not navigator.map_is_on_trial
        assert len(before.scans.pose_ids) > len(map_file.load(path).state.scans.pose_ids)
        wrong = here @ Pose2(x_m=0.5, y_m=1.0, yaw_rad=2.0)
        navigator.place_robot(wrong, UNCHECKED, told[-1].frame, is_sure=False)
        episode.observe(episode.now_s + 0.3)
        assert navigator.map_is_on_trial
        assert len(contents(episode).poses) > len(before.poses)
        while navigator.place.is_known and len(told) < 400:
            episode.drive_by_hand(Twist(v_mps=0.0, w_radps=0.5), episode.now_s + 0.5)
        assert not navigator.place.is_known, "what it sees contradicts the place"
        found = contents(episode)
        np.testing.assert_array_equal(found.poses, before.poses)
        np.testing.assert_array_equal(found.points.points_map, before.points.points_map)
        np.testing.assert_array_equal(found.visible.bools, before.visible.bools)
        np.testing.assert_array_equal(found.scans.pose_ids, before.scans.pose_ids)
        navigator.place_robot(here, CONFIRMED, told[-1].frame)
        episode.observe(episode.now_s + 1.0)
        assert navigator.place.is_known and not navigator.map_is_on_trial
    finally:
        episode.close()
