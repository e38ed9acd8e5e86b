"""The example program drives the simulated robot as it says."""

from __future__ import annotations

import httpx

from app.console.application import RunningConsole
from app.examples.client import main


def test_the_example_draws_a_zone_drives_to_its_goal_stops_and_tidies_up(
    running: RunningConsole, client: httpx.Client
) -> None:
    assert main(running.url, -2.5, 1.0) == 0
    state = client.get("/api/v1/state").json()
    assert state["stop_latched"] and len(state["reached"]) == 1
    assert client.get("/api/v1/zones").json()["features"] == []
    said = [
        (entry["method"], entry["path"]) for entry in reversed(client.get("/api/v1/audit").json())
    ]
    assert [path for _, path in said[:3]] == [
        "/api/v1/zones",
        "/api/v1/goals",
        "/api/v1/mission/start",
    ]
    assert said[3] == ("POST", "/api/v1/stop?by=client.py")
