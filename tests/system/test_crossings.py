"""A person walks across the robot's path: it yields, as the referee judges; without the tracker it
almost hits them."""

from __future__ import annotations

import dataclasses
from typing import Any

from app.episode.episode import Episode, EpisodeSettings
from app.evaluation.driving.crossings import draw_crossing, drive_crossing
from app.evaluation.suites import Suite
from navcore.mission.beware_list import default_beware_list
from navcore.robot.laser_scan import ScannerMount
from navcore.robot.profile import HUSKY, RobotProfile
from navcore.stages import Stages
from sim.scenario.schema import MapExtent, Person, Scenario


def drive(stages: Stages) -> dict[str, Any]:
    settings = EpisodeSettings(beware=default_beware_list(), max_time_s=40.0, stages=stages)
    return drive_crossing(7, settings)


def test_the_robot_yields_to_a_person_who_crosses_its_path_and_reaches_its_goal() -> None:
    report = drive(Stages())
    assert report["collisions"] == report["struck_while_standing"] == 0
    assert report["goals_reached"] == 1
    assert report["min_clearance_m"] > 0.05
    # The control: without the tracker, with only the map and the gate to stop the robot.
    assert drive(Stages(track=lambda *_: ()))["min_clearance_m"] < 0.03


def overtaken(robot: RobotProfile) -> dict[str, Any]:
    """Return the report of a robot that has to turn round where a person walks past from behind."""
    person = Person(points=((-3.5, -1.0), (8.0, -1.0)), speed_mps=1.0, yields=False, begins_at=0.0)
    hall = Scenario(
        name="overtaken",
        size_m=(20.0, 20.0),
        map=MapExtent(size_m=(20.0, 20.0)),
        start=(0.0, 0.0, 0.0),
        goals=((-0.5, -3.0),),
        people=(person,),
    )
    settings = EpisodeSettings(beware=default_beware_list(), robot=robot, max_time_s=30.0)
    episode = Episode(hall, settings, seed=0)
    try:
        return episode.run()
    finally:
        episode.close()


def test_a_robot_with_a_scanner_does_not_turn_into_a_person_who_comes_from_behind() -> None:
    report = overtaken(dataclasses.replace(HUSKY, scanner=ScannerMount()))
    assert report["collisions"] == report["struck_while_standing"] == 0
    assert report["goals_reached"] == 1
    # The control: a robot whose camera looks ahead turns into them.
    control = overtaken(HUSKY)
    assert (control["collisions"], control["causes"][0]) == (1, "drove into person")


def test_every_crossing_hits_an_undisturbed_robot_and_the_same_seed_draws_the_same() -> None:
    drawn = [draw_crossing(seed)[0] for seed in range(60)]
    assert all(crossing.meets_undisturbed_robot() == (True, True) for crossing in drawn)
    assert drawn == [draw_crossing(seed)[0] for seed in range(60)]
    assert 0 < sum(draw_crossing(seed)[1] for seed in range(60)) < 120
    unseen = [draw_crossing(seed, Suite.UNSEEN_CROSSINGS)[0] for seed in range(60)]
    assert all(crossing.meets_undisturbed_robot() == (True, False) for crossing in unseen)
    assert {crossing.kind for crossing in drawn} == {"walks on", "stops", "turns back"}
    assert min(crossing.speed_mps for crossing in drawn) < 0.6
    assert max(crossing.speed_mps for crossing in drawn) > 1.3
