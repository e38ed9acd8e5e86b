"""`evaluate localisation` in a small room: every part is measured, printed and kept."""

from __future__ import annotations

import dataclasses
import json
import math
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from app.episode.episode import EpisodeSettings
from app.episode.second_day import OTHER_DAY
from app.evaluation.localisation import drives, suite, turns
from app.evaluation.localisation.recording import Recording
from app.evaluation.localisation.suite import PARTS, LocalisationSuite, evaluate_localisation
from app.fleet.local import ThisProcess
from navcore.config.navigator import NavigatorConfig
from navcore.errors import Refused
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import default_beware_list
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario
from sim.scenario.schema import Scenario
from sim.scenario.variation import randomise
from tests.app.evaluation.localisation.test_turns import recorded

FAR = ((2.8, 2.8), (-2.5, 2.6), (-2.5, -2.6), (2.8, 2.4))


def room(name: str) -> Scenario:
    return dataclasses.replace(load_scenario("empty_room"), name=name, goals=FAR)


def measured(out: Path) -> dict[str, Any]:
    return evaluate_localisation(
        room("room"),
        grade=OdometryGrade.TYPICAL,
        episodes=1,
        seed=5,
        out=out,
        beware=default_beware_list(),
        engine=ThisProcess(),
    )


@pytest.mark.long
def test_every_part_is_measured_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(suite, "load_scenario", room)
    monkeypatch.setattr(suite, "PLACES", 2)
    monkeypatch.setattr(suite, "DAYS", 2)
    told = measured(tmp_path / "room")
    assert set(PARTS) <= set(told)
    assert json.loads((tmp_path / "room" / "summary.json").read_text()) == told
    said = capsys.readouterr().err
    assert "turn 2 of 2 is recorded" in said and "17 of 17 parts are measured: days" in said
    drives = {path.stem.rpartition("-")[0] for path in (tmp_path / "drives").iterdir()}
    assert {"room-5", "office-5"} < drives and len(drives) == 5

    searched = told["looked_round"]["the saved map"]
    assert searched["starts"] == 2 and searched["wrong"] == 0
    assert told["saved_map"]["median"]["rms_m"] < 0.05
    assert told["wrong_map"]["mirrored"]["wrong"] == 0


def measures(folder: Path) -> LocalisationSuite:
    return LocalisationSuite(
        grade=OdometryGrade.TYPICAL,
        episodes=1,
        seed=5,
        drives=folder,
        beware=default_beware_list(),
        config=NavigatorConfig(),
    )


@pytest.mark.parametrize("name", ["indoor", "forest"])
def test_both_days_and_the_turns_are_in_the_world_that_the_first_seed_has_furnished(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    driven = list[tuple[Scenario, bool]]()

    class Episode:
        def __init__(self, world: Scenario, settings: EpisodeSettings, *, seed: int) -> None:
            driven.append((world, settings.randomised))
            raise Refused("it is enough to know the world")

    monkeypatch.setattr(drives, "Episode", Episode)
    monkeypatch.setattr(turns, "Episode", Episode)
    here = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    run = Recording(drive=recorded([here], [here]), grade=OdometryGrade.TYPICAL, seed=5)
    of, scenario = measures(tmp_path), load_scenario(name)
    for drive in (
        partial(of.recording, scenario),
        partial(of.recording, scenario, other_day=True),
        partial(of.turn, scenario, run, 0),
    ):
        with pytest.raises(Refused):
            drive()
    (first, *made), (second, *second_made), (turned, *turn_made) = driven
    assert made == second_made == turn_made == [True]
    assert first == randomise(load_scenario(name), 5) and turned == second != first
    assert first.relief == second.relief
    for kind in ("furniture", "items"):
        pairs = zip(getattr(first, kind), getattr(second, kind), strict=True)
        assert all(math.dist(one.at, other.at) < 0.2 for one, other in pairs)


def test_the_days_of_a_world_without_scenery_are_those_of_their_seeds(tmp_path: Path) -> None:
    office, of = load_scenario("office"), measures(tmp_path)
    assert of.world(office) == randomise(office, 5)
    assert of.world(office, other_day=True) == randomise(office, 5 + OTHER_DAY)
