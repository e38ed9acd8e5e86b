"""Event log, explanation, detections and time series of the running simulator."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from navcore.learning.data.dataset import load_dataset
from tests.system.conftest import state_when

FENCE = {
    "name": "fence",
    "geometry": {
        "type": "Polygon",
        "coordinates": [
            [
                [-3.9, 0.2],
                [-0.9, 0.2],
                [-0.9, 3.9],
                [-1.1, 3.9],
                [-1.1, 0.6],
                [-3.7, 0.6],
                [-3.7, 3.7],
                [-1.2, 3.7],
                [-1.2, 3.9],
                [-3.9, 3.9],
            ]
        ],
    },
}
"""Around the goal but for a gap of 0.1 m; a straight fence could be passed through unseen space."""


def answer_when(
    program: httpx.Client, path: str, holds: Callable[[Any], bool], patience_s: float = 60.0
) -> Any:
    """Return the first answer for which a condition holds."""
    deadline = time.monotonic() + patience_s
    while not holds(answer := program.get(f"/api/v1/{path}").json()):
        assert time.monotonic() < deadline, (
            f"it never happened; the last answer was {answer!s:.2000}"
        )
        time.sleep(0.1)
    return answer


@pytest.mark.long
def test_a_drive_is_logged_explained_and_plotted(client: httpx.Client) -> None:
    zone = client.post("/api/v1/zones", json=FENCE).json()["id"]
    client.post("/api/v1/goals", json={"x_m": -2.5, "y_m": 2.0})
    client.post("/api/v1/mission/start")
    explained = answer_when(client, "explain", lambda said: not said.get("found", True))
    assert explained["lift"] == {"keys": [f"zone:{zone}"], "exact": True, "at_least": 1}
    # Paths are compared a few times a second; edits and stops are told each.
    answer_when(client, "journal?limit=1000", lambda log: "There is no path" in str(log))
    client.delete(f"/api/v1/zones/{zone}")
    state_when(client, lambda state: state["moving"])
    assert client.get("/api/v1/explain").json()["found"]
    client.post("/api/v1/stop", params={"by": "test"})
    client.post("/api/v1/stop/reset")
    client.post("/api/v1/mission/resume")
    state_when(client, lambda state: state["phase"] == "idle")
    said = answer_when(
        client,
        "journal?limit=1000",  # the drive may take long on a busy machine
        lambda log: any(entry["kind"] == "goal" for entry in log["entries"]),
    )["entries"]
    assert {"mission", "replanned", "zone", "stopped", "goal"} <= {entry["kind"] for entry in said}
    texts = [entry["text"] for entry in said]
    planned = "Planned a path of|A path has opened"
    for part in (planned, "There is no path", "“fence” was drawn", "by test"):
        assert any(re.search(part, text) for text in texts), "\n".join([part, *texts])
    assert [entry["id"] for entry in said] == sorted(entry["id"] for entry in said)
    series = client.get("/api/v1/series").json()
    assert (
        len(series["t_s"]) > 3
        and max(series["speed_mps"]) > 0.1
        and series["explored_m3"][-1] > 1.0
    )
    run = client.get(f"/api/v1/runs/{client.get('/api/v1/runs').json()[0]['id']}").json()
    assert (
        len({len(run["series"][name]) for name in run["series"]}) == 1
        and max(run["series"]["tick_ms"]) > 0
    )


def test_a_missed_object_is_added_to_a_data_set_for_the_next_training(
    client: httpx.Client, data: Path
) -> None:
    snapshot = client.post("/api/v1/sightings/snapshots").json()["snapshot"]
    missed = {"snapshot": snapshot, "class_name": "cup", "box": [100, 100, 160, 150]}
    state = client.post("/api/v1/sightings", json=missed).json()
    assert state["pictures"] == 1, state
    assert load_dataset(data / "labelling").count("train") == 1
    refused = client.post("/api/v1/sightings", json={**missed, "class_name": "unicorn"})
    assert refused.status_code == 404 and "unicorn" in refused.json()["error"]["message"]
