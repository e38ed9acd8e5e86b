"""BARN evaluation: driven, judged by the challenge's rules, recorded and resumed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.episode.episode import EpisodeSettings
from app.evaluation.driving.barn import ChallengeRules, drive_world, evaluate_barn, verdict
from app.runtime.record.provenance import machine, version
from navcore.config.navigator import config_for
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Twist
from navcore.mission.beware_list import default_beware_list
from navcore.robot.profile import HUSKY, RobotProfile, load_profile
from sim.scenario.barn import load_worlds
from sim.simulator import Simulator
from tests.sim.scenario.test_barn import MOVING, STATIC, a_file

WALLED = {**STATIC, "id": 2, "walls": [[-2.25, 4.2]]}
"""A world with a wall right ahead of the start."""
NEAR = [-2.25, 7.0]
"""A goal 4 m from the start."""


def rules_of(robot: RobotProfile) -> EpisodeSettings:
    return EpisodeSettings(beware=default_beware_list(), robot=robot)


JACKAL = rules_of(load_profile("jackal"))


def test_a_world_is_driven_scored_and_not_driven_twice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    worlds, out = a_file(tmp_path, WALLED, STATIC, goal=NEAR), tmp_path / "out"

    def campaign(count: int | None) -> dict[str, Any]:
        return evaluate_barn("barn", worlds, JACKAL, count=count, seed=0, out=out)

    first = campaign(1)
    kept = (out / "episodes.jsonl").read_text()
    both = campaign(None)
    assert (first["worlds"], both["worlds"]) == ([2], [2, 6])
    assert (first["episodes"], both["episodes"], "planned" in both) == (1, 2, False)
    assert (both["success_rate"], both["collisions"], both["timeouts"]) == (1.0, 0, 0)
    assert both["score"] == 0.5
    assert (out / "episodes.jsonl").read_text().startswith(kept)
    assert json.loads((out / "summary.json").read_text()) == both
    assert (both["versions"], both["machines"]) == ([version()], [machine()])
    assert (both["suite"], both["odometry"], both["camera"]) == ("barn", "typical", "424x240@10")
    assert both["success_rate_ci95"] == [0.3424, 1.0]  # Wilson's, of 2 of 2
    report = json.loads(kept)
    assert (report["world"], report["robot"], report["scenario"]) == (2, "jackal", "barn 2")
    assert report["optimal_s"] == 6.0 and report["min_clearance_m"] > 0.03
    assert campaign(1)["planned"] == 2  # of the worlds that were asked for
    assert "time_s" in capsys.readouterr().out
    with pytest.raises(BadConfiguration, match="another --out"):
        evaluate_barn("barn", worlds, rules_of(HUSKY), count=1, seed=0, out=out)


def test_a_configuration_of_its_own_drives_a_world_and_another_one_is_another_campaign(
    tmp_path: Path,
) -> None:
    usual = config_for(JACKAL.robot)
    own = replace(JACKAL, config=replace(usual, local=replace(usual.local, lookahead_m=0.7)))
    options: dict[str, Any] = {"count": 1, "seed": 0, "out": tmp_path / "out"}
    summary = evaluate_barn("barn", a_file(tmp_path, WALLED, goal=NEAR), own, **options)
    assert (summary["success_rate"], summary["score"]) == (1.0, 0.5)
    assert summary["min_clearance_m"] > 0.03
    with pytest.raises(BadConfiguration, match="another --out"):
        evaluate_barn("barn", tmp_path / "worlds.json", JACKAL, **options)


def judged(
    tmp_path: Path, world: dict[str, Any], v_mps: float, seconds: float, **meta: object
) -> dict[str, Any]:
    """Drive straight ahead from the start without sensors; return the verdict."""
    (barn,) = load_worlds(a_file(tmp_path, world, **meta), scale=1.0)
    rules, robot = ChallengeRules(barn), load_profile("jackal")
    with Simulator(
        barn.scenario,
        seed=0,
        camera_size=(16, 16),
        camera_rate_hz=0.001,
        robot=robot,
    ) as simulator:
        ended = False
        while not ended and simulator.now_ns() < seconds * 1e9:
            simulator.send(Twist(v_mps=v_mps, w_radps=0.0))
            simulator.step()
            ended = rules.ended(simulator)
        return {"ended": ended, **verdict(barn, rules)}


def test_the_clock_starts_with_the_first_decimetre_and_ends_within_a_metre_of_the_goal(
    tmp_path: Path,
) -> None:
    report = judged(tmp_path, {**STATIC, "cylinders": []}, 2.0, 20.0)
    assert (report["ended"], report["success"], report["collision"], report["timeout"]) == (
        True,
        True,
        False,
        False,
    )
    assert report["time_s"] == pytest.approx(8.9 / 2.0, abs=0.2)
    assert report["score"] == 0.5


def test_any_contact_ends_the_run_without_a_score(tmp_path: Path) -> None:
    report = judged(tmp_path, WALLED, 1.0, 20.0)
    assert (report["ended"], report["success"], report["collision"], report["timeout"]) == (
        True,
        False,
        True,
        False,
    )
    assert report["score"] == 0.0


def test_a_contact_fails_the_run_however_slow_it_is(tmp_path: Path) -> None:
    close = {**STATIC, "walls": [[-2.25, 3.36]]}
    report = judged(tmp_path, close, 0.015, 10.0)
    assert (report["ended"], report["success"], report["collision"]) == (True, False, True)


def test_a_robot_that_never_moves_times_out(tmp_path: Path) -> None:
    report = judged(tmp_path, STATIC, 0.0, 20.0, timeout=2.0)
    assert (report["ended"], report["success"], report["collision"], report["timeout"]) == (
        True,
        False,
        False,
        True,
    )


def test_an_obstacle_that_runs_into_the_standing_robot_fails_the_run_too(tmp_path: Path) -> None:
    keys = [[0.0, -2.25, 6.0], [2.0, -2.25, 3.5], [4.0, -2.25, 3.5]]
    ram = {**MOVING, "obstacles": [{"name": "a", "radius": 0.5, "period": 9.0, "keys": keys}]}
    report = judged(tmp_path, ram, 0.0, 20.0)
    assert (report["ended"], report["collision"]) == (True, True)


def test_a_wrong_suite_robot_or_file_is_refused(tmp_path: Path) -> None:
    static = a_file(tmp_path, STATIC)
    options: dict[str, Any] = {"count": None, "seed": 0, "out": tmp_path}
    with pytest.raises(BadConfiguration, match="needs --worlds"):
        evaluate_barn("barn", None, JACKAL, **options)
    with pytest.raises(BadConfiguration, match="no such file"):
        evaluate_barn("barn", tmp_path / "none.json", JACKAL, **options)
    with pytest.raises(BadConfiguration, match="no dynabarn worlds"):
        evaluate_barn("dynabarn", static, JACKAL, **options)
    other = rules_of(replace(HUSKY, name="unicycle"))
    with pytest.raises(BadConfiguration, match="unicycle: the worlds are made for one of: "):
        evaluate_barn("barn", static, other, **options)


def test_the_husky_drives_the_same_world_at_its_own_size(tmp_path: Path) -> None:
    report = drive_world(
        6,
        worlds=a_file(tmp_path, STATIC, goal=NEAR),
        suite="barn",
        settings=rules_of(HUSKY),
        seed=0,
    )
    assert (report["success"], report["collision"], report["robot"]) == (True, False, "husky")
    assert report["causes"] == []
    assert report["distance_m"] == pytest.approx(3.0 * 1.7, abs=0.5)
