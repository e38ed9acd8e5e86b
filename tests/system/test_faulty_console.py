"""The console of a robot on which something goes wrong: what the operator is told and can do
about it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest

from app.console.application import ConsoleOptions, console
from sim.scenario.load import WORLDS
from tests.system.conftest import BY_COLOUR, state_when

FAULTS = """
[[faults]]
sensor = "odometry"
kind = "wrong"
from_s = 6.0
shift_m = 0.3

[[faults]]
sensor = "planner"
kind = "off"
from_s = 20.0
"""


@pytest.mark.long
def test_a_jump_of_odometry_is_reported_latched_and_accepted_by_a_reset(tmp_path: Path) -> None:
    world = tmp_path / "faulty.toml"
    world.write_text(
        (WORLDS / "empty_room.toml").read_text(encoding="utf-8") + FAULTS, encoding="utf-8"
    )
    with (
        console(
            ConsoleOptions(scenario=str(world), port=0, data=tmp_path, choice=BY_COLOUR)
        ) as running,
        httpx.Client(base_url=running.url, trust_env=False, timeout=30.0) as program,
    ):
        for x_m, y_m in ((-2.5, 1.5), (2.0, 2.0), (-2.5, 1.5), (2.0, 2.0)):
            program.post("/api/v1/goals", json={"x_m": x_m, "y_m": y_m}).raise_for_status()
        program.post("/api/v1/mission/start").raise_for_status()
        told = state_when(
            program, lambda state: state["reasons"] and state["reasons"][0]["code"] == "pose_jump"
        )
        assert told["stop_latched"] and not told["moving"]
        assert "jumped by " in told["summary"]
        after = program.post("/api/v1/stop/reset").json()
        assert (after["stop_latched"], after["phase"]) == (False, "paused")
        program.post("/api/v1/mission/resume").raise_for_status()
        state_when(program, lambda state: state["moving"])
        state_when(program, lambda state: "planner_failed" in _codes(state) and not state["moving"])


def _codes(state: dict[str, Any]) -> set[str]:
    return {reason["code"] for reason in state["reasons"]}
