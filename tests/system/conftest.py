"""The whole console with the running simulator, as `bewarenav console` starts it, on a free
port."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.console.application import ConsoleOptions, RunningConsole, console
from app.runtime.start.segmenter_choice import SegmenterChoice

BY_COLOUR = SegmenterChoice(kind="colour")
"""Most functions of a console need no network, and the tests run on two cores beside a browser."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data folder; it outlives a restart."""
    return tmp_path_factory.mktemp("data")


@pytest.fixture(scope="module")
def running(data: Path) -> Iterator[RunningConsole]:
    """A console in the small room."""
    with console(
        ConsoleOptions(scenario="empty_room", port=0, data=data, choice=BY_COLOUR)
    ) as started:
        yield started


@pytest.fixture
def client(running: RunningConsole) -> Iterator[httpx.Client]:
    """A client program; its changes are undone afterwards."""
    with httpx.Client(base_url=running.url, trust_env=False, timeout=30.0) as program:
        yield program
        tidy(program)


def tidy(program: httpx.Client) -> None:
    """Remove goals, zones and the emergency stop, and enable every class of the beware list."""
    program.post("/api/v1/stop/reset")
    program.post("/api/v1/mission/cancel")
    for zone in program.get("/api/v1/zones").json()["features"]:
        program.delete(f"/api/v1/zones/{zone['id']}")
    for entry in program.get("/api/v1/beware").json()["classes"]:
        if not entry["enabled"]:
            program.patch(f"/api/v1/beware/{entry['name']}", json={"enabled": True})


def state_when(
    program: httpx.Client, holds: Callable[[dict[str, Any]], bool], patience_s: float = 60.0
) -> dict[str, Any]:
    """Return the first state for which a condition holds; fails with the last one in time."""
    deadline = time.monotonic() + patience_s
    while True:
        state: dict[str, Any] = program.get("/api/v1/state").json()
        if holds(state):
            return state
        assert time.monotonic() < deadline, f"it never happened; the last state was {state}"
        time.sleep(0.05)


def marked_room(name: str, colour: tuple[int, int, int], *, beware: bool) -> str:
    """Return the world file of a room with a square on the floor between start and goal, something
    to `beware` of or not for the referee."""
    return f"""
name = "room with {name}"
size_m = [8.0, 6.0]
start = [-3.0, 0.0, 0.0]
goals = [[2.5, 0.0]]
[map]
size_m = [9.0, 7.0]
[[walls]]
points = [[-3.94, -2.94], [3.94, -2.94], [3.94, 2.94], [-3.94, 2.94], [-3.94, -2.94]]
[[markings]]
name = "{name}"
polygon = [[-1.2, -0.5], [-0.2, -0.5], [-0.2, 0.5], [-1.2, 0.5]]
colour = {list(colour)}
beware = {str(beware).lower()}
"""
