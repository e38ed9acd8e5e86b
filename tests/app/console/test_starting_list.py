"""Console, `drive` and `evaluate` start with the beware list of the world; the operator's edits
win over it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.cli.drive import DriveSettings, drive
from app.cli.evaluate.command import evaluate
from app.cli.evaluate.settings import EvaluateSettings
from app.cli.options import SegmenterOptions
from app.console import backend
from app.console.site.site_map import beware_of
from app.storage import Store
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.robot.profile import HUSKY
from sim.scenario.beware import starting_beware_list
from sim.scenario.load import load_scenario
from tests.app.console.state import beware_editor

COLOUR = SegmenterOptions(segmenter="colour")
OFFICE = starting_beware_list(load_scenario("office"))


class GivenError(Exception):
    """The list that a command was about to drive with."""


def give(*_: Any, beware: BewareList, **__: Any) -> None:
    raise GivenError(beware)


def given(error: pytest.ExceptionInfo[GivenError]) -> BewareList:
    beware = error.value.args[0]
    assert isinstance(beware, BewareList)
    return beware


def test_the_office_starts_without_landmines() -> None:
    assert default_beware_list() != OFFICE and not OFFICE.named("landmine").enabled


@pytest.mark.parametrize("own", [False, True])
def test_drive_and_evaluate_take_the_list_of_the_world_unless_one_is_given(
    own: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("app.episode.task.episode_of", give)
    monkeypatch.setattr("app.evaluation.driving.scenario.evaluate_scenario", give)
    file = tmp_path / "own.toml"
    file.write_text('[[beware]]\nname = "fork"\nclass_id = 40\n', encoding="utf-8")
    expected = {"fork"} if own else {entry.name for entry in OFFICE.enabled}
    path = file if own else None
    with pytest.raises(GivenError) as driven:
        drive(DriveSettings(scenario="office", beware=path, segmentation=COLOUR))
    with pytest.raises(GivenError) as evaluated:
        evaluate(EvaluateSettings(suite="office", beware=path, out=tmp_path, segmentation=COLOUR))
    for beware in (given(driven), given(evaluated)):
        assert {entry.name for entry in beware.enabled} == expected


def test_the_console_starts_with_the_list_of_the_world(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "SimulatorProcess", lambda *_, **__: object())
    assert backend.simulated("office", seed=0, profile=HUSKY).beware == OFFICE


def test_the_edits_of_the_operator_win_over_the_world_at_the_next_start(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert beware_of(store.site, OFFICE) == OFFICE
    editor = beware_editor(store.site, OFFICE, defaults=OFFICE)
    editor.edit("landmine", {"enabled": True})
    store.close()
    again = Store(tmp_path)
    assert beware_of(again.site, OFFICE).named("landmine").enabled
    again.close()


def test_restored_defaults_are_those_of_the_world(tmp_path: Path) -> None:
    store = Store(tmp_path)
    editor = beware_editor(store.site, OFFICE, defaults=OFFICE)
    editor.edit("landmine", {"enabled": True})
    editor.edit("cup", {"enabled": False})
    assert editor.take_ready_made("default").classes == OFFICE.classes
    store.close()
