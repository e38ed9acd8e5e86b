"""Doors of the office: what is drawn, and what counts as passed at the first try."""

from __future__ import annotations

import dataclasses
import math
from itertools import islice

import numpy as np
import pytest
import shapely

from app.episode.episode import EpisodeSettings
from app.evaluation.driving import doors
from app.evaluation.driving.doors import (
    DOORS,
    Passage,
    draw_passages,
    drive_passage,
    first_clear,
    summarise,
)
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import default_beware_list
from navcore.robot.profile import HUSKY
from sim.truth.clearance import grown_obstacles


def test_start_and_goal_lie_on_both_sides_of_a_door_and_a_seed_draws_the_same() -> None:
    drawn = list(islice(draw_passages(0), 60))
    assert drawn == list(islice(draw_passages(0), 60)) != list(islice(draw_passages(1), 60))
    assert {passage.door for passage in drawn} == {door for door, _ in DOORS}
    assert {passage.into_room for passage in drawn} == {True, False}
    for passage in drawn:
        (x, y), start = passage.door, passage.start
        assert (start.y_m - y) * (passage.goal[1] - y) < 0
        towards = math.atan2(y - start.y_m, x - start.x_m)
        assert abs(math.remainder(start.yaw_rad - towards, math.tau)) <= 0.6


def test_the_robot_is_told_how_little_clearance_it_has_and_has_clear_floor_ahead() -> None:
    told = list[float]()
    for seed in (2216, 2217, 2218):  # the first pose that 2216 draws has a shelf 0.15 m beside it
        passage, episode = first_clear(seed, EpisodeSettings(beware=default_beware_list()))
        episode.close()
        start = passage.start
        walls = [shapely.Polygon(one) for one in grown_obstacles(episode.scenario, {}, HUSKY)]
        away_m = min(float(wall.distance(shapely.Point(start.x_m, start.y_m))) for wall in walls)
        told.append(passage.clear_m)
        assert told[-1] == pytest.approx(away_m)
        ahead = start.to_parent(np.array([(0.0, -0.35), (1.2, -0.35), (1.2, 0.35), (0.0, 0.35)]))
        assert not any(wall.intersects(shapely.Polygon(ahead)) for wall in walls)
    assert min(told) < 1.0


def test_a_door_is_passed_at_the_first_try() -> None:
    report = drive_passage(3, EpisodeSettings(beware=default_beware_list(), max_time_s=40.0))
    assert report["goals_reached"] == 1
    assert report["first_try"] and report["retreat_m"] < 0.1
    summary = summarise("evaluate doors", [report, {**report, "first_try": False}])
    assert (summary["first_try"], summary["not_at_first_try_seeds"]) == (0.5, [3])
    assert (summary["seeds"], summary["segmenter"]) == ([3, 3], "colour rules")


@pytest.mark.parametrize("into_room", [True, False])
def test_a_retreat_is_what_the_robot_comes_away_from_the_door_before_it_is_through(
    into_room: bool,
) -> None:
    drawn = (one for one in draw_passages(0) if one.into_room == into_room)
    passage = next(one for one in drawn if one.door[1] > 0.0)
    onwards = 1.0 if into_room else -1.0

    def retreat_m(*past_m: float) -> float:
        return passage.retreat_m([(0.0, 1.5 + onwards * past) for past in past_m])

    assert retreat_m() == retreat_m(-1.0, -0.5, 0.0, 1.0) == 0.0
    assert retreat_m(-1.0, -0.5, -1.2, -0.4, 0.6) == pytest.approx(0.7)
    assert retreat_m(-1.0, 0.2, -0.3, 1.0) == pytest.approx(0.5)
    assert retreat_m(-1.0, 0.6, -1.0) == 0.0, "it was through"
    x = passage.door[0]
    before, beyond = 1.5 - onwards, 1.5 + onwards
    assert passage.is_through([(x, before), (x + 0.5, beyond), (x + 3.0, beyond)])
    assert not passage.is_through([(x, before), (x + 6.0, before), (x + 6.0, beyond)])
    assert not passage.is_through([(x, before)])


@pytest.mark.parametrize(("measure", "measured"), [("retreat_m", 0.3), ("is_through", False)])
def test_a_door_that_the_robot_comes_away_from_or_goes_round_is_not_passed_at_the_first_try(
    measure: str, measured: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Passage, measure, lambda *_: measured)
    report = drive_passage(3, EpisodeSettings(beware=default_beware_list(), max_time_s=40.0))
    assert report["goals_reached"] == 1 and not report["first_try"]


def test_a_robot_that_fits_no_door_is_refused_after_some_tries(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried = list[Pose2]()

    def refused(_: object, pose: Pose2, *__: object) -> None:
        tried.append(pose)
        raise BadConfiguration("in a chair")

    monkeypatch.setattr(doors, "check_standing", refused)
    with pytest.raises(BadConfiguration, match="seed 7: the robot 'husky' passes none of 100"):
        first_clear(7, EpisodeSettings(beware=default_beware_list()))
    assert 0 < len(tried) <= 100


def test_a_robot_without_a_model_is_named_and_not_looked_for_at_other_doors() -> None:
    unknown = dataclasses.replace(HUSKY, name="unknown")
    with pytest.raises(BadConfiguration, match="unknown"):
        first_clear(3, EpisodeSettings(beware=default_beware_list(), robot=unknown))
