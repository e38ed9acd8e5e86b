"""The routes of the API, one behaviour per test."""

from __future__ import annotations

import dataclasses
import io
import json
from http import HTTPStatus
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
import trimesh
from pydantic import TypeAdapter
from websockets.sync.client import connect

from navcore.errors import StorageFailed
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import BewareList, load_beware_list
from navcore.mission.zone import OWN_COLOUR, Zone
from navcore.safety.gate import Cause, StopReason
from tests.web.fake_operations import SPEC, FakeOperations
from web.images.camera import beware_mask, with_overlay
from web.interface.snapshots import State
from web.server import ConsoleServer

SQUARE = [[4.0, -1.0], [5.0, -1.0], [5.0, 1.0], [4.0, 1.0]]


def zone(
    name: str = "wet floor", corners: list[list[float]] = SQUARE, **more: Any
) -> dict[str, Any]:
    """Return a zone as a GeoJSON Feature."""
    ring = [*corners, corners[0]]
    return {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"name": name, **more},
    }


def wrong(answer: Any, status: int) -> dict[str, Any]:
    """Return the error of a refusal and check its shape."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    error = problem["error"]
    assert set(error) == {"code", "message", "where"}
    assert (problem["status"], problem["detail"]) == (status, error["message"])
    assert problem["type"] == "about:blank" and problem["title"] == HTTPStatus(status).phrase
    return dict(error)


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


@pytest.mark.parametrize(
    ("x", "y", "says"), [(9900, 0, "too far away"), (4.0, 2.5, "inside an obstacle")]
)
def test_a_goal_that_is_no_place_to_stand_is_refused_and_the_queue_stays(
    client: httpx.Client, x: float, y: float, says: str
) -> None:
    client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0})
    assert says in wrong(client.post("/api/v1/goals", json={"x_m": x, "y_m": y}), 422)["message"]
    assert len(client.get("/api/v1/goals").json()["queue"]) == 1


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


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/api/v1/zones/none"),
        ("DELETE", "/api/v1/zones/none"),
        ("PUT", "/api/v1/zones/none"),
        ("DELETE", "/api/v1/goals/77"),
        ("PATCH", "/api/v1/beware/unicorn"),
        ("GET", "/api/v1/runs/none"),
        ("GET", "/nowhere"),
    ],
)
def test_what_does_not_exist_is_said_to_be_missing(
    client: httpx.Client, method: str, path: str
) -> None:
    body = {"PUT": zone(), "PATCH": {"enabled": False}}.get(method)
    wrong(client.request(method, path, json=body), 404)


def test_a_store_that_fails_is_a_503_with_its_reason(
    client: httpx.Client, operations: FakeOperations
) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise StorageFailed("the disk is full; nothing was changed")

    operations.zones.add = fail  # type: ignore[method-assign]
    assert "disk is full" in wrong(client.post("/api/v1/zones", json=zone()), 503)["message"]


def test_switching_the_colour_rule_off_and_on_changes_the_map_and_the_path(
    client: httpx.Client,
) -> None:
    client.post("/api/v1/goals", json={"x_m": 3, "y_m": 0.0})
    pictures, lengths = [], []
    for enabled in (True, False, True):
        listed = client.patch("/api/v1/beware/red floor", json={"enabled": enabled}).json()
        assert listed["classes"][0]["enabled"] is enabled
        pictures.append(client.get("/api/v1/map.png").content)
        lengths.append(client.get("/api/v1/state").json()["distance_to_goal_m"])
    assert pictures[0] == pictures[2] != pictures[1]
    assert lengths[0] == lengths[2] > lengths[1]


def test_the_beware_list_is_read_replaced_and_guarded_by_its_version(client: httpx.Client) -> None:
    listed = client.get("/api/v1/beware")
    body = listed.json()
    body["classes"][1]["margin_m"] = 0.4
    assert (
        client.put(
            "/api/v1/beware", json=body, headers={"If-Match": listed.headers["etag"]}
        ).json()["version"]
        == 1
    )
    late = client.put("/api/v1/beware", json=body, headers={"If-Match": listed.headers["etag"]})
    assert (
        wrong(late, 409)["code"] == "outdated"
        and late.json()["stored"]["classes"][1]["margin_m"] == 0.4
    )
    body["classes"][1]["name"] = body["classes"][0]["name"]
    assert "more than once" in wrong(client.put("/api/v1/beware", json=body), 422)["message"]
    rule = {"colour": {"hue_deg": [10, 20]}, "margin_m": 0.2}
    entry = client.patch("/api/v1/beware/book", json=rule).json()["classes"][1]
    assert entry["colour"]["hue_deg"] == [10, 20] and entry["margin_m"] == 0.2


def test_an_edit_of_one_class_is_guarded_by_the_lists_version_too(client: httpx.Client) -> None:
    seen = {"If-Match": client.get("/api/v1/beware").headers["etag"]}
    first = client.patch("/api/v1/beware/cup", json={"min_confidence": 0.7}, headers=seen)
    assert (first.status_code, first.headers["etag"]) == (200, '"1"')
    late = client.patch("/api/v1/beware/cup", json={"min_confidence": 0.1}, headers=seen)
    assert wrong(late, 409)["code"] == "outdated" and late.json()["stored_version"] == 1
    assert client.get("/api/v1/beware").json()["classes"][2]["min_confidence"] == 0.7


def test_each_class_says_what_finds_it_and_what_may_be_absent_can_be_taken_away(
    client: httpx.Client,
) -> None:
    found = {
        entry["name"]: entry["found_by"] for entry in client.get("/api/v1/beware").json()["classes"]
    }
    assert (found["red floor"], found["cable"]) == ("colour rule", "nothing")
    named = client.patch(
        "/api/v1/beware/cup", json={"label": "Tasse", "min_height_m": 0.08}
    ).json()["classes"][2]
    assert (named["name"], named["label"], named["min_height_m"]) == ("cup", "Tasse", 0.08)
    bare = client.patch(
        "/api/v1/beware/cup", json={"label": None, "colour": None, "enabled": None}
    ).json()["classes"][2]
    assert (bare["label"], bare["colour"], bare["enabled"], bare["min_height_m"]) == (
        None,
        None,
        True,
        0.08,
    )
    assert bare["found_by"] == "nothing"
    long = client.patch("/api/v1/beware/cable", json={"min_size_m": 0.4}).json()["classes"][4]
    assert (long["name"], long["min_size_m"]) == ("cable", 0.4)
    assert (
        client.patch("/api/v1/beware/cable", json={"min_size_m": None}).json()["classes"][4][
            "min_size_m"
        ]
        is None
    )


def test_the_list_as_a_file_is_the_list(
    client: httpx.Client, operations: FakeOperations, tmp_path: Path
) -> None:
    for label in ('Tasse "é" \\ 1', "kopje – 茶碗"):
        assert client.patch("/api/v1/beware/cup", json={"label": label}).status_code == 200
        answer = client.get("/api/v1/beware.toml")
        (tmp_path / "list.toml").write_bytes(answer.content)
        assert load_beware_list(tmp_path / "list.toml").classes == operations.beware.list.classes


def test_the_state_says_what_labels_the_pictures_and_when_it_is_not_what_it_should_be(
    client: httpx.Client, operations: FakeOperations
) -> None:
    assert client.get("/api/v1/state").json()["segmenter_warning"] is None
    operations.segmenter_warning = "The network does not run: the weights are damaged"
    state = client.get("/api/v1/state").json()
    assert (state["segmenter"], state["segmenter_warning"]) == (
        "colour rules",
        operations.segmenter_warning,
    )


def test_the_overlay_is_stronger_where_the_segmenter_is_surer_and_silent_where_it_does_not_bind(
    operations: FakeOperations,
) -> None:
    picture = operations.picture()
    assert picture is not None
    beware, labelled = operations.beware.list, picture.labels == 1

    def tint(confidence: float, listed: BewareList) -> float:
        sure = np.full(picture.labels.shape, confidence, dtype=np.float32)
        drawn = with_overlay(
            dataclasses.replace(picture, rgb=np.zeros_like(picture.rgb), confidence=sure), listed
        )
        return float(drawn[labelled].mean())

    assert tint(1.0, beware) > tint(0.6, beware) > 5
    assert tint(0.4, beware) == tint(1.0, beware.edited("red floor", enabled=False)) == 0
    np.testing.assert_array_equal(beware_mask(picture, beware), labelled)
    assert not beware_mask(picture, beware.edited("red floor", min_confidence=0.95)).any()


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


def test_the_map_follows_the_conventions_of_nav2(
    client: httpx.Client, operations: FakeOperations
) -> None:
    yaml = client.get("/api/v1/map.yaml").text
    assert (
        "resolution: 0.1\n" in yaml
        and "origin: [-8.0, -6.0, 0.0]" in yaml
        and "image: map.pgm" in yaml
    )
    image = cv2.imdecode(
        np.frombuffer(client.get("/api/v1/map.pgm").content, np.uint8), cv2.IMREAD_UNCHANGED
    )
    picture = operations.picture()
    assert picture is not None and image is not None
    upright = image[::-1]
    assert set(np.unique(image)) == {0, 205, 254}
    assert ((upright == 0) == picture.grid.occupied()).all()
    assert ((upright == 205) == ~picture.seen & ~picture.grid.occupied()).all()
    # An unknown cell must stay unknown under the thresholds written beside it.
    assert 0.196 < (255 - 205) / 255 < 0.65


def test_an_empty_beware_list_needs_force_and_the_defaults_come_back(
    client: httpx.Client, operations: FakeOperations
) -> None:
    shipped = operations.beware.list.classes
    refused = wrong(client.put("/api/v1/beware", json={"classes": []}), 409)
    assert refused["code"] == "needs_force"
    assert "the beware list would be empty" in refused["message"]
    assert operations.beware.list.classes == shipped
    assert operations.state().beware_enabled == sum(entry.enabled for entry in shipped)
    emptied = client.put("/api/v1/beware?force=true", json={"classes": []})
    assert emptied.status_code == 200 and emptied.json()["classes"] == []
    assert client.get("/api/v1/state").json()["beware_enabled"] == 0
    restored = client.post("/api/v1/beware/defaults").json()
    assert (
        operations.beware.list.classes == shipped
        and restored["version"] == emptied.json()["version"] + 1
    )


def test_a_ready_made_list_is_taken_by_name(client: httpx.Client) -> None:
    preview = {"ready_made": "outdoor"}
    changes = client.post("/api/v1/beware/preview", json=preview).json()["changes"]
    taken = client.post("/api/v1/beware/defaults?name=outdoor").json()["classes"]
    on = {entry["name"] for entry in taken if entry["enabled"]}
    assert "landmine" in on and "keyboard" not in on
    assert any("keyboard" in change for change in changes)
    wrong(client.post("/api/v1/beware/defaults?name=kitchen"), 422)
    wrong(client.post("/api/v1/beware/preview", json={"ready_made": "kitchen"}), 422)


def test_edits_of_the_beware_list_are_undone_one_by_one(
    client: httpx.Client, operations: FakeOperations
) -> None:
    shipped = operations.beware.list.classes
    assert not client.get("/api/v1/beware").json()["can_undo"]
    assert "no edit" in wrong(client.post("/api/v1/beware/undo"), 409)["message"]
    client.patch("/api/v1/beware/cup", json={"margin_m": 0.3})
    client.patch("/api/v1/beware/cup", json={"enabled": False})
    client.put("/api/v1/beware?force=true", json={"classes": []})
    cup = client.post("/api/v1/beware/undo").json()["classes"][2]
    assert (cup["name"], cup["margin_m"], cup["enabled"]) == ("cup", 0.3, False)
    assert client.post("/api/v1/beware/undo").json()["classes"][2]["enabled"]
    last = client.post("/api/v1/beware/undo")
    assert operations.beware.list.classes == shipped and not last.json()["can_undo"]
    assert last.json()["version"] == 6 and last.headers["etag"] == '"6"'


def test_the_painted_map_tells_its_layers_apart(client: httpx.Client) -> None:
    client.post("/api/v1/zones", json=zone())
    data = np.frombuffer(client.get("/api/v1/map.png").content, np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    assert image is not None and image.shape == (2 * SPEC.rows, 2 * SPEC.cols, 4)

    def colours(x: float, y: float) -> frozenset[tuple[int, ...]]:
        row, col = SPEC.cell(x, y)
        top = 2 * (SPEC.rows - 1 - row)
        block = image[top - 6 : top + 6, 2 * col - 6 : 2 * col + 6].reshape(-1, 4)
        return frozenset(tuple(int(value) for value in pixel) for pixel in block)

    places = {
        "free": (-6, 3),
        "unknown": (6, -3),
        "wall": (4, 2.5),
        "red": (-0.5, 0),
        "zone": (4.5, 0),
        "near": (1.1, -4),
    }
    seen = {name: colours(*at) for name, at in places.items()}
    assert len(set(seen.values())) == len(places)
    # The hatched ones can be told by their texture, not by their colour alone.
    assert (
        len(seen["red"]) > 1
        and len(seen["zone"]) > 1
        and len(seen["unknown"]) > 1
        and len(seen["free"]) == 1
    )


def test_an_unchanged_map_is_not_sent_twice(client: httpx.Client) -> None:
    first = client.get("/api/v1/map.png")
    again = client.get("/api/v1/map.png", headers={"If-None-Match": first.headers["etag"]})
    assert again.status_code == 304 and again.content == b""


def test_the_cloud_is_a_ply_file_other_programs_read(
    client: httpx.Client, operations: FakeOperations
) -> None:
    cloud = operations.cloud()
    assert cloud is not None
    read: Any = trimesh.load(io.BytesIO(client.get("/api/v1/cloud.ply").content), file_type="ply")
    assert np.allclose(read.vertices, cloud.points_map) and (read.colors[:, :3] == cloud.rgb).all()


def test_the_camera_shows_what_was_recognised_only_when_asked(client: httpx.Client) -> None:
    plain, labelled = (
        client.get(f"/api/v1/camera.jpg{query}") for query in ("", "?overlay=segmentation")
    )
    assert plain.headers["content-type"] == labelled.headers["content-type"] == "image/jpeg"
    answers = [np.frombuffer(answer.content, np.uint8) for answer in (plain, labelled)]
    first, second = (
        np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=int) for data in answers
    )
    difference = np.abs(first - second).max(axis=2)
    assert difference[115:145, 130:210].mean() > 8 and difference[:80].max() < 8
    wrong(client.get("/api/v1/camera.jpg?overlay=everything"), 422)


def test_the_objects_in_the_camera_image_are_listed_with_their_boxes_for_a_page_that_names_them(
    client: httpx.Client, operations: FakeOperations
) -> None:
    answer = client.get("/api/v1/camera/labels").json()
    (label,) = answer["labels"]
    assert (label["name"], label["class_id"]) == ("red floor", 1)
    assert label["confidence"] == pytest.approx(0.9)
    assert label["box"] == pytest.approx((120 / 320, 110 / 180, 220 / 320, 150 / 180))
    tinted, named = (
        client.get(f"/api/v1/camera.jpg?overlay={overlay}").content
        for overlay in ("tint", "segmentation")
    )
    assert tinted != named
    operations.beware.edit("red floor", {"enabled": False})
    assert client.get("/api/v1/camera/labels").json()["labels"] == []


def test_before_the_first_tick_every_file_is_refused_with_the_reason(
    client: httpx.Client, operations: FakeOperations
) -> None:
    operations.picture = lambda: None  # type: ignore[method-assign]
    operations.cloud = lambda: None  # type: ignore[method-assign]
    for name in ("map", "map.png", "map.pgm", "map.yaml", "cloud.ply", "path", "camera.jpg"):
        assert "yet" in wrong(client.get(f"/api/v1/{name}"), 404)["message"]
    assert client.get("/api/v1/state").json()["grid_version"] is None


def test_reports_with_figures_that_are_none_are_still_json(client: httpx.Client) -> None:
    assert client.get("/api/v1/runs").json() == [
        {"id": "run-1", "scenario": "fake hall", "success": True, "spl": None}
    ]
    assert client.get("/api/v1/runs/run-1").json()["series"]["t_s"] == [0.0, 1.0, 2.0]


def test_health_and_metrics_read_the_state(client: httpx.Client) -> None:
    assert client.get("/healthz").json()["status"] == "ok"
    client.post("/api/v1/stop")
    metrics = client.get("/metrics").text
    assert (
        "\nbewarenav_stop_latched 1.0\n" in metrics
        and '\nbewarenav_phase{phase="idle"} 1.0\n' in metrics
    )
    assert all(
        line.startswith("#") or len(line.split(" ")) == 2 for line in metrics.strip().split("\n")
    )


def test_the_contract_is_in_the_openapi_document(client: httpx.Client) -> None:
    document = client.get("/openapi.json").json()
    routes = {
        (method.upper(), path) for path, methods in document["paths"].items() for method in methods
    }
    v1 = "/api/v1"
    expected = {
        ("GET", "/healthz"),
        ("GET", "/metrics"),
        ("GET", f"{v1}/state"),
        ("GET", f"{v1}/goals"),
        ("POST", f"{v1}/goals"),
    }
    expected |= {
        ("DELETE", f"{v1}/goals/{{goal_id}}"),
        ("POST", f"{v1}/mission/{{action}}"),
        ("POST", f"{v1}/preview"),
    }
    expected |= {(method, f"{v1}/zones") for method in ("GET", "POST")}
    expected |= {(method, f"{v1}/zones/{{zone_id}}") for method in ("GET", "PUT", "DELETE")}
    expected |= {
        ("GET", f"{v1}/beware"),
        ("PUT", f"{v1}/beware"),
        ("PATCH", f"{v1}/beware/{{class_name}}"),
    }
    expected |= {("POST", f"{v1}/beware/defaults"), ("POST", f"{v1}/beware/undo")}
    expected |= {("GET", f"{v1}/beware.toml")}
    expected |= {
        ("POST", f"{v1}/stop"),
        ("POST", f"{v1}/stop/reset"),
        ("GET", f"{v1}/runs"),
        ("GET", f"{v1}/runs/{{run_id}}"),
    }
    names = ("map.png", "map.yaml", "map.pgm", "cloud.ply", "path", "camera.jpg")
    expected |= {("GET", f"{v1}/{name}") for name in names}
    assert expected <= routes
    operations = [
        operation for methods in document["paths"].values() for operation in methods.values()
    ]
    assert all(operation.get("description") for operation in operations)
    schemas = document["components"]["schemas"]
    assert (
        "where" in schemas["ProblemBody"]["properties"]
        and "error" in schemas["Problem"]["required"]
    )
    refused = [
        answer["content"]
        for operation in operations
        for status, answer in operation["responses"].items()
        if status.startswith(("4", "5"))
    ]
    shape = {"schema": {"$ref": "#/components/schemas/Problem"}}
    assert refused and all(one == {"application/problem+json": shape} for one in refused)


def test_the_events_bring_the_state_at_once_and_again_on_a_change(
    server: ConsoleServer, operations: FakeOperations
) -> None:
    with connect(server.url.replace("http", "ws") + "/api/v1/events", proxy=None) as socket:
        first = json.loads(socket.recv(timeout=60))
        assert first["type"] == "state" and not first["stop_latched"]
        operations.stop("test")
        assert any(json.loads(socket.recv(timeout=60))["stop_latched"] for _ in range(3))


def test_pages_come_from_the_console_itself_and_ask_nothing_of_the_network(
    client: httpx.Client,
) -> None:
    for path, kind in (
        ("/", "text/html"),
        ("/docs", "text/html"),
        ("/page/app.js", "text/javascript"),
        ("/page/styles/base.css", "text/css"),
    ):
        answer = client.get(path)
        assert answer.status_code == 200 and answer.headers["content-type"].startswith(kind)
        assert "https://" not in answer.text and "http://" not in answer.text.replace(
            "http://www.w3.org", ""
        )
    assert (
        client.get("/page/__init__.py").status_code
        == client.get("/page/..%2fserver.py").status_code
        == 404
    )


def test_a_program_puts_past_poses_right_and_an_unknown_one_moves_nothing(
    client: httpx.Client,
) -> None:
    second = client.get("/api/v1/map/poses").json()["poses"][1]
    assert second == {"id": 1, "x_m": -5.0, "y_m": 0.0, "yaw_rad": 0.0}
    moved = {**second, "x_m": -4.9, "yaw_rad": 0.01}
    unknown = wrong(
        client.patch("/api/v1/map/poses", json={"poses": [moved, {**moved, "id": 7}]}), 422
    )
    assert "pose ID 7 is not on the map" in unknown["message"]
    assert client.get("/api/v1/map/poses").json()["poses"][1] == second
    assert client.patch("/api/v1/map/poses", json={"poses": [moved]}).status_code == 204
    assert client.get("/api/v1/map/poses").json()["poses"][1] == moved


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


def test_every_field_of_what_is_served_is_described(client: httpx.Client) -> None:
    schemas = client.get("/openapi.json").json()["components"]["schemas"]
    assert {"State", "Goal", "ListedClass", "MapOut", "SightingOut", "Explanation"} <= set(schemas)
    silent = {
        f"{name}.{field}"
        for name, schema in schemas.items()
        for field, entry in schema.get("properties", {}).items()
        if "description" not in entry
    }
    assert silent == set()


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


def test_a_map_that_grows_says_so_in_the_state_the_map_and_all_its_tiles(
    client: httpx.Client, operations: FakeOperations
) -> None:
    def spec_of(answer: dict[str, Any]) -> GridSpec:
        return GridSpec(**{name: answer[name] for name in SPEC.__dataclass_fields__})

    tiles = client.get("/api/v1/map/tiles").json()
    assert spec_of(client.get("/api/v1/state").json()["grid_spec"]) == SPEC
    operations.grow(-30.0, 3.0)
    now = spec_of(client.get("/api/v1/state").json()["grid_spec"])
    assert (now.cols, now.rows) == (SPEC.cols + 256, SPEC.rows) and now.contains(-30.0, 3.0)
    assert spec_of(client.get("/api/v1/map").json()) == now
    later = client.get(f"/api/v1/map/tiles?since={tiles['version']}").json()
    assert (later["rows"], later["cols"]) == (now.rows, now.cols)
    assert {(row, col) for row, col, _ in later["changed"]} == {(0, 0), (0, 1)}
    # What was in the first tile is in the second one now.
    image = client.get("/api/v1/map/tiles/0/1.png").content
    cells = cv2.imdecode(np.frombuffer(image, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert cells is not None and cells.shape == (SPEC.rows, SPEC.cols, 3)
    assert (np.asarray(cells, dtype=np.uint8)[..., 2] & 2).any()
    assert client.get("/api/v1/map.yaml").text.count(f"{now.origin_x_m:g}") == 1
    assert client.post("/api/v1/goals", json={"x_m": -30.0, "y_m": 3.0}).status_code == 201


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
