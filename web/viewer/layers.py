"""What the robot knows and does: floor grid, body, camera, paths."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import viser
import viser.transforms

from navcore.transform import Pose2
from web import palette
from web.pictures import overlaid, paint_floor
from web.viewer.layer import Snapshot
from web.viewer.shapes import ribbon

FLOOR_Z, DRIVEN_Z, PATH_Z = 0.0, 0.03, 0.05
FRUSTUM_WIDTH_PX = 320
FRUSTUM_SCALE = 0.45
MAX_DRIVEN = 1500

Floats = npt.NDArray[np.float64]


class FloorLayer:
    """The occupancy grid as a picture on the floor."""

    name = "floor"
    period_s = 0.35

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._image: Any = None
        self._shown: object = None

    def push(self, snapshot: Snapshot) -> None:
        """A new picture when a cell, the list or a zone changed."""
        picture, spec = snapshot.picture, snapshot.picture.grid.spec
        key = (picture.grid_version, snapshot.beware.version)
        if key == self._shown:
            return
        image = paint_floor(picture, snapshot.beware)
        if self._image is None:
            width, height = spec.cols * spec.resolution_m, spec.rows * spec.resolution_m
            middle = (spec.origin_x_m + width / 2, spec.origin_y_m + height / 2, FLOOR_Z)
            # Pictures lie with their rows going down, −y; half a turn about x lays them face up on the floor.
            self._image = self._server.scene.add_image(
                "/floor/grid",
                image,
                width,
                height,
                format="png",
                cast_shadow=False,
                receive_shadow=False,
                position=middle,
                wxyz=(0.0, 1.0, 0.0, 0.0),
            )
        else:
            self._image.image = image
        self._shown = key


class RobotLayer:
    """The robot's body where odometry says it stands, with its state in words above it."""

    name = "robot"
    period_s = 0.0

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._frame = server.scene.add_frame("/robot/base", show_axes=False)
        self._text = ""
        self._pose: Pose2 | None = None

    def push(self, snapshot: Snapshot) -> None:
        """Move it, and say what it does."""
        state = snapshot.state
        why = state.reasons[0].code.replace("_", " ") if state.reasons else state.phase.value
        text = "STOPPED" if state.stop_latched else why
        if text != self._text:
            self._text = text
            self._server.scene.add_label(
                "/robot/base/state", text, position=(0.0, 0.0, 0.95), anchor="bottom-center", font_screen_scale=0.9
            )
        if state.pose != self._pose and _is_finite(state.pose):
            self._pose = state.pose
            half = state.pose.yaw_rad / 2
            with self._server.atomic():
                self._frame.position = (state.pose.x_m, state.pose.y_m, 0.0)
                self._frame.wxyz = (math.cos(half), 0.0, 0.0, math.sin(half))


class CameraLayer:
    """The camera's frustum with its picture, classes tinted, where the camera was when it took it."""

    name = "camera"
    period_s = 0.25

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._frustum: Any = None
        self._serial = -1

    def push(self, snapshot: Snapshot) -> None:
        """Picture and place in one go: one without the other would lie."""
        picture = snapshot.picture
        if picture.serial == self._serial or not np.isfinite(picture.T_map_camera).all():
            return
        self._serial = picture.serial
        wxyz = viser.transforms.SO3.from_matrix(picture.T_map_camera[:3, :3]).wxyz
        position = picture.T_map_camera[:3, 3]
        image = _shrunk(overlaid(picture, snapshot.beware))
        if self._frustum is None:
            intrinsics = picture.intrinsics
            self._frustum = self._server.scene.add_camera_frustum(
                "/camera/frustum",
                fov=2 * math.atan(intrinsics.height / 2 / intrinsics.fy),
                aspect=intrinsics.width / intrinsics.height,
                scale=FRUSTUM_SCALE,
                thickness=0.012,
                color=palette.DRAFT,
                image=image,
                format="jpeg",
                jpeg_quality=70,
                wxyz=wxyz,
                position=position,
                cast_shadow=False,
            )
            return
        with self._server.atomic():
            self._frustum.image = image
            self._frustum.wxyz = wxyz
            self._frustum.position = position


class PathLayer:
    """Planned path with its waypoints, and the way driven."""

    name = "path"
    period_s = 0.15

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._lines = {name: _Line(server, f"/path/{name}") for name in ("planned", "driven")}
        self._waypoints: Any = None
        self._shown: Floats = np.empty((0, 2))

    def push(self, snapshot: Snapshot) -> None:
        """Each part when it changed."""
        picture = snapshot.picture
        with self._server.atomic():
            self._lines["planned"].show(picture.path, PATH_Z, palette.PATH, 0.1)
            self._push_waypoints(picture.waypoints)
        driven = picture.driven
        if len(driven) > MAX_DRIVEN:
            driven = driven[np.linspace(0, len(driven) - 1, MAX_DRIVEN).round().astype(int)]
        self._lines["driven"].show(driven, DRIVEN_Z, palette.DRIVEN, 0.05)

    def _push_waypoints(self, points: Floats) -> None:
        if np.array_equal(points, self._shown):
            return
        self._shown = points
        if self._waypoints is not None:
            self._waypoints.remove()
            self._waypoints = None
        finite = points[np.isfinite(points).all(axis=1)]
        if len(finite):
            self._waypoints = self._server.scene.add_point_cloud(
                "/path/waypoints",
                np.column_stack([finite, np.full(len(finite), 0.12)]),
                palette.PATH,
                point_size=0.13,
                point_shape="diamond",
                precision="float32",
            )


class _Line:
    """A polyline near the floor, sent again only when it changed."""

    def __init__(self, server: viser.ViserServer, name: str) -> None:
        self._server, self._name = server, name
        self._node: Any = None
        self._shown: Floats = np.empty((0, 2))

    def show(self, points: Floats, z: float, colour: palette.Rgb, thickness: float) -> None:
        """(N, 2) points in metres of the map frame; fewer than two hide it."""
        if np.array_equal(points, self._shown):
            return
        self._shown = points
        finite = points[np.isfinite(points).all(axis=1)]
        if len(finite) < 2:
            if self._node is not None:
                self._node.remove()
                self._node = None
            return
        self._node = self._server.scene.add_line_segments(self._name, ribbon(finite, z), colour, thickness=thickness)


def _is_finite(pose: Pose2) -> bool:
    return math.isfinite(pose.x_m) and math.isfinite(pose.y_m) and math.isfinite(pose.yaw_rad)


def _shrunk(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    height, width = image.shape[:2]
    if width <= FRUSTUM_WIDTH_PX:
        return image
    size = (FRUSTUM_WIDTH_PX, round(height * FRUSTUM_WIDTH_PX / width))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
