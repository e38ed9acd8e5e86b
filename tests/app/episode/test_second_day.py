"""On the second day the robot knows the world from the map that it made on the first."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.episode import second_day
from app.episode.episode import EpisodeSettings
from app.episode.second_day import FirstDay, drive_first_day, switched_on
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from sim.scenario.load import load_scenario
from sim.scenario.variation import randomise

ROOM = load_scenario("empty_room")
NEAR = randomise(dataclasses.replace(ROOM, goals=((ROOM.start[0] + 0.6, ROOM.start[1]),)), seed=0)
SETTINGS = EpisodeSettings(beware=default_beware_list(), randomised=True, max_time_s=11.0)
TRUE_POSES = tuple(Pose2(x_m=0.5 * k, y_m=0.0, yaw_rad=0.0) for k in range(9))
DRIFT = Pose2(x_m=0.2, y_m=-0.1, yaw_rad=0.05)


def drifted(drift: Pose2) -> FirstDay:
    map_poses = tuple(drift @ pose for pose in TRUE_POSES)
    return FirstDay(true_poses=TRUE_POSES, map_poses=map_poses, last=None, report={})


def test_goals_and_zones_are_drawn_where_the_drift_of_the_map_has_put_their_places() -> None:
    goal = Goal(id=1, x_m=3.0, y_m=1.0)
    corners = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0))
    zone = Zone(id="z", name="z", polygon=corners)
    by_drift, exact = drifted(DRIFT), drifted(IDENTITY)
    for told, true in (
        ((by_drift.placed(goal).x_m, by_drift.placed(goal).y_m), (3.0, 1.0)),
        *zip(by_drift.placed(zone).polygon, corners, strict=True),
    ):
        seen = DRIFT @ Pose2(x_m=true[0], y_m=true[1], yaw_rad=0.0)
        assert seen.distance_to(*told) < 1e-9
    assert exact.placed(goal) == goal and exact.placed(zone) == zone
    far = dataclasses.replace(goal, y_m=30.0)
    assert by_drift.placed(far) == far


def test_things_are_judged_where_the_drift_of_the_map_has_put_them() -> None:
    outline = np.array([(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)])
    assert np.allclose(drifted(DRIFT).placed_outline(outline), DRIFT.to_parent(outline))
    assert np.array_equal(drifted(IDENTITY).placed_outline(outline), outline)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[FirstDay, Path]]:
    kept = tmp_path_factory.mktemp("first") / "map.npz"
    yield drive_first_day(NEAR, SETTINGS, seed=0, kept=kept), kept


def driven(first: tuple[FirstDay, Path], **changes: Any) -> dict[str, Any]:
    """Drive the second day; odometry begins at zero, which is not where the robot stands."""
    day, kept = dataclasses.replace(first[0], **changes), first[1]
    episode = switched_on(NEAR, SETTINGS, seed=0, kept=kept, first=day)
    try:
        assert episode.controller.navigator.map.explored.area_m2 > 5.0
        assert episode.simulator.odometry() == IDENTITY
        assert episode.placed == day.placed_outline
        return episode.run()
    finally:
        episode.close()


@pytest.mark.long
def test_the_robot_finds_its_place_where_it_stood_in_the_evening(
    first: tuple[FirstDay, Path],
) -> None:
    report = driven(first)
    assert report["success"] and report["map"] == "kept"
    day = report["first_day"]
    assert (day["goals_reached"], day["place_shown"]) == (2, False) and day["map_error_m"] < 0.1
    assert report["goal_errors_by_odometry_m"]["1"] < 0.3


@pytest.mark.long
def test_where_nothing_tells_the_place_the_operator_shows_it(
    first: tuple[FirstDay, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = driven(first, last=None)
    assert shown["success"] and shown["first_day"]["place_shown"]
    monkeypatch.setattr(second_day, "_look_for_place", lambda *_: None)
    alone = driven(first, last=None)
    assert alone["goals_reached"] == 0 and alone["distance_m"] < 0.1
