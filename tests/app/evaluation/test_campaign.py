"""A campaign survives interruptions: driven episodes are recorded, and a killed campaign leaves no
worker behind."""

from __future__ import annotations

import dataclasses
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.episode.ablation import pursue
from app.evaluation.campaign import HERE, Campaign, EpisodesFailed, Fleet
from app.fleet.campaign_files import read_card
from app.fleet.campaign_progress import rate_of
from app.fleet.local import Processes
from app.runtime.record.provenance import version
from navcore.config.navigator import NavigatorConfig
from navcore.control.motion import ControllerState
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.robot.profile import HUSKY

TWO = Fleet(engine=Processes(workers=2))


def drive(key: int) -> dict[str, Any]:
    return {"key": key, "success": key != 1}


def slow_drive(key: int) -> dict[str, Any]:
    Path(os.environ["CAMPAIGN_PIDS"], str(os.getpid())).touch()
    time.sleep(120 if key else 0)
    return drive(key)


def campaign(rules: object = "rules", run: Any = drive) -> Campaign:
    return Campaign(
        suite="test", key="key", rules=rules, holds="another campaign", drive=run, drive_alone=run
    )


def test_recorded_episodes_are_not_driven_again_and_other_rules_are_refused(tmp_path: Path) -> None:
    driven: list[int] = []

    def note(key: int) -> dict[str, Any]:
        driven.append(key)
        return drive(key)

    assert [
        report["key"] for report in campaign(run=note).run([0, 1], fleet=HERE, out=tmp_path)
    ] == [0, 1]
    again = campaign(run=note).run([2, 1, 0], fleet=HERE, out=tmp_path)
    assert [report["key"] for report in again] == [2, 1, 0] and driven == [0, 1, 2]
    with pytest.raises(BadConfiguration, match="another campaign"):
        campaign(rules="others").run([0], fleet=HERE, out=tmp_path)


def test_seeds_that_are_left_out_of_a_later_call_count_as_planned(tmp_path: Path) -> None:
    calls = (([0, 1, 2], 3), ([1, 2], 3), ([1, 2, 3], 4), ([0, 1, 2], 4), ([1, 2, 3, 4], 5))
    for keys, planned in calls:
        campaign().run(keys, fleet=HERE, out=tmp_path)
        assert read_card(tmp_path).planned == planned, keys


def test_a_campaign_says_which_version_has_driven_what_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    versions = {0: "0.1, commit abc", 1: version()}
    run = campaign(run=lambda key: drive(key) | {"version": versions[key]})
    run.run([1], fleet=HERE, out=tmp_path)
    run.run([0, 1], fleet=HERE, out=tmp_path)
    assert "driven by" not in capsys.readouterr().err
    run.run([0, 1], fleet=HERE, out=tmp_path)
    said = capsys.readouterr().err
    assert "1 of 2 episodes are kept, driven by version 0.1, commit abc; this is" in said


@pytest.mark.long
def test_a_killed_campaign_has_recorded_what_was_driven_and_its_workers_end(tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    pids.mkdir()
    (tmp_path / "run.py").write_text(
        "from tests.app.evaluation.test_campaign import *\n"
        "if __name__ == '__main__':\n"
        f"    out = Path({str(tmp_path)!r})\n"
        "    campaign(run=slow_drive).run([0, 1, 2], fleet=TWO, out=out)\n"
    )
    environment = {
        **os.environ,
        "CAMPAIGN_PIDS": str(pids),
        "PYTHONPATH": str(Path(__file__).parents[3]),
    }
    with subprocess.Popen(
        [sys.executable, str(tmp_path / "run.py")], env=environment, stderr=subprocess.DEVNULL
    ) as parent:
        assert within_s(
            300,
            lambda: len(list(pids.iterdir())) == 2 and (tmp_path / "episodes.jsonl").read_text(),
        )
        parent.send_signal(signal.SIGKILL)
    assert within_s(60, lambda: not any(alive(int(path.name)) for path in pids.iterdir()))
    assert json.loads((tmp_path / "episodes.jsonl").read_text())["key"] == 0


def killed_once(key: int) -> dict[str, Any]:
    """Kill the worker at the first try of episode 1."""
    marker = Path(os.environ["CAMPAIGN_PIDS"], "killed")
    if key == 1 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return drive(key)


def always_killed(key: int) -> dict[str, Any]:
    if key == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return drive(key)


def hanging(key: int) -> dict[str, Any]:
    time.sleep(600 if key == 1 else 0)
    return drive(key)


@pytest.mark.long
def test_a_killed_worker_fails_its_own_episode_which_is_driven_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CAMPAIGN_PIDS", str(tmp_path))
    reports = campaign(run=killed_once).run([0, 1, 2], fleet=TWO, out=tmp_path)
    assert [report["key"] for report in reports] == [0, 1, 2]
    assert (tmp_path / "killed").exists()


@pytest.mark.long
@pytest.mark.parametrize(
    ("run", "cause"), [(always_killed, "exit code -9"), (hanging, "longer than 8 s")]
)
def test_an_episode_that_fails_twice_is_named_and_all_others_are_recorded(
    tmp_path: Path, run: Any, cause: str
) -> None:
    limited = Fleet(engine=Processes(workers=2, limit_s=8.0))
    with pytest.raises(EpisodesFailed, match="key 1") as failure:
        campaign(run=run).run([0, 1, 2], fleet=limited, out=tmp_path)
    assert cause in failure.value.causes[1]
    recorded = (tmp_path / "episodes.jsonl").read_text().splitlines()
    assert sorted(json.loads(line)["key"] for line in recorded) == [0, 2]


@pytest.mark.parametrize("fleet", [HERE, pytest.param(TWO, marks=pytest.mark.long)])
def test_an_episode_that_raises_an_error_is_named_and_all_others_are_recorded(
    tmp_path: Path, fleet: Fleet
) -> None:
    with pytest.raises(EpisodesFailed) as failure:
        campaign(run=broken).run([0, 1, 2, 3, 4], fleet=fleet, out=tmp_path)
    told = "key 0, 3 (no goal can be reached); key 2 (ZeroDivisionError: division by zero)"
    assert told in str(failure.value)
    reports = campaign().run([0, 1, 2, 3, 4], fleet=HERE, out=tmp_path)
    assert [report.get("first") for report in reports] == [None, True, None, None, True]


def test_an_episode_is_recorded_before_its_figures_are_written(tmp_path: Path) -> None:
    def fails(driven: dict[str, Any]) -> None:
        raise BadConfiguration(f"no room for figures of {driven['key']}")

    with pytest.raises(BadConfiguration, match="no room for figures of 0"):
        dataclasses.replace(campaign(), after=fails).run([0, 1], fleet=HERE, out=tmp_path)
    assert json.loads((tmp_path / "episodes.jsonl").read_text())["key"] == 0
    reports = campaign().run([0, 1], fleet=HERE, out=tmp_path)
    assert [report["key"] for report in reports] == [0, 1]


@contextmanager
def full_disk(at_bytes: int) -> Iterator[None]:
    """No file grows beyond a size, as on a disk that is full then."""
    usual, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (at_bytes, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (usual, most))


def test_a_full_disk_is_named_and_what_was_recorded_before_is_kept(tmp_path: Path) -> None:
    def long(key: int) -> dict[str, Any]:
        return {**drive(key), "note": "x" * (1_000 if key else 1_999_800)}

    with full_disk(2_000_000), pytest.raises(BadConfiguration, match="cannot be written"):
        campaign(run=long).run([0, 1, 2], fleet=HERE, out=tmp_path)
    reports = campaign().run([0, 1, 2], fleet=HERE, out=tmp_path)
    assert ["note" in report for report in reports] == [True, False, False]


@pytest.mark.long
def test_a_worker_with_other_code_than_this_process_drives_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.fleet.local.version", lambda: "0.1, commit of before")
    with pytest.raises(BadConfiguration, match=r"has bewarenav .*of 0\.1, commit of before"):
        campaign().run([0, 1], fleet=TWO, out=tmp_path)
    assert (tmp_path / "episodes.jsonl").read_text() == ""


def broken(key: int) -> dict[str, Any]:
    if key % 3 == 0:
        raise BadConfiguration("no goal can be reached")
    return {**drive(key), "first": 1 / (key - 2) != 0}


def within_s(patience_s: float, holds: Any) -> bool:
    until = time.monotonic() + patience_s
    while time.monotonic() < until:
        if holds():
            return True
        time.sleep(0.1)
    return False


def alive(pid: int) -> bool:
    """Return whether a process lives; a zombie, which was not waited for, does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def track(*points: tuple[float, float]) -> Points:
    return np.array(points, dtype=np.float64)


def test_a_path_is_pursued_ahead_turned_to_behind_and_ended_at_its_goal() -> None:
    here, config = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), NavigatorConfig()
    straight = pursue(track(*((0.05 * i, 0.0) for i in range(100))), here, HUSKY, config)
    assert (
        straight.outcome is ControllerState.FOLLOW
        and straight.twist.v_mps > 0.5
        and abs(straight.twist.w_radps) < 1e-9
    )
    left = pursue(track(*((0.05 * i, 0.03 * i) for i in range(100))), here, HUSKY, config)
    assert left.twist.w_radps > 0.1
    behind = pursue(track(*((-0.05 * i, 0.0) for i in range(100))), here, HUSKY, config)
    assert behind.outcome is ControllerState.TURN and behind.twist.v_mps == 0.0
    assert (
        pursue(track((0.0, 0.0), (0.05, 0.0)), here, HUSKY, config).outcome
        is ControllerState.ARRIVED
    )


def test_the_rate_names_workers_and_each_machine() -> None:
    one = rate_of(Counter({"a": 30}), 2, 3600.0)
    assert one == "30 episodes in 60.0 min: 30.0 per hour, workers: 2, machines: 1"
    two = rate_of(Counter({"b": 10, "a": 30}), 4, 1800.0)
    assert two.endswith("80.0 per hour, workers: 4, machines: 2 (a 60.0, b 20.0)")
