"""Rows 12 to 19 and 22 to 25 of the reliability page with few trials, each with its control."""

from __future__ import annotations

import pickle
import time
from typing import Any

import pytest

from app.console.operations import LiveOperations
from tests.reliability import drills
from tests.reliability import hostile as hostile_figures
from tests.reliability import startup as start_figures
from tests.reliability import storage as keeping_figures
from tests.reliability import teleop as hand_figures
from web import problems
from web.api import control as control_api

NEVER_NS = 10**15


def test_row_12_the_emergency_stop_holds_whatever_else_is_asked_for() -> None:
    figure = hand_figures.emergency_stops(4)
    assert "0 missed" in figure.measured, (
        figure.measured
    )  # how quick it is, is measured by `make reliability`


def test_row_12_without_the_latch_the_hand_drives_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LiveOperations, "stop", lambda self, source: None)
    monkeypatch.setattr("tests.reliability.console_rig.PATIENCE_S", 2.0)
    with pytest.raises(RuntimeError, match="does not come to work"):
        hand_figures.emergency_stops(1)


def test_row_13_a_page_that_is_closed_frozen_or_cut_off_moves_nothing() -> None:
    figure = hand_figures.lost_teleop(3)
    assert "drove before in 3" in figure.measured, figure.measured
    worst_s = float(figure.measured.split()[3])
    assert worst_s < hand_figures.WATCH_S, figure.measured


def test_row_13_without_expiry_it_goes_on_moving(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.runtime.robot_controller.HAND_LIFE_NS", NEVER_NS)
    monkeypatch.setattr("navcore.safety.gate.COMMAND_LIFE_NS", NEVER_NS)
    monkeypatch.setattr(control_api.Hand, "let_go", lambda self: None)
    monkeypatch.setattr("tests.reliability.console_rig.PATIENCE_S", 2.0)
    with pytest.raises(RuntimeError, match="does not come to work"):
        hand_figures.lost_teleop(1)


def test_row_16_no_update_is_lost_when_two_edit_one_zone() -> None:
    figure = keeping_figures.two_editors(3)
    assert figure.met, figure.measured


def test_row_16_without_the_version_updates_are_lost() -> None:
    assert not keeping_figures.two_editors(6, careful=False).met


def test_row_17_the_wall_clock_changes_no_command() -> None:
    figure = keeping_figures.jumping_clocks(1)
    assert figure.met, figure.measured


def test_row_17_a_drive_that_asks_the_wall_clock_is_changed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    honest = drills.drill

    def asking(*, seed: int, until_s: float) -> Any:
        return honest(seed=seed, until_s=until_s if time.time() < began_s + 1800 else until_s / 2)

    began_s = time.time()
    monkeypatch.setattr(keeping_figures, "drill", asking)
    monkeypatch.setattr(
        keeping_figures, "HOUR_S", -3600.0
    )  # the first drive is an hour ahead, not behind
    assert not keeping_figures.jumping_clocks(1).met


def test_row_19_every_key_is_checked_and_named() -> None:
    figure = start_figures.bad_values(100)
    assert figure.met, figure.measured


def test_row_19_a_reader_that_takes_anything_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(start_figures, "load_beware_list", lambda path: None)
    assert not start_figures.bad_values(1).met


def test_row_22_nonsense_is_refused() -> None:
    figure = hostile_figures.hostile_requests(300)
    assert figure.met, figure.measured


def test_row_22_a_refusal_that_echoes_what_was_sent_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    def echo(errors: Any) -> Any:
        return problems.JsonResponse({"sent": float("nan")}, status_code=422)

    monkeypatch.setattr(problems, "_invalid", echo)
    assert not hostile_figures.hostile_requests(40).met


def test_row_23_hostile_frames_harm_nobody_else() -> None:
    figure = hostile_figures.hostile_frames(40)
    assert figure.met, figure.measured


def test_row_24_no_stranger_gets_past_the_door() -> None:
    figure = hostile_figures.foreign_requests(100)
    assert figure.met, figure.measured


def test_row_24_without_a_look_at_host_and_origin_they_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("web.guard.refusal_of_strangers", lambda scope, headers, hosts: None)
    assert not hostile_figures.foreign_requests(1).met


def test_row_25_no_path_leads_out_and_no_weights_run_a_program() -> None:
    figure = hostile_figures.path_traversal(100)
    assert figure.met, figure.measured


def test_row_25_weights_that_are_unpickled_run_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hostile_figures, "load", lambda path: pickle.loads(path.read_bytes()))
    assert not hostile_figures.path_traversal(1).met
