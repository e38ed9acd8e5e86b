"""Recorded drives are replayed only for what they were recorded with."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from app.evaluation.localisation import drives, turns
from app.evaluation.localisation.drives import Drive, kept_drive, load_drive
from app.evaluation.localisation.turns import kept_turn
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import BewareList, default_beware_list
from sim.scenario.load import load_scenario
from tests.app.evaluation.localisation.test_turns import recorded

GOALS = ((2.8, 2.8), (-2.5, 2.6))
ROOM = dataclasses.replace(load_scenario("empty_room"), goals=GOALS)
HERE, ELSEWHERE = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.3), Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.3)
USUAL: dict[str, Any] = {
    "world": ROOM,
    "beware": default_beware_list(),
    "config": NavigatorConfig(),
    "seed": 5,
}
CHANGES = [
    {"world": dataclasses.replace(ROOM, goals=GOALS[::-1])},
    {"world": dataclasses.replace(ROOM, size_m=(9.0, 9.0))},
    {"beware": BewareList(classes=())},
    {"config": dataclasses.replace(NavigatorConfig(), safety_margin_m=0.2)},
    {"seed": 6},
]


@pytest.mark.parametrize("change", [*CHANGES, {"backwards": True}])
def test_a_drive_is_replayed_for_the_same_and_recorded_for_anything_else(
    change: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    driven = list[tuple[tuple[float, float], ...]]()

    def drive(*_: object, goals: tuple[tuple[float, float], ...], **__: object) -> Drive:
        driven.append(goals)
        return recorded([HERE] * (1 + len(driven)), [HERE] * (1 + len(driven)))

    monkeypatch.setattr(drives, "record", drive)
    first = kept_drive(tmp_path, **USUAL)
    assert len(kept_drive(tmp_path, **USUAL)) == len(first) == 2 and driven == [GOALS]
    assert len(kept_drive(tmp_path, **{**USUAL, **change})) == 3 and len(driven) == 2
    assert len(kept_drive(tmp_path, **USUAL)) == 2  # which is still there
    assert len(driven) == 2


class Stands:
    """An episode of a robot that stands at its start, and a recorder of it."""

    started: list[Pose2]

    def __init__(self, _: object, settings: Any, *, seed: int) -> None:
        Stands.started.append(settings.start)

    def observe(self, _: float) -> None: ...

    def drive_by_hand(self, *_: object) -> None: ...

    def close(self) -> None: ...


@pytest.mark.parametrize("change", [*CHANGES, {"drive": recorded([ELSEWHERE], [ELSEWHERE])}])
def test_a_turn_is_that_of_its_drive(
    change: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Recorder:
        drive = recorded([HERE], [HERE])

        def __init__(self, _: object) -> None: ...

    Stands.started = []
    monkeypatch.setattr(turns, "Episode", Stands)
    monkeypatch.setattr(turns, "DriveRecorder", Recorder)
    usual: dict[str, Any] = {**USUAL, "drive": recorded([HERE], [HERE]), "start": 0}
    kept_turn(tmp_path, **usual)
    kept_turn(tmp_path, **usual)
    assert Stands.started == [HERE]
    kept_turn(tmp_path, **{**usual, **change})
    assert Stands.started == [HERE, ELSEWHERE if "drive" in change else HERE]


def test_a_file_that_holds_no_drive_is_refused_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(b"no zip")
    with pytest.raises(BadConfiguration, match=r"a\.npz: holds no recorded drive"):
        load_drive(tmp_path / "a.npz")
