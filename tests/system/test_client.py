"""The example program drives the simulated robot as it says."""

from __future__ import annotations

import httpx
import pytest

from app.console.application import RunningConsole
from app.examples.client import main


@pytest.mark.long
def test_the_example_drives_to_its_goal_tidies_up_and_can_be_run_again(
    running: RunningConsole, client: httpx.Client
) -> None:
    for x_m, y_m in ((-2.5, 1.0), (-2.5, 0.6)):
        assert main(running.url, x_m, y_m) == 0
        state = client.get("/api/v1/state").json()
        assert not state["stop_latched"] and state["phase"] == "idle" and not state["queue"]
        # Its own goal, not that of the run before.
        assert [state["reached"][-1][axis] for axis in ("x_m", "y_m")] == [x_m, y_m]
        assert client.get("/api/v1/zones").json()["features"] == []
    log = client.get("/api/v1/audit").json()
    texts = [entry["text"] for entry in reversed(log)]
    assert texts[:3] == ["added the zone “wet floor”", "added a goal", "started the mission"]


def test_a_refused_goal_ends_the_example_with_the_consoles_sentence(
    running: RunningConsole, client: httpx.Client
) -> None:
    with pytest.raises(SystemExit, match="out of range"):
        main(running.url, 99_999.0, 0.0)
    assert client.get("/api/v1/zones").json()["features"] == []
    assert client.get("/api/v1/state").json()["phase"] == "idle"
