"""The map, the cloud and the camera image over the API."""

from __future__ import annotations

import dataclasses
import io
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
import trimesh

from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import BewareList
from tests.web.api.answers import wrong, zone
from tests.web.fake_operations import FakeOperations
from tests.web.fake_world import SPEC
from web.images.camera import beware_mask, labels_of, with_overlay
from web.server import ConsoleServer


def test_the_overlay_is_stronger_where_the_segmenter_is_surer_and_silent_where_it_does_not_bind(
    operations: FakeOperations,
) -> None:
    picture = operations.newest_tick()
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
    labelled_so = beware.edited("red floor", label="roter Boden")
    assert {one.name for one in labels_of(picture, labelled_so)} == {"roter Boden"}


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
    picture = operations.newest_tick()
    assert picture is not None and image is not None
    upright = image[::-1]
    assert set(np.unique(image)) == {0, 205, 254}
    assert ((upright == 0) == picture.grid.occupied()).all()
    assert ((upright == 205) == ~picture.seen & ~picture.grid.occupied()).all()
    # An unknown cell must stay unknown under the thresholds written beside it.
    assert 0.196 < (255 - 205) / 255 < 0.65


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


def test_the_map_of_another_start_is_another_one(
    client: httpx.Client, operations: FakeOperations
) -> None:
    first = client.get("/api/v1/map.png").headers["etag"]
    restarted = ConsoleServer(operations, port=0)
    restarted.start()
    known = {"If-None-Match": first}
    again = httpx.get(f"{restarted.url}/api/v1/map.png", headers=known, trust_env=False)
    restarted.stop()
    assert again.status_code == 200 and again.content


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
    operations.newest_tick = lambda: None  # type: ignore[method-assign]
    operations.cloud = lambda: None  # type: ignore[method-assign]
    for name in ("map", "map.png", "map.pgm", "map.yaml", "cloud.ply", "path", "camera.jpg"):
        assert "yet" in wrong(client.get(f"/api/v1/{name}"), 404)["message"]
    assert client.get("/api/v1/state").json()["grid_version"] is None


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


def test_a_page_gets_all_tiles_from_another_start_of_the_console(
    client: httpx.Client, operations: FakeOperations
) -> None:
    before = client.get("/api/v1/map/tiles").json()
    same = client.get(f"/api/v1/map/tiles?since={before['version']}").json()
    assert before["changed"] and same["changed"] == []
    restarted = ConsoleServer(operations, port=0)
    restarted.start()
    try:
        for _ in range(2):
            url = f"{restarted.url}/api/v1/map/tiles?since={before['version']}"
            after = httpx.get(url, trust_env=False, timeout=60.0).json()
            told = [tile[:2] for tile in after["changed"]]
            assert told == [tile[:2] for tile in before["changed"]]
    finally:
        restarted.stop()


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
    assert spec_of(later) == now, "cells and frame are of one tick"
    assert {(row, col) for row, col, _ in later["changed"]} == {(0, 0), (0, 1)}
    # What was in the first tile is in the second one now.
    image = client.get("/api/v1/map/tiles/0/1.png").content
    cells = cv2.imdecode(np.frombuffer(image, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert cells is not None and cells.shape == (SPEC.rows, SPEC.cols, 3)
    assert (np.asarray(cells, dtype=np.uint8)[..., 2] & 2).any()
    assert client.get("/api/v1/map.yaml").text.count(f"{now.origin_x_m:g}") == 1
    assert client.post("/api/v1/goals", json={"x_m": -30.0, "y_m": 3.0}).status_code == 201
