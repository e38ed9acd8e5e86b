"""The HTTP API against the running simulator."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import numpy.typing as npt
import pytest
from websockets.sync.client import connect

from app.console.application import ConsoleOptions, RunningConsole, console
from tests.system.conftest import BY_COLOUR, state_when

GOAL = {"x_m": -2.5, "y_m": 2.0}


def square(x: float, y: float, side: float = 0.6) -> dict[str, Any]:
    ring = [[x, y], [x + side, y], [x + side, y + side], [x, y + side]]
    return {"name": "wet floor", "geometry": {"type": "Polygon", "coordinates": [ring]}}


def test_the_robot_drives_to_a_goal_and_then_to_the_next(client: httpx.Client) -> None:
    for goal in ({"x_m": -2.5, "y_m": 1.0}, {"x_m": -2.5, "y_m": 2.2}):
        assert client.post("/api/v1/goals", json=goal).status_code == 201
    assert client.post("/api/v1/mission/start").is_success
    assert state_when(client, lambda state: state["moving"])["phase"] == "driving"
    done = state_when(client, lambda state: state["phase"] == "idle")
    assert len(done["reached"]) == 2
    assert np.hypot(done["pose"]["x_m"] + 2.5, done["pose"]["y_m"] - 2.2) < 0.3
    assert "goals reached" in done["summary"]
    run = client.get("/api/v1/runs").json()[0]
    assert (run["goals_reached"], run["collisions"]) == (2, 0)
    assert client.get(f"/api/v1/runs/{run['id']}").json()["series"]["t_s"]


def test_a_stop_is_latched_and_only_a_reset_and_a_resume_drive_on(client: httpx.Client) -> None:
    client.post("/api/v1/goals", json={"x_m": -2.5, "y_m": -2.5})
    client.post("/api/v1/mission/start")
    state_when(client, lambda state: abs(state["twist"]["v_mps"]) > 0.1)
    assert client.post("/api/v1/stop").is_success
    stopped = state_when(client, lambda state: abs(state["twist"]["v_mps"]) < 0.02)
    assert stopped["stop_latched"] and stopped["command"] == {"v_mps": 0.0, "w_radps": 0.0}
    assert stopped["reasons"][0]["code"] == "emergency_stop"
    assert "mergency stop" in stopped["summary"]
    assert client.post("/api/v1/mission/resume").status_code == 409
    assert client.post("/api/v1/stop/reset").is_success
    assert client.get("/api/v1/state").json()["phase"] == "paused"
    assert client.post("/api/v1/mission/resume").is_success
    state_when(client, lambda state: state["moving"])


def test_cancel_stands_still_and_forgets_the_goals(client: httpx.Client) -> None:
    client.post("/api/v1/goals", json={"x_m": -2.5, "y_m": 2.5})
    client.post("/api/v1/mission/start")
    state_when(client, lambda state: state["moving"])
    client.post("/api/v1/mission/cancel")
    cancelled = state_when(client, lambda state: not state["moving"])
    assert (cancelled["phase"], cancelled["queue"]) == ("idle", [])
    assert "cancelled" in client.get("/api/v1/state").json()["summary"]


def test_the_path_bends_round_a_zone_and_back_when_it_is_deleted(client: httpx.Client) -> None:
    pose = client.get("/api/v1/state").json()["pose"]
    client.post(
        "/api/v1/goals", json={"x_m": -2.5, "y_m": -pose["y_m"] if abs(pose["y_m"]) > 1 else 2.5}
    )
    client.post("/api/v1/mission/start")
    straight = state_when(client, lambda state: state["distance_to_goal_m"] is not None)[
        "distance_to_goal_m"
    ]
    client.post("/api/v1/mission/pause")
    preview = client.post(
        "/api/v1/preview", json={"polygon": square(-2.8, -0.3)["geometry"]["coordinates"][0]}
    )
    assert preview.is_success, preview.text
    created = client.post("/api/v1/zones", json=square(-2.8, -0.3))
    assert created.status_code == 201
    client.post("/api/v1/mission/resume")
    bent = state_when(client, lambda state: (state["distance_to_goal_m"] or 0) > straight + 0.1)
    assert bent["phase"] == "driving"
    zone = created.json()
    assert (
        client.delete(
            f"/api/v1/zones/{zone['id']}", headers={"If-Match": created.headers["etag"]}
        ).status_code
        == 204
    )
    state_when(
        client,
        lambda state: (
            state["distance_to_goal_m"] is None or state["distance_to_goal_m"] < straight + 0.1
        ),
    )


def decoded(client: httpx.Client, name: str) -> npt.NDArray[np.uint8]:
    answer = client.get(f"/api/v1/{name}")
    return np.asarray(
        cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_UNCHANGED), dtype=np.uint8
    )


def occupied(client: httpx.Client) -> int:
    return int(np.count_nonzero(decoded(client, "map.pgm") == 0))


def test_the_map_follows_the_colour_rule_when_it_is_switched_off_and_on(
    client: httpx.Client,
) -> None:
    client.post("/api/v1/goals", json={"x_m": -2.5, "y_m": 0.2})
    client.post("/api/v1/mission/start")
    state_when(client, lambda state: state["phase"] == "idle")
    version = client.get("/api/v1/state").json()["beware_version"]
    seen = occupied(client)
    assert client.patch("/api/v1/beware/red floor", json={"enabled": False}).is_success
    off = state_when(
        client,
        lambda state: state["beware_version"] == version + 1 and occupied(client) < seen - 50,
    )
    assert off["beware_version"] == version + 1
    without = occupied(client)
    client.patch("/api/v1/beware/red floor", json={"enabled": True})
    state_when(client, lambda _: occupied(client) > without + 50)


CROSSED = [[0, 0], [2, 2], [2, 0], [0, 2]]
FAR = [[0, 0], [11000, 0], [0, 2]]
BAD = [
    ("goals", {"x_m": 9000.0, "y_m": 0.0}, 422, "too far away"),
    ("goals", {"x_m": 1.0}, 422, "y_m"),
    ("goals", {"x_m": 1.0, "y_m": 1.0, "z_m": 0.0}, 422, "z_m"),
    (
        "zones",
        {"name": "a", "geometry": {"type": "Polygon", "coordinates": [[[0, 0]]]}},
        422,
        "at least 3",
    ),
    (
        "zones",
        {"name": "a", "geometry": {"type": "Polygon", "coordinates": [CROSSED]}},
        422,
        "crosses itself",
    ),
    (
        "zones",
        {"name": "a", "geometry": {"type": "Polygon", "coordinates": [FAR]}},
        422,
        "out of range",
    ),
    ("zones", {"name": "a", "colour": "red"}, 422, "colour"),
]


@pytest.mark.parametrize(("route", "body", "status", "words"), BAD)
def test_bad_input_is_refused_by_what_is_wrong_and_nothing_stored_is_lost(
    client: httpx.Client, route: str, body: dict[str, Any], status: int, words: str
) -> None:
    kept = client.post("/api/v1/zones", json=square(2.0, -3.0)).json()
    answer = client.post(f"/api/v1/{route}", json=body)
    assert answer.status_code == status
    assert words in answer.text
    assert [zone["id"] for zone in client.get("/api/v1/zones").json()["features"]] == [kept["id"]]
    assert client.get("/api/v1/state").json()["queue"] == []


def test_a_goal_in_a_zone_just_drawn_is_refused_with_a_position_beside_it(
    client: httpx.Client,
) -> None:
    client.post("/api/v1/zones", json=square(2.0, -3.0))
    refused = client.post("/api/v1/goals", json={"x_m": 2.3, "y_m": -2.7})
    assert refused.status_code == 422
    assert "beware zone" in refused.text
    assert client.post("/api/v1/goals", json=refused.json()["nearest"]).status_code == 201


def test_values_that_are_not_finite_are_refused(client: httpx.Client) -> None:
    for text in (
        '{"x_m": NaN, "y_m": 0}',
        '{"x_m": 1e999, "y_m": 0}',
        '{"x_m": -Infinity, "y_m": 0}',
    ):
        answer = client.post(
            "/api/v1/goals", content=text, headers={"content-type": "application/json"}
        )
        assert answer.status_code == 422
    assert client.get("/api/v1/state").json()["queue"] == []


def test_the_state_streams_at_five_hertz_or_more(running: RunningConsole) -> None:
    with connect(running.url.replace("http", "ws") + "/api/v1/events", proxy=None) as events:
        states = [json.loads(events.recv(timeout=10)) for _ in range(10)]
    stamps = [state["stamp_s"] for state in states]
    assert stamps == sorted(stamps)
    assert (stamps[-1] - stamps[0]) / (len(stamps) - 1) <= 0.2


def test_images_cloud_and_metrics_are_served(client: httpx.Client) -> None:
    assert decoded(client, "map.pgm").shape == (180, 180)
    assert decoded(client, "map.png").ndim == 3
    assert client.get("/api/v1/camera.jpg?overlay=segmentation").content[:2] == b"\xff\xd8"
    assert client.get("/api/v1/cloud.ply").content.startswith(b"ply")
    assert "resolution: 0.05" in client.get("/api/v1/map.yaml").text
    assert client.get("/metrics").is_success
    assert client.get("/healthz").json()["status"] == "ok"
    assert "/api/v1/goals" in client.get("/openapi.json").json()["paths"]


def test_zones_and_the_beware_list_survive_a_restart(tmp_path: Path) -> None:
    with console(
        ConsoleOptions(scenario="empty_room", port=0, data=tmp_path, choice=BY_COLOUR)
    ) as first:
        zone = httpx.post(
            f"{first.url}/api/v1/zones", json=square(1.0, 1.5), trust_env=False, timeout=60.0
        ).json()
        httpx.patch(
            f"{first.url}/api/v1/beware/cup", json={"margin_m": 0.4}, trust_env=False, timeout=60.0
        ).raise_for_status()
    with console(
        ConsoleOptions(scenario="empty_room", port=0, data=tmp_path, choice=BY_COLOUR)
    ) as second:
        features = httpx.get(f"{second.url}/api/v1/zones", trust_env=False, timeout=60.0).json()[
            "features"
        ]
        classes = httpx.get(f"{second.url}/api/v1/beware", trust_env=False, timeout=60.0).json()[
            "classes"
        ]
    assert [feature["id"] for feature in features] == [zone["id"]]
    assert features[0]["geometry"]["coordinates"] == zone["geometry"]["coordinates"]
    assert next(entry for entry in classes if entry["name"] == "cup")["margin_m"] == 0.4
