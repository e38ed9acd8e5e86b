"""The mission and its goals over the API."""

from __future__ import annotations

import dataclasses

import httpx
import pytest
from pydantic import TypeAdapter

from navcore.mission.anchor import Anchor, Place
from navcore.safety.gate import Cause, StopReason
from tests.web.api.answers import wrong, zone
from tests.web.fake_operations import FakeOperations
from web.interface.snapshots import State


def test_a_mission_is_queued_started_paused_resumed_and_cancelled(client: httpx.Client) -> None:
    first = client.post("/api/v1/goals", json={"x_m": 3.0, "y_m": 0.5}).json()
    client.post("/api/v1/goals", json={"x_m": -5, "y_m": -4})
    assert first == {"id": 1, "x_m": 3.0, "y_m": 0.5, "yaw_rad": None, "name": ""}
    assert [
        client.post(f"/api/v1/mission/{act}").json()["phase"]
        for act in ("start", "pause", "resume")
    ] == [
        "driving",
        "paused",
        "driving",
    ]
    assert client.delete("/api/v1/goals/1").status_code == 204
    assert [goal["id"] for goal in client.get("/api/v1/goals").json()["queue"]] == [2]
    assert client.post("/api/v1/mission/cancel").json() == {
        "phase": "idle",
        "queue": [],
        "reached": [],
        "reached_count": 0,
        "loop": False,
    }


def test_the_stop_holds_until_it_is_reset_and_then_the_mission_waits(
    client: httpx.Client, operations: FakeOperations
) -> None:
    client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0})
    client.post("/api/v1/mission/start")
    stopped = client.post("/api/v1/stop").json()
    assert stopped["stop_latched"] and not stopped["moving"]
    assert "Emergency stop" in stopped["reasons"][0]["text"] and operations.stops == ["REST"]
    assert client.get("/api/v1/state").json()["stop_latched"]
    # No label refuses a stop.
    assert client.post("/api/v1/stop", params={"by": "x" * 500}).status_code == 200
    assert operations.stops[-1] == "x" * 80
    released = client.post("/api/v1/stop/reset").json()
    assert not released["stop_latched"] and released["phase"] == "paused"


def test_a_reset_releases_no_stop_that_its_sender_has_not_seen(client: httpx.Client) -> None:
    seen = client.post("/api/v1/stop").json()["stops"]
    client.post("/api/v1/stop", params={"by": "another page"})
    reset = "/api/v1/stop/reset"
    assert "pressed again" in wrong(client.post(reset, params={"stops": seen}), 409)["message"]
    newest = client.get("/api/v1/state").json()
    assert newest["stop_latched"] and newest["stops"] == seen + 1
    released = client.post(reset, params={"stops": newest["stops"]}).json()
    assert not released["stop_latched"]


@pytest.mark.parametrize(
    ("act", "status", "says"),
    [
        ("start", 409, "no goal"),
        ("pause", 409, "only a driving mission"),
        ("fly", 422, "Action: expected "),
    ],
)
def test_an_action_that_does_not_fit_is_refused_in_words(
    client: httpx.Client, act: str, status: int, says: str
) -> None:
    assert says in wrong(client.post(f"/api/v1/mission/{act}"), status)["message"]


@pytest.mark.parametrize("name", [".", ".."])
@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("POST", "/api/v1/beware"),
        ("PATCH", "/api/v1/beware/cup"),
        ("PUT", "/api/v1/missions/{}"),
        ("PUT", "/api/v1/zone-sets/{}"),
    ],
)
def test_a_name_that_means_a_folder_in_an_address_is_refused(
    client: httpx.Client, method: str, path: str, name: str
) -> None:
    address = path.format(name.replace(".", "%2E"))
    answer = client.request(method, address, json={"name": name, "margin_m": 0.1})
    assert "are no names" in wrong(answer, 422)["message"]


@pytest.mark.parametrize("path", ["/api/v1/missions/{}", "/api/v1/zone-sets/{}"])
def test_a_deletion_of_what_has_such_a_name_already_is_not_refused_for_it(
    client: httpx.Client, path: str
) -> None:
    answer = client.delete(path.format("%2E%2E"))
    assert wrong(answer, 404)["code"] == "not_known"


@pytest.mark.parametrize(
    ("x", "y", "says"), [(9900, 0, "too far away"), (4.0, 2.5, "inside an obstacle")]
)
def test_a_goal_that_is_no_place_to_stand_is_refused_and_the_queue_stays(
    client: httpx.Client, x: float, y: float, says: str
) -> None:
    client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0})
    assert says in wrong(client.post("/api/v1/goals", json={"x_m": x, "y_m": y}), 422)["message"]
    assert len(client.get("/api/v1/goals").json()["queue"]) == 1


def test_a_preview_tells_the_path_and_applies_nothing(client: httpx.Client) -> None:
    before = client.get("/api/v1/state").json()
    free = client.post("/api/v1/preview", json={"goal": {"x_m": 3, "y_m": 0}}).json()
    across = [[-4, -5.9], [-3, -5.9], [-3, 5.9], [-4, 5.9]]
    shut = client.post(
        "/api/v1/preview", json={"goal": {"x_m": 3, "y_m": 0}, "polygon": across}
    ).json()
    assert free["found"] and free["length_m"] > 9 and len(free["path"]) > 10
    assert (shut["found"], shut["reason"], shut["length_m"], shut["path"]) == (
        False,
        "unreachable",
        None,
        [],
    )
    assert shut["cut_by"] == ["the draft"] and shut["present"]["length_m"] == free["length_m"]
    after = client.get("/api/v1/state").json()
    assert {**before, "stamp_s": 0} == {**after, "stamp_s": 0}


def test_a_robot_that_is_boxed_in_is_offered_to_back_off(
    client: httpx.Client, operations: FakeOperations
) -> None:
    assert client.post("/api/v1/mission/back-off").status_code == 200
    assert operations.backed_off == 1
    reasons = TypeAdapter(State).dump_python(
        dataclasses.replace(
            operations.state(),
            reasons=(
                StopReason(cause=Cause.BOXED_IN, text="boxed in"),
                StopReason(cause=Cause.PAUSED, text="paused"),
            ),
        ),
        mode="json",
    )["reasons"]
    assert [reason["offer"] for reason in reasons] == ["back-off", None]


def test_a_goal_beyond_the_map_and_a_site_to_stay_in_are_taken(client: httpx.Client) -> None:
    assert client.post("/api/v1/goals", json={"x_m": 500.0, "y_m": -3.0}).status_code == 201
    site = zone("site", [[-900.0, -900.0], [900.0, -900.0], [900.0, 900.0]], kind="stay-inside")
    stored = client.post("/api/v1/zones", json=site)
    assert stored.status_code == 201
    assert stored.json()["properties"]["kind"] == "stay-inside"
    limited = zone("site", kind="stay-inside", max_speed_mps=0.3)
    assert (
        "other zones have none" in wrong(client.post("/api/v1/zones", json=limited), 422)["message"]
    )


def test_the_poses_that_a_goal_belongs_to_are_not_served(
    client: httpx.Client, operations: FakeOperations
) -> None:
    client.post("/api/v1/goals", json={"x_m": 3.0, "y_m": 0.5})
    state, place = operations.state(), Place(outline=((3.0, 0.5),))
    anchor = Anchor(numbering="of a map", poses=(), drawn=place, place=place)
    (goal,) = state.queue
    anchored = dataclasses.replace(state, queue=(dataclasses.replace(goal, anchors=(anchor,)),))
    (served,) = TypeAdapter(State).dump_python(anchored)["queue"]
    assert served == {"id": 1, "x_m": 3.0, "y_m": 0.5, "yaw_rad": None, "name": ""}
