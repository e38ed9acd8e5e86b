"""Rows 1 to 11 of `tests/reliability/README.md` with few trials, each with its control;
`make reliability` takes more of them."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import pytest

from app.runtime.control import stop_reasons
from app.runtime.control.robot_controller import RobotController
from navcore import navigator
from navcore.config.safety import GateConfig, SafetyConfig
from navcore.mission.zone import Zone
from navcore.safety import gate, sensor_monitor
from sim.robot import skid_steer
from tests.reliability import planning, stopping
from tests.reliability.main import ROWS, measure_reliability

NEVER_NS = 10**15


@pytest.fixture
def no_expiry(monkeypatch: pytest.MonkeyPatch) -> None:
    """A gate for which nothing expires."""
    endless = SafetyConfig(gate=GateConfig(command_life_s=1e6, frame_life_s=1e6))
    monkeypatch.setattr(
        "app.runtime.control.robot_controller.gate", partial(gate.gate, config=endless)
    )


def test_row_1_a_camera_that_fails_in_any_way_stops_the_robot_and_is_named() -> None:
    figure = stopping.silent_camera(5)
    assert figure.met, figure.measured


@pytest.mark.usefixtures("no_expiry")
def test_row_1_without_expiry_the_robot_drives_on_blind() -> None:
    assert not stopping.silent_camera(2).met


def test_row_2_no_command_outlives_a_hung_planner() -> None:
    figure = stopping.hung_planner(2)
    assert figure.met, figure.measured


@pytest.mark.usefixtures("no_expiry")
def test_row_2_without_expiry_an_old_command_is_sent_on() -> None:
    assert not stopping.hung_planner(1).met


def test_row_3_a_robot_whose_console_is_gone_stands_by_itself() -> None:
    figure = stopping.frozen_console(6)
    assert figure.met, figure.measured


def test_row_3_without_the_drivers_time_out_it_rolls_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(skid_steer, "COMMAND_TIMEOUT_NS", NEVER_NS)
    assert not stopping.frozen_console(1).met


def test_row_4_no_malformed_frame_gets_through() -> None:
    figure = stopping.malformed_frames(270)
    assert figure.met, figure.measured


@pytest.mark.long
def test_row_4_without_the_check_they_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(navigator, "check_frame", lambda frame: None)
    with pytest.warns(RuntimeWarning):
        assert not stopping.malformed_frames(27).met


def test_row_5_implausible_odometry_and_stamps_stop_the_robot_and_spare_the_map() -> None:
    figure = stopping.jumping_odometry(4)
    assert figure.met, figure.measured


def test_row_5_without_the_check_a_jump_is_driven_on_and_mapped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sensor_monitor, "_jumped", lambda before, after, reach: False)
    assert not stopping.jumping_odometry(1).met


def test_row_5_a_clean_drive_raises_no_false_alarm() -> None:
    figure = stopping.false_alarms(1)
    assert figure.met, figure.measured


def test_row_6_a_failing_segmentation_is_survived() -> None:
    figure = stopping.failing_segmentation(3)
    assert figure.met, figure.measured


def test_row_6_without_the_catch_the_loop_dies(monkeypatch: pytest.MonkeyPatch) -> None:
    def die(self: RobotController, frame: object, error: Exception) -> None:
        raise error

    monkeypatch.setattr(RobotController, "note_failure", die)
    assert not stopping.failing_segmentation(1).met


def test_row_7_a_search_over_its_budget_is_given_up_and_the_robot_held() -> None:
    figure = planning.over_budget(3)
    assert figure.met, figure.measured


def test_row_7_without_a_budget_it_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "BUDGET", 10**9)
    assert not planning.over_budget(2).met


def test_row_8_each_impossible_goal_has_a_reason_of_its_own() -> None:
    figure = planning.impossible_goals(5)
    assert figure.met, figure.measured


def test_row_8_by_the_planners_reason_alone_two_of_them_are_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        stop_reasons, "_why_no_path", lambda intent, decision, outcome: str(outcome.reason)
    )
    assert not planning.impossible_goals(5).met


def test_row_9_a_zone_under_the_robot_holds_it_until_it_is_told_to_leave() -> None:
    figure = planning.zone_under_robot(6)
    assert figure.met, figure.measured


def test_row_9_a_zone_that_is_switched_off_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    def off(corners: Any, name: str = "drawn") -> Zone:
        return Zone(id=name, name=name, polygon=corners, enabled=False)

    monkeypatch.setattr(planning, "_zone", off)
    assert not planning.zone_under_robot(1).met


def test_row_10_a_zone_drawn_across_the_path_is_not_driven_into() -> None:
    figure = planning.zone_across_path(1)
    assert figure.met, figure.measured


def test_row_10_a_zone_that_only_the_referee_knows_is() -> None:
    assert not planning.zone_across_path(1, told=False).met


def test_row_11_the_gate_alone_stops_before_what_appears() -> None:
    figure = planning.sudden_obstacle(2)
    assert figure.met, figure.measured


def test_row_11_without_the_time_to_contact_the_robot_runs_into_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(gate, "time_to_contact", lambda *_, **named: math.inf)
    assert not planning.sudden_obstacle(1).met


def test_the_table_has_every_row_and_fails_when_one_is_not_met(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert {row.number for row in ROWS} == {*range(1, 21), *range(22, 27)}
    assert measure_reliability(rows=frozenset({3}), factor=0.02) == 0
    monkeypatch.setattr(skid_steer, "COMMAND_TIMEOUT_NS", NEVER_NS)
    assert measure_reliability(rows=frozenset({3}), factor=0.02) == 1
    assert "NO" in capsys.readouterr().out
