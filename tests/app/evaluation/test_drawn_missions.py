"""Campaigns that draw their missions are told apart by what they draw, and where."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from app.cli.evaluate import command
from app.cli.evaluate.settings import EvaluateSettings
from app.episode.episode import EpisodeSettings
from app.evaluation.campaign import Conclusion
from app.evaluation.driving import crossings, doors
from app.fleet.campaign_files import read_card
from navcore.mission.beware_list import default_beware_list

CHANGED = dataclasses.replace(doors.quiet_office(), size_m=(40.0, 20.0))


def campaign_of(suite: ModuleType, out: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the hash of the campaign of a suite, without driving it."""
    evaluate, drive = (
        ("evaluate_doors", "drive_passage")
        if suite is doors
        else ("evaluate_crossings", "drive_crossing")
    )
    monkeypatch.setattr(suite, drive, lambda seed, settings, **_: {"seed": seed, "success": True})
    monkeypatch.setattr(Conclusion, "write", lambda *_: {})
    getattr(suite, evaluate)(EpisodeSettings(beware=default_beware_list()), seeds=range(1), out=out)
    return read_card(out).campaign


@pytest.mark.parametrize(
    ("suite", "name", "value"),
    [
        (doors, "quiet_office", lambda: CHANGED),
        (doors, "ROOM_M", (1.5, 2.7)),
        (doors, "RETREAT_M", 0.3),
        (crossings, "HALL_M", 31.0),
        (crossings, "SPEEDS_MPS", (0.4, 1.7)),
        (crossings, "GOAL_M", 4.6),
    ],
)
def test_another_world_and_another_way_of_drawing_are_other_campaigns(
    suite: ModuleType, name: str, value: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = campaign_of(suite, tmp_path / "a", monkeypatch)
    assert campaign_of(suite, tmp_path / "b", monkeypatch) == before
    monkeypatch.setattr(suite, name, value)
    assert campaign_of(suite, tmp_path / "c", monkeypatch) != before


@pytest.mark.parametrize(
    ("drove_into_people", "goals_reached", "succeeds"),
    [(0, 20, True), (0, 19, True), (0, 18, False), (0, 0, False), (1, 20, False)],
)
def test_a_robot_that_goes_nowhere_fails_the_crossings(
    drove_into_people: int, goals_reached: int, succeeds: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    verdict = {"drove_into_people": drove_into_people, "goals_reached": goals_reached}
    monkeypatch.setattr(
        crossings, "evaluate_crossings", lambda *_, **__: verdict | {"episodes": 20}
    )
    assert command._crossings(EvaluateSettings(suite="crossings"), None) is succeeds
