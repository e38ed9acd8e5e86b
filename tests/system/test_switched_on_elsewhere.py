"""A robot that is switched on elsewhere in its map than it believes stands until it knows where it
is."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.episode.episode import Episode, EpisodeSettings
from app.runtime.record.map_persistence import load_map, save_map
from navcore.geometry.transform import Pose2
from navcore.localisation.scans.keyframe_store import stored
from navcore.mission.beware_list import default_beware_list
from sim.scenario.load import load_scenario

BEWARE = default_beware_list()
OFFICE = load_scenario("office")


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
