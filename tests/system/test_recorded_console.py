"""The console with a recording: its map grows, a path is planned on it, and a damaged image is
reported by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import numpy as np

from app.console.application import ConsoleOptions, console
from tests.recorded import write_recording
from tests.system.conftest import BY_COLOUR, state_when


def test_the_console_plays_a_recording_and_plans_on_its_map(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "walk", np.eye(4))
    options = ConsoleOptions(
        scenario="", recording=folder, level=True, port=0, data=tmp_path / "data", choice=BY_COLOUR
    )
    with (
        console(options) as running,
        httpx.Client(base_url=running.url, trust_env=False, timeout=30.0) as program,
    ):
        seen = state_when(
            program, lambda state: state["explored_m2"] > 3.0 and state["travelled_m"] > 0.8
        )
        assert seen["scenario"] == "recording walk"
        program.post("/api/v1/goals", json={"x_m": 3.0, "y_m": -0.9}).raise_for_status()
        program.post("/api/v1/mission/start").raise_for_status()
        state_when(
            program,
            lambda state: (
                state["distance_to_goal_m"] is not None and state["distance_to_goal_m"] > 2.0
            ),
        )
        travelled_m = seen["travelled_m"]
        state_when(
            program, lambda state: state["travelled_m"] > travelled_m + 2.0
        )  # it has turned and gone on
        assert "pose_jump" not in _codes(program.get("/api/v1/state").json())


def test_a_damaged_image_is_reported_by_name_and_the_recording_continues(
    tmp_path: Path,
) -> None:
    folder = write_recording(tmp_path / "walk", np.eye(4))
    (folder / "frame-000020.depth.png").write_bytes(b"no picture")
    options = ConsoleOptions(
        scenario="", recording=folder, level=True, port=0, data=tmp_path / "data", choice=BY_COLOUR
    )
    with (
        console(options) as running,
        httpx.Client(base_url=running.url, trust_env=False, timeout=30.0) as program,
    ):
        told = state_when(program, lambda state: "planner_failed" in _codes(state))
        assert any("frame-000020.depth.png" in reason["text"] for reason in told["reasons"])
        state_when(
            program,
            lambda state: "planner_failed" not in _codes(state) and state["travelled_m"] > 1.0,
        )


def _codes(state: dict[str, Any]) -> set[str]:
    return {reason["code"] for reason in state["reasons"]}
