"""Rows 12 to 19 and 22 to 26 of `tests/reliability/README.md` with few trials, each with its
control."""

from __future__ import annotations

import pickle
import time
from functools import partial
from typing import Any

import pytest
from starlette.responses import JSONResponse

from app.console.operations import LiveOperations
from navcore.config.safety import GateConfig, SafetyConfig
from navcore.safety.gate import gate
from tests.reliability import beside_training, fault_runs, hostile, startup, storage, teleop
from web.api.mission import control
from web.gateway import problems

NEVER_NS = 10**15


def test_row_12_the_emergency_stop_holds_against_all_other_requests() -> None:
    figure = teleop.emergency_stops(4)
    # Its latency is measured by `make reliability`.
    assert "0 missed" in figure.measured, figure.measured


def test_row_12_without_the_latch_teleoperation_drives_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LiveOperations, "stop", lambda self, source: None)
    monkeypatch.setattr("tests.reliability.console_rig.TIMEOUT_S", 2.0)
    with pytest.raises(RuntimeError, match="did not hold within"):
        teleop.emergency_stops(1)


def test_row_13_a_page_that_is_closed_frozen_or_cut_off_moves_nothing() -> None:
    figure = teleop.lost_teleop(3)
    assert "drove before in 3" in figure.measured, figure.measured
    worst_s = float(figure.measured.split()[3])
    assert worst_s < teleop.WATCH_S, figure.measured


def test_row_13_without_expiry_it_continues_to_move(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.runtime.control.robot_controller.HAND_LIFE_NS", NEVER_NS)
    endless = SafetyConfig(gate=GateConfig(command_life_s=1e6))
    monkeypatch.setattr("app.runtime.control.robot_controller.gate", partial(gate, config=endless))
    monkeypatch.setattr(control.TeleopSession, "release", lambda self: None)
    monkeypatch.setattr("tests.reliability.console_rig.TIMEOUT_S", 2.0)
    with pytest.raises(RuntimeError, match="did not hold within"):
        teleop.lost_teleop(1)


def test_row_16_no_update_is_lost_when_two_edit_one_zone() -> None:
    figure = storage.two_editors(3)
    assert figure.met, figure.measured


def test_row_16_without_the_version_updates_are_lost() -> None:
    assert not storage.two_editors(6, careful=False).met


def test_row_17_the_wall_clock_changes_no_command() -> None:
    figure = storage.jumping_clocks(1)
    assert figure.met, figure.measured


def test_row_17_a_drive_that_reads_the_wall_clock_is_changed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    honest = fault_runs.fault_run

    def asking(*, seed: int, until_s: float) -> Any:
        return honest(seed=seed, until_s=until_s if time.time() < began_s + 1800 else until_s / 2)

    began_s = time.time()
    monkeypatch.setattr(storage, "fault_run", asking)
    monkeypatch.setattr(storage, "HOUR_S", -3600.0)  # the first drive is an hour ahead, not behind
    assert not storage.jumping_clocks(1).met


def test_row_19_every_key_is_checked_and_named() -> None:
    figure = startup.bad_values(100)
    assert figure.met, figure.measured


def test_row_19_a_reader_that_accepts_anything_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(startup, "load_beware_list", lambda path: None)
    assert not startup.bad_values(1).met


def test_row_22_nonsense_is_refused() -> None:
    figure = hostile.hostile_requests(300)
    assert figure.met, figure.measured


def test_row_22_a_refusal_that_echoes_what_was_sent_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    def echo(errors: Any) -> Any:
        return JSONResponse({"sent": float("nan")}, status_code=422)

    monkeypatch.setattr(problems, "_invalid", echo)
    assert not hostile.hostile_requests(40).met


def test_row_23_hostile_frames_harm_no_other_client() -> None:
    figure = hostile.hostile_frames(40)
    assert figure.met, figure.measured


def test_row_24_no_foreign_request_is_accepted() -> None:
    figure = hostile.foreign_requests(100)
    assert figure.met, figure.measured


@pytest.mark.long
def test_row_24_without_the_origin_check_they_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("web.gateway.guard.check_origin", lambda scope, headers, hosts: None)
    assert not hostile.foreign_requests(1).met


def test_row_25_no_path_leads_out_and_no_weights_run_a_program() -> None:
    figure = hostile.path_traversal(100)
    assert figure.met, figure.measured


def test_row_25_weights_that_are_unpickled_run_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hostile, "load", lambda path: pickle.loads(path.read_bytes()))
    assert not hostile.path_traversal(1).met


@pytest.mark.long
def test_row_26_a_training_computes_beside_the_console_while_its_commands_are_timed() -> None:
    # Their period is measured by `make reliability`.
    assert beside_training.training_beside(200).trials == 200


@pytest.mark.long
def test_row_26_a_computation_that_holds_the_interpreter_delays_commands() -> None:
    assert not beside_training.training_beside(100, in_a_process=False).met
