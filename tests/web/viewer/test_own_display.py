"""Each page has its own layers, colours and camera in the 3D view."""

from __future__ import annotations

import json
import math
import time
from typing import Any

import numpy as np
import pytest
import viser.transforms
from hypothesis import given
from hypothesis import strategies as st
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from app.bench.console.viser_client import camera, messages_in
from navcore.geometry.transform import Pose2
from tests.web.fake_operations import FakeOperations
from tests.web.test_server import viewer_of
from web.server import ConsoleServer
from web.viewer.camera import FOLLOWED_M, follow
from web.viewer.picking import floor_point, pixel_ray
from web.viewer.viewer import Viewer

ANNA, BERT = "a" * 16, "b" * 16


def page_of(server: ConsoleServer, page_id: str) -> Connection:
    """Connect as the console page around a viewer."""
    return connect(server.url.replace("http", "ws") + f"/api/v1/viewer/{page_id}", proxy=None)


def visibility(viewer: Connection, wanted: dict[str, bool]) -> dict[str, bool]:
    """Read frames until the client's own nodes are as visible as wanted; returns what they are."""
    shown: dict[str, bool] = {}
    while any(shown.get(name) is not visible for name, visible in wanted.items()):
        for message in received(viewer):
            if message.get("type") == "SetSceneNodeVisibilityMessage" and message["owner"]:
                shown[message["name"]] = message["visible"]
    return shown


def received(viewer: Connection, timeout_s: float = 10.0) -> list[dict[str, Any]]:
    """Return the messages of the next frame."""
    frame = viewer.recv(timeout=timeout_s)
    assert isinstance(frame, bytes)
    return messages_in(frame)


def show(page: Connection, *hidden: str, colour: str = "camera") -> None:
    page.send(json.dumps({"type": "show", "cloud_colour": colour, "hidden": hidden}))


def test_a_layer_that_one_operator_hides_stays_in_the_view_of_another(
    server: ConsoleServer,
) -> None:
    with (
        page_of(server, ANNA) as anna,
        viewer_of(server, f"/viewer/{ANNA}") as of_anna,
        viewer_of(server, f"/viewer/{BERT}") as of_bert,
    ):
        of_anna.send(camera())
        of_bert.send(camera())
        begin = {"/candidates": False, "/cloud/height": False, "/cloud/class": False}
        visibility(of_anna, begin)
        visibility(of_bert, begin)
        show(anna, "floor", "zones", colour="height")
        shown = visibility(
            of_anna,
            {"/floor": False, "/zones": False, "/candidates": True, "/cloud/height": True}
            | {"/cloud/camera": False},
        )
        assert shown.get("/goals") is not False
        with pytest.raises(TimeoutError):
            while True:
                for message in received(of_bert, 1.0):
                    if message["type"] == "SetSceneNodeVisibilityMessage" and message["owner"]:
                        assert message["visible"] is begin.get(message["name"], True)


def test_a_page_has_its_layers_again_in_a_view_that_is_made_later(server: ConsoleServer) -> None:
    with page_of(server, ANNA) as anna:
        show(anna, "people", "candidates")
        with viewer_of(server, f"/viewer/{ANNA}") as late:
            late.send(camera())
            shown = visibility(late, {"/people": False, "/candidates": False})
            assert shown.get("/floor") is not False


def test_the_page_learns_which_floor_is_below_its_pointer(server: ConsoleServer) -> None:
    with page_of(server, ANNA) as anna, viewer_of(server, f"/viewer/{ANNA}") as viewer:
        viewer.send(camera())
        while json.loads(anna.recv(timeout=60)) != {"type": "viewer", "connected": True}:
            pass
        anna.send(json.dumps({"type": "pointer", "phase": "down", "right": 0.5, "down": 0.5}))
        answer = json.loads(anna.recv(timeout=60))
        assert answer["type"] == "pointer" and answer["phase"] == "down"
        x, y = answer["place"]
        assert math.isfinite(x + y)
        anna.send(json.dumps({"type": "pointer", "phase": "up", "right": 0.5, "down": 0.5}))
        assert json.loads(anna.recv(timeout=60)) == {**answer, "phase": "up"}


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-8, 8), st.floats(-8, 8))
def test_the_ray_of_a_pixel_meets_the_floor_at_the_point_that_is_drawn_there(
    eye_x: float, eye_y: float, dx: float, dy: float
) -> None:
    """The point is projected into an image of 800 × 400 by a camera that looks at it askew."""
    eye, point = np.array([eye_x, eye_y, 5.0]), np.array([eye_x + dx, eye_y + dy, 0.0])
    forward = point + np.array([0.3, -0.2, 0.4]) - eye
    z = forward / np.linalg.norm(forward)
    x = np.cross(z, [0.1, 0.2, 1.0])
    x /= np.linalg.norm(x)
    R_map_camera = np.column_stack([x, np.cross(z, x), z])
    right, down, ahead = R_map_camera.T @ (point - eye)
    fov_rad, aspect = 1.1, 2.0
    reach = ahead * math.tan(fov_rad / 2)
    shares = ((right / (reach * aspect) + 1) / 2, (down / reach + 1) / 2)
    wxyz = viser.transforms.SO3.from_matrix(R_map_camera).wxyz
    found = floor_point(eye.tolist(), pixel_ray(wxyz.tolist(), fov_rad, aspect, *shares))
    assert found is not None and np.allclose(found, point[:2], atol=1e-6)


class Lens:
    """Camera whose target moves with it, as viser's does."""

    def __init__(self) -> None:
        self.look_at, self._position = np.array([1.0, 1.0, 0.0]), np.array([1.0, -3.0, 4.0])
        self.moves = 0

    @property
    def position(self) -> Any:
        return self._position

    @position.setter
    def position(self, position: Any) -> None:
        self.look_at = self.look_at + position - self._position
        self._position = position
        self.moves += 1


def test_a_camera_that_follows_looks_at_the_robot_from_the_same_side() -> None:
    lens: Any = Lens()
    follow(lens, Pose2(x_m=4.0, y_m=2.0, yaw_rad=1.0))
    assert lens.look_at.tolist() == [4.0, 2.0, 0.0] and lens.position.tolist() == [4.0, -2.0, 4.0]
    follow(lens, Pose2(x_m=4.0 + FOLLOWED_M / 2, y_m=2.0, yaw_rad=1.0))
    follow(lens, Pose2(x_m=math.nan, y_m=2.0, yaw_rad=1.0))
    assert lens.moves == 1


def test_the_view_of_a_page_that_follows_moves_with_the_robot_and_no_other(
    server: ConsoleServer, operations: FakeOperations
) -> None:
    with (
        page_of(server, ANNA) as anna,
        viewer_of(server, f"/viewer/{ANNA}") as of_anna,
        viewer_of(server, f"/viewer/{BERT}") as of_bert,
    ):
        of_anna.send(camera())
        of_bert.send(camera())
        anna.send(json.dumps({"type": "show", "follows": True}))
        kind = "SetCameraPositionMessage"
        while not any(one["type"] == kind for one in received(of_anna)):
            pass
        with pytest.raises(TimeoutError):
            while True:
                moves = [one for one in received(of_bert, 1.0) if one["type"] == kind]
                assert all(one["initial"] for one in moves)


def test_a_view_that_is_opened_later_begins_with_what_is_known_by_then(
    operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    views = [((1.0, -2.0, 3.0), (1.0, 0.0, 0.0)), ((9.0, -8.0, 7.0), (9.0, 0.0, 0.0))]
    newest = views[0]
    monkeypatch.setattr("web.viewer.viewer.OVERVIEW_PERIOD_S", 0.0)
    monkeypatch.setattr("web.viewer.viewer.overview", lambda tick: newest)
    viewer = Viewer(operations)
    try:
        for newest in views:
            initial, until = viewer._server.initial_camera, time.monotonic() + 5.0
            while (*initial.position, *initial.look_at) != (*newest[0], *newest[1]):
                assert time.monotonic() < until
                time.sleep(0.02)
    finally:
        viewer.close()
