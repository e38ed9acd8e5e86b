"""The robot's place over HTTP: read, checked, set, searched."""

from __future__ import annotations

import httpx
import pytest

HERE = {"x_m": -3.0, "y_m": 1.0, "yaw_rad": 0.5}
ELSEWHERE = {"x_m": 3.0, "y_m": 1.0, "yaw_rad": 0.5}


def test_the_state_says_how_well_the_robot_knows_where_it_is(client: httpx.Client) -> None:
    place = client.get("/api/v1/localisation").json()
    assert place["state"] == "located"
    assert place == client.get("/api/v1/state").json()["place"]


def test_a_place_is_checked_before_it_is_taken(client: httpx.Client) -> None:
    before = client.get("/api/v1/state").json()["pose"]
    checked = client.post("/api/v1/pose?check=true", json=HERE).json()
    assert checked["fits"] is True
    assert checked["scan"] == [[-2.0, 1.0]]
    assert client.get("/api/v1/state").json()["pose"] == before
    assert client.post("/api/v1/pose", json=HERE).status_code == 200
    assert client.get("/api/v1/state").json()["pose"] == HERE


def test_a_place_that_does_not_fit_is_refused_unless_it_is_forced(client: httpx.Client) -> None:
    refused = client.post("/api/v1/pose", json=ELSEWHERE)
    assert refused.status_code == 409
    assert "does not fit" in refused.json()["detail"]
    assert client.post("/api/v1/pose?force=true", json=ELSEWHERE).status_code == 200
    assert client.get("/api/v1/state").json()["pose"] == ELSEWHERE


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"x_m": 0.0, "y_m": 0.0},
        {**HERE, "yaw_rad": 101.0},
        {**HERE, "x_m": 1e9},
        {**HERE, "x_m": "1"},
        {**HERE, "z_m": 0.0},
    ],
)
def test_a_body_that_is_no_pose_is_refused(client: httpx.Client, body: dict[str, object]) -> None:
    assert client.post("/api/v1/pose", json=body).status_code == 422


def test_a_search_is_told_in_the_state(client: httpx.Client) -> None:
    assert client.post("/api/v1/localisation/search").json()["searching"] is True
    assert client.get("/api/v1/state").json()["place"]["searching"] is True
