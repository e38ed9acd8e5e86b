"""Zones over the API."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

from navcore.mission.zone import OWN_COLOUR, Zone
from tests.web.api.answers import wrong, zone
from tests.web.fake_operations import FakeOperations


def test_a_zone_bends_the_path_and_its_removal_straightens_it(client: httpx.Client) -> None:
    client.post("/api/v1/goals", json={"x_m": 6, "y_m": 0.0})
    lengths = [client.get("/api/v1/state").json()["distance_to_goal_m"]]
    stored = client.post(
        "/api/v1/zones", json=zone(corners=[[3, -2], [3.5, -2], [3.5, 2.2], [3, 2.2]])
    )
    lengths.append(client.get("/api/v1/state").json()["distance_to_goal_m"])
    client.delete(f"/api/v1/zones/{stored.json()['id']}")
    lengths.append(client.get("/api/v1/state").json()["distance_to_goal_m"])
    assert lengths[1] > lengths[0] + 0.5 and lengths[2] == lengths[0]


def test_a_zone_may_be_a_feature_or_a_bare_geometry_and_goes_back_as_it_came(
    client: httpx.Client,
) -> None:
    feature = client.post("/api/v1/zones", json=zone(enabled=False, margin_m=0.5))
    plain = client.post("/api/v1/zones", json={"name": "b", "geometry": feature.json()["geometry"]})
    assert feature.headers["etag"] == '"1"' and feature.headers["location"] == "/api/v1/zones/z1"
    assert feature.json()["properties"] == {
        "name": "wet floor",
        "enabled": False,
        "margin_m": 0.5,
        "kind": "keep-out",
        "max_speed_mps": None,
        "colour": None,
        "expires_at_s": None,
        "drawn": None,
        "version": 1,
        "frame": "map",
    }
    assert feature.json()["geometry"] == plain.json()["geometry"] == zone()["geometry"]
    again = client.put(
        "/api/v1/zones/z1", json=feature.json(), headers={"If-Match": feature.headers["etag"]}
    )
    assert again.status_code == 200 and again.headers["etag"] == '"2"'
    assert [entry["id"] for entry in client.get("/api/v1/zones").json()["features"]] == ["z1", "z2"]


@pytest.mark.parametrize("method", ["PUT", "DELETE"])
def test_the_second_of_two_editors_is_refused_and_gets_the_stored_zone(
    client: httpx.Client, method: str
) -> None:
    client.post("/api/v1/zones", json=zone("first"))
    client.put("/api/v1/zones/z1", json=zone("by the other"), headers={"If-Match": '"1"'})
    body = zone("mine") if method == "PUT" else None
    late = client.request(method, "/api/v1/zones/z1", json=body, headers={"If-Match": '"1"'})
    assert wrong(late, 409)["code"] == "outdated"
    assert late.json()["stored"]["properties"]["name"] == "by the other"
    assert (late.json()["given_version"], late.json()["stored_version"], late.headers["etag"]) == (
        1,
        2,
        '"2"',
    )
    assert client.get("/api/v1/zones/z1").json()["properties"]["name"] == "by the other"


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (zone(corners=[[1, 1]]), "corners"),
        (zone(corners=[[0, 0], [1, 1], [1, 0], [0, 1]]), "crosses itself"),
        (zone(corners=[[0, 0], [10100, 1], [1, 0]]), "out of range"),
        (zone(paint="red"), "body.properties.paint: “paint” is not known here."),
        (zone(colour="red"), "body.properties.colour"),
        (zone(name=" "), "body.properties.name"),
        (zone(margin_m=-1), "body.properties.margin_m"),
        (
            {"name": "a", "geometry": {"type": "Point", "coordinates": [1, 2]}},
            "body.geometry.radius_m",
        ),
        ({"geometry": zone()["geometry"]}, "body.name"),
        ([], "JSON object"),
    ],
)
def test_a_bad_zone_is_refused_by_name_and_the_stored_ones_stay(
    client: httpx.Client, body: Any, says: str
) -> None:
    client.post("/api/v1/zones", json=zone("kept"))
    for answer in (
        client.post("/api/v1/zones", json=body),
        client.put("/api/v1/zones/z1", json=body),
    ):
        told = wrong(answer, 422)
        assert says in f"{told['where']}: {told['message']}"
    kept = client.get("/api/v1/zones").json()["features"]
    assert [(entry["properties"]["name"], entry["properties"]["version"]) for entry in kept] == [
        ("kept", 1)
    ]


def test_where_the_robot_keeps_out_by_itself_comes_with_the_path(
    client: httpx.Client, operations: FakeOperations
) -> None:
    assert client.get("/api/v1/path").json()["closed"] == []
    corners = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
    operations.closed = (
        Zone(
            id="lane 0", name="where a person walks to and fro", polygon=corners, colour=OWN_COLOUR
        ),
    )
    client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0.0})
    [lane] = client.get("/api/v1/path").json()["closed"]
    assert lane["properties"]["name"] == "where a person walks to and fro"
    assert [tuple(corner) for corner in lane["geometry"]["coordinates"][0][:-1]] == list(corners)
