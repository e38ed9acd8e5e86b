"""Console, `drive` and `evaluate` start with the beware list of the world; the operator's edits
win over it."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.cli.drive import DriveSettings, drive
from app.cli.evaluate.command import evaluate
from app.cli.evaluate.settings import EvaluateSettings
from app.cli.options import SegmenterOptions
from app.console import application, backend
from app.console.backend import BackEnd
from app.console.site.site_map import begin_list, beware_of
from app.runtime.start.segmenter_choice import SegmenterChoice
from app.storage import Store
from navcore.errors import BadConfiguration
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.robot.profile import HUSKY
from sim.scenario.beware import starting_beware_list
from sim.scenario.load import load_scenario
from sim.scenario.schema import map_grid
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
    begin_list(store.site, OFFICE)
    assert beware_of(store.site) == OFFICE
    editor = beware_editor(store.site, OFFICE, defaults=OFFICE)
    editor.edit("landmine", {"enabled": True})
    store.close()
    again = Store(tmp_path)
    begin_list(again.site, OFFICE)
    assert beware_of(again.site).named("landmine").enabled
    again.close()


def test_a_refused_start_leaves_no_site_and_no_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = load_scenario("office")
    robot: Any = SimpleNamespace(close=lambda: None, now_ns=lambda: 0)
    back_end = BackEnd(robot=robot, spec=map_grid(world), name=world.name, beware=OFFICE)
    monkeypatch.setattr(application, "_back_end", lambda *_: back_end)
    monkeypatch.setattr(application, "warm_up", lambda *_: None)
    data, kept = tmp_path / "data", tmp_path / "own.map"
    kept.write_bytes(b"no map")
    with closing(Store(data)) as store:
        before = store.sites.all()
    options = application.ConsoleOptions(
        scenario="office",
        data=data,
        port=0,
        choice=SegmenterChoice(kind="colour"),
        site="Ward",
        kept=kept,
        beware=default_beware_list(),
    )
    with pytest.raises(BadConfiguration, match=r"own\.map"), application.console(options):
        pass
    with closing(Store(data)) as store:
        assert store.sites.all() == before and store.site.beware() is None


def test_restored_defaults_are_those_of_the_world(tmp_path: Path) -> None:
    store = Store(tmp_path)
    editor = beware_editor(store.site, OFFICE, defaults=OFFICE)
    editor.edit("landmine", {"enabled": True})
    editor.edit("cup", {"enabled": False})
    assert editor.take_ready_made("default").classes == OFFICE.classes
    store.close()
