"""`evaluate localisation` in a small room: every part is measured, printed and kept."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from app.evaluation.localisation import suite
from app.evaluation.localisation.suite import PARTS, evaluate_localisation
from app.fleet.local import ThisProcess
from navcore.mission.beware_list import default_beware_list
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario
from sim.scenario.schema import Scenario

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
