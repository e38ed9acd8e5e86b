"""Row 20: a console that is told to end while its robot drives, and the next one."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx

from app.bench.console.soak import process_tree
from tests.reliability.result import Measurement
from web.port import reserve

LONGEST_S = 5.0
"""Longest time from the signal to the end, seconds."""
PATIENCE_S = 300.0
"""Longest wait for a start, and for the robot to drive, seconds."""
GOALS = ((-2.5, 2.0), (2.0, 2.5), (2.5, -2.0))


def ended_consoles(trials: int, *, told: signal.Signals = signal.SIGTERM) -> Measurement:
    """Row 20: consoles on one data folder that are told to end while the robot drives: how long
    each takes, whether a process is left, and whether the next one has zones, goals and a robot
    that stands. SIGKILL is the control."""
    clean, slowest_s, lost = 0, 0.0, 0
    with tempfile.TemporaryDirectory() as data:
        for number in range(trials):
            with reserve("127.0.0.1", 0) as listener:
                port = listener.getsockname()[1]
            process = _started(Path(data), port)
            try:
                with httpx.Client(
                    base_url=f"http://127.0.0.1:{port}/api/v1/", trust_env=False, timeout=30.0
                ) as program:
                    lost += not _has_all(program, zones=number)
                    _drive(program, zone=f"zone of start {number}")
                family = process_tree(process.pid)
                began_s = time.monotonic()
                process.send_signal(told)
                code = process.wait(PATIENCE_S)
                slowest_s = max(slowest_s, time.monotonic() - began_s)
                clean += code == 0 and _are_gone(family, began_s + LONGEST_S)
            finally:
                process.kill()
                process.wait()
    return Measurement(
        trials=trials,
        measured=f"{clean} ended with code 0 and no process left, within {slowest_s:.1f} s; "
        f"{lost} starts without what was stored, or with a moving robot",
        met=clean == trials and lost == 0 and slowest_s <= LONGEST_S,
    )


def _are_gone(family: list[int], until_s: float) -> bool:
    """Wait until no process is left: helpers of multiprocessing end when they see that theirs has.
    Return whether it is so in time."""
    while left := any(Path(f"/proc/{pid}").exists() for pid in family):
        if time.monotonic() > until_s:
            break
        time.sleep(0.05)
    return not left


def _started(data: Path, port: int) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "app", "console", "--scenario", "empty_room"]
    command += ["--segmenter", "colour", "--data", str(data), "--port", str(port)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _has_all(program: httpx.Client, *, zones: int) -> bool:
    """Wait for a console; return whether it has as many zones and, after the first start, its
    goals, and whether its robot stands."""
    state = _when(program, lambda state: True)
    stored = len(program.get("zones").json()["features"])
    goals = {(goal["x_m"], goal["y_m"]) for goal in state["queue"]}
    kept = not zones or (goals == set(GOALS) and state["phase"] == "paused")
    return stored == zones and kept and not state["moving"]


def _drive(program: httpx.Client, *, zone: str) -> None:
    """Store a zone, and drive round the goals."""
    ring = [[4.2, 4.2], [4.4, 4.2], [4.4, 4.4]]
    shape = {"name": zone, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    program.post("zones", json=shape).raise_for_status()
    if not program.get("state").json()["queue"]:
        for x_m, y_m in GOALS:
            program.post("goals", json={"x_m": x_m, "y_m": y_m}).raise_for_status()
        program.put("mission/loop", json={"loop": True}).raise_for_status()
        program.post("mission/start").raise_for_status()
    else:
        _resume(program)
    _when(program, lambda state: state["command"]["v_mps"] > 0)


def _resume(program: httpx.Client) -> None:
    """Resume the mission as soon as the robot has found its place in the kept map."""
    until_s = time.monotonic() + PATIENCE_S
    while not (answer := program.post("mission/resume")).is_success:
        if time.monotonic() > until_s:
            answer.raise_for_status()
        time.sleep(0.1)


def _when(program: httpx.Client, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Return the first state for which a condition holds."""
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        try:
            state: dict[str, Any] = program.get("state").raise_for_status().json()
            if holds(state):
                return state
        except (httpx.HTTPError, json.JSONDecodeError):
            pass  # it starts
        time.sleep(0.1)
    raise RuntimeError(f"no such state within {PATIENCE_S:.0f} s")
