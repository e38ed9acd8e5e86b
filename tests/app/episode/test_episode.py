"""Headless missions in the real simulator, judged by its referee."""

from __future__ import annotations

import dataclasses
from itertools import count
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from app.episode import episode as episode_module
from app.episode.episode import Episode, EpisodeSettings
from app.episode.report import EpisodeRecord, _explored_share
from app.runtime.control.robot_controller import COMMAND_PERIOD_S
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.localisation.scans.scan import Scan
from navcore.localisation.tracking.pose_filter import PoseFilter
from navcore.localisation.tracking.scan_to_scan.push_search import Push
from navcore.localisation.tracking.scan_to_scan.scan_odometry import ScanOdometry
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.navigator import TickResult
from navcore.robot.camera_stream import CameraStream
from navcore.robot.profile import HUSKY
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario
from sim.scenario.schema import Item, Scenario
from sim.sensors.faults import Fault

REPORT_KEYS = {
    *(
        "scenario",
        "seed",
        "robot",
        "goals",
        "goals_reached",
        "success",
        "sim_time_s",
        "wall_time_s",
    ),
    *(
        "distance_m",
        "shortest_m",
        "ideal_m",
        "spl",
        "collisions",
        "min_clearance_m",
        "beware_intrusions",
        "beware_intrusion_s",
    ),
    *(
        "zone_intrusions",
        "zone_intrusion_s",
        "replans",
        "plan_ms",
        "tick_ms",
        "segment_ms",
        "series",
        "stops",
    ),
}
ROOM = load_scenario("empty_room")


def driven(
    scenario: Scenario,
    *,
    seed: int = 0,
    beware: BewareList | None = None,
    goals: tuple[tuple[float, float], ...] = (),
    odometry: OdometryGrade = OdometryGrade.TYPICAL,
    max_time_s: float = 240.0,
    start: Pose2 | None = None,
) -> dict[str, Any]:
    episode = Episode(
        scenario,
        EpisodeSettings(
            beware=beware or default_beware_list(),
            goals=goals,
            max_time_s=max_time_s,
            odometry=odometry,
            start=start,
        ),
        seed=seed,
    )
    try:
        return episode.run()
    finally:
        episode.close()


def without_real_time(report: dict[str, Any]) -> dict[str, Any]:
    return {
        key: value
        for key, value in report.items()
        if key != "wall_time_s" and not key.endswith("_ms")
    }


def test_the_report_has_every_field_and_the_robot_keeps_off_the_red_floor() -> None:
    report = driven(ROOM)
    assert set(report) >= REPORT_KEYS
    assert report["success"] is True
    assert (report["collisions"], report["beware_intrusions"], report["zone_intrusions"]) == (
        0,
        0,
        0,
    )
    assert all(error <= 0.3 for error in report["goal_errors_m"].values())
    assert report["distance_m"] > 7.5
    assert report["pushes"] == []
    assert all(len(values) == len(report["series"]["t_s"]) for values in report["series"].values())
    assert report["series"]["explored_m2"] == sorted(report["series"]["explored_m2"])


def test_a_push_that_was_none_is_seen_in_the_report(monkeypatch: pytest.MonkeyPatch) -> None:
    follow, calls = ScanOdometry.follow, count()

    def pushed_once(self: ScanOdometry, scan: Scan, own: PoseFilter, stamp_ns: int) -> Push | None:
        push = follow(self, scan, own, stamp_ns)
        if next(calls) != 20:
            return push
        told = Push(Pose2(x_m=0.0, y_m=0.4, yaw_rad=0.0), 1e-3 * np.eye(3))
        own.push(*told)
        return told

    monkeypatch.setattr(ScanOdometry, "follow", pushed_once)
    push, *_ = driven(ROOM, max_time_s=5.0)["pushes"]  # the next one may take it back
    assert push["by_m"] == pytest.approx(0.4)
    assert push["error_before_m"] < 0.15 < push["error_after_m"]


def test_without_its_rule_the_robot_drives_over_the_red_floor_and_the_referee_sees_it() -> None:
    """Control: the beware list keeps the robot off, and the referee judges independently."""
    nothing = BewareList(
        classes=tuple(
            dataclasses.replace(entry, enabled=False) for entry in default_beware_list().classes
        )
    )
    report = driven(ROOM, beware=nothing)
    assert report["goals_reached"] == 1
    assert report["beware_intrusions"] > 0
    assert report["success"] is False


def test_the_same_seed_gives_the_same_run_and_another_seed_another() -> None:
    first, again, other = (
        without_real_time(driven(ROOM, seed=seed, max_time_s=4.0)) for seed in (3, 3, 4)
    )
    assert first == again
    assert first["series"] != other["series"]


def test_a_goal_that_turns_out_to_be_walled_in_is_given_up_with_its_reason_and_no_contact(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert episode_module.STUCK_SAMPLES == 60
    monkeypatch.setattr(episode_module, "STUCK_SAMPLES", 25)
    inside_the_box = Episode(
        ROOM,
        EpisodeSettings(
            beware=default_beware_list(),
            goals=((0.5, -2.4),),
            max_time_s=600.0,
            camera=CameraStream(width=212, height=120),  # enough to see a box
        ),
        seed=0,
    )
    try:
        report = inside_the_box.run()
    finally:
        inside_the_box.close()
    assert report["goals_reached"] == 0
    assert report["collisions"] == 0
    assert {stop["reason"] for stop in report["stops"]} == {"no_path"}
    assert (
        report["ended"] == "standing"
    )  # it has tried every recovery, and the episode does not wait ten minutes
    assert 25 <= report["sim_time_s"] < 85


def test_an_episode_whose_robot_loses_its_place_ends_by_that_and_with_no_goal_reached() -> None:
    episode = Episode(
        ROOM,
        EpisodeSettings(beware=default_beware_list(), camera=CameraStream(width=212, height=120)),
        seed=0,
    )

    def lose(t_s: float, result: TickResult) -> None:
        if t_s > 1.0 and result.place.is_known:
            episode.controller.navigator.localisation.search(result.frame.stamp_ns)

    episode.on_decision = lose
    try:
        report = episode.run()
    finally:
        episode.close()
    assert (report["ended"], report["goals_reached"]) == ("position lost", 0)
    assert report["causes"] == ["goal not reached: the position was lost"]


@pytest.mark.parametrize(
    ("blocked_columns", "share"), [(range(2), 0.5), (range(3, 6), 0.5), (range(10), 0.0)]
)
def test_the_explored_share_is_that_of_the_floor_also_where_the_start_is_blocked(
    blocked_columns: range, share: float
) -> None:
    spec = GridSpec.centred(size_m=(1.0, 1.0), resolution_m=0.1)
    blocked = np.zeros((10, 10), dtype=np.bool_)
    blocked[:, blocked_columns] = True
    seen = ~blocked
    seen[5:] = False
    record = SimpleNamespace(
        spec=spec,
        scenario=SimpleNamespace(start=(-0.05, 0.05, 0.0)),
        simulator=SimpleNamespace(
            profile=HUSKY, referee=SimpleNamespace(true_blocked=lambda *_: blocked)
        ),
        map=SimpleNamespace(explored=SimpleNamespace(seen=SimpleNamespace(bools=seen))),
    )
    assert _explored_share(cast(EpisodeRecord, record)) == share


def test_commands_and_samples_keep_their_period_after_the_robot_has_stood_and_looked() -> None:
    episode = Episode(
        ROOM,
        EpisodeSettings(
            beware=default_beware_list(),
            max_time_s=3.0,
            camera=CameraStream(width=212, height=120),
        ),
        seed=0,
    )
    times_s: list[float] = []
    episode.on_verdict = lambda t_s, verdict: times_s.append(t_s)
    try:
        episode.run(look_first_s=1.0)
    finally:
        episode.close()
    sampled_s = [sample.t_s for sample in episode.samples[:3]]
    assert times_s[0] == pytest.approx(1.0, abs=0.02)
    assert np.diff(times_s).min() > 0.8 * COMMAND_PERIOD_S
    assert sampled_s == pytest.approx([1.0, 2.0, 3.0], abs=0.02)
    driven_m = [sample.distance_m for sample in episode.samples]
    assert driven_m[0] == pytest.approx(0.0, abs=1e-3)
    assert driven_m == sorted(driven_m)
    assert driven_m[-1] == episode.simulator.referee.distance_m > 0.5


@pytest.mark.parametrize("kind", ["garbage", "wrong"])
def test_a_faulty_depth_camera_ends_no_episode_and_hides_no_item_from_the_judge(kind: Any) -> None:
    x, y, _ = ROOM.start
    fault = Fault(sensor="depth", kind=kind, from_s=0.0, scale=0.1)
    scenario = dataclasses.replace(
        ROOM, items=(Item(kind="cup", at=(x + 1.6, y)),), faults=(fault,)
    )
    episode = Episode(
        scenario,
        EpisodeSettings(
            beware=default_beware_list(),
            max_time_s=1.5,
            camera=CameraStream(width=212, height=120),
        ),
        seed=0,
    )
    try:
        assert episode.run()["items"]["cup"]["seen"] == 1
    finally:
        episode.close()


def test_a_planner_that_fails_while_the_robot_looks_around_ends_no_episode() -> None:
    fault = Fault(sensor="planner", kind="off", from_s=0.0)
    episode = Episode(
        dataclasses.replace(ROOM, faults=(fault,)),
        EpisodeSettings(beware=default_beware_list(), camera=CameraStream(width=212, height=120)),
        seed=0,
    )
    try:
        episode.observe(0.5)
    finally:
        episode.close()
