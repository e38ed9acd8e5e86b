"""Body, camera and paths of the robot."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import viser
import viser.transforms

from navcore.geometry.transform import Pose2
from navcore.mission.mission import Phase
from web.images import palette
from web.images.camera import with_overlay
from web.interface.snapshots import State
from web.viewer.layers.base import Scene
from web.viewer.layers.geometry import polyline_segments

DRIVEN_Z, PATH_Z = 0.03, 0.05
"""Heights of the lines in metres."""
FRUSTUM_WIDTH_PX = 320
"""Largest width of the camera image in pixels."""
FRUSTUM_SCALE = 0.45
MAX_DRIVEN = 1500
"""Largest number of points of the driven path."""
VISIBLE_M, VISIBLE_RAD = 0.002, 0.002
"""Smallest step in metres and turn in radians that are sent."""

Floats = npt.NDArray[np.float64]


_MARKS = {Phase.IDLE: "●", Phase.DRIVING: "▶", Phase.PAUSED: "❚❚", Phase.LEAVING: "▶"}


def mark_of(state: State) -> str:
    """Return the sign of the robot's state, that of the page's status line. Without words: all
    browsers share one scene, whatever their languages."""
    if state.stop_latched:
        return "■"
    return "▲" if state.reasons and state.phase is not Phase.PAUSED else _MARKS[state.phase]


class RobotLayer:
    """Body of the robot at its pose by odometry, with a mark of its state."""

    name = "robot"
    period_s = 0.0

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._frame = server.scene.add_frame("/robot/base", show_axes=False)
        self._text = ""
        self._pose: Pose2 | None = None

    def push(self, scene: Scene) -> None:
        """Update pose and mark."""
        state, text = scene.state, mark_of(scene.state)
        if text != self._text:
            self._text = text
            self._server.scene.add_label(
                "/robot/base/state",
                text,
                position=(0.0, 0.0, 0.95),
                anchor="bottom-center",
                font_screen_scale=0.9,
            )
        if _is_finite(state.pose) and (self._pose is None or _has_moved(state.pose, self._pose)):
            self._pose = state.pose
            half = state.pose.yaw_rad / 2
            with self._server.atomic():
                self._frame.position = (state.pose.x_m, state.pose.y_m, 0.0)
                self._frame.wxyz = (math.cos(half), 0.0, 0.0, math.sin(half))


class CameraLayer:
    """Frustum of the camera with its newest image and the detected classes."""

    name = "camera"
    period_s = 0.25

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._frustum: Any = None
        self._serial = -1

    def push(self, scene: Scene) -> None:
        """Update image and pose together, because they belong together."""
        tick = scene.tick
        if tick.serial == self._serial or not np.isfinite(tick.T_map_camera).all():
            return
        self._serial = tick.serial
        wxyz = viser.transforms.SO3.from_matrix(tick.T_map_camera[:3, :3]).wxyz
        position = tick.T_map_camera[:3, 3]
        image = _shrunk(with_overlay(tick, scene.beware))
        if self._frustum is None:
            intrinsics = tick.intrinsics
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
    """Planned path, its waypoints, and the driven path: three layers of one class."""

    name = "path"
    period_s = 0.15

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._planned = _Line(server, "/path/planned", PATH_Z, palette.PATH, 0.1)
        self._driven = _Line(server, "/driven/line", DRIVEN_Z, palette.DRIVEN, 0.05)
        self._waypoints: Any = None
        self._shown: Floats = np.empty((0, 2))

    def push(self, scene: Scene) -> None:
        """Send the changed parts."""
        tick = scene.tick
        with self._server.atomic():
            self._planned.show(tick.path)
            self._push_waypoints(tick.waypoints)
        driven = tick.driven
        if len(driven) > MAX_DRIVEN:
            driven = driven[np.linspace(0, len(driven) - 1, MAX_DRIVEN).round().astype(int)]
        self._driven.show(driven)

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
                "/waypoints/points",
                np.column_stack([finite, np.full(len(finite), 0.12)]),
                palette.PATH,
                point_size=0.13,
                point_shape="diamond",
                precision="float32",
            )


class _Line:
    """Polyline near the floor, sent only when it changed."""

    def __init__(
        self, server: viser.ViserServer, name: str, z: float, colour: palette.Rgb, thickness: float
    ) -> None:
        self._server, self._name = server, name
        self._z, self._colour, self._thickness = z, colour, thickness
        self._node: Any = None
        self._shown: Floats = np.empty((0, 2))

    def show(self, points: Floats) -> None:
        """Show (N, 2) points in metres of the map frame; fewer than two hide the line."""
        if np.array_equal(points, self._shown):
            return
        self._shown = points
        finite = points[np.isfinite(points).all(axis=1)]
        if len(finite) < 2:
            if self._node is not None:
                self._node.remove()
                self._node = None
            return
        self._node = self._server.scene.add_line_segments(
            self._name,
            polyline_segments(finite, self._z),
            self._colour,
            thickness=self._thickness,
        )


def _has_moved(pose: Pose2, shown: Pose2) -> bool:
    """Return whether the motion from the shown pose is visible; odometry at rest fluctuates."""
    turn_rad = math.remainder(pose.yaw_rad - shown.yaw_rad, math.tau)
    return (
        math.hypot(pose.x_m - shown.x_m, pose.y_m - shown.y_m) > VISIBLE_M
        or abs(turn_rad) > VISIBLE_RAD
    )


def _is_finite(pose: Pose2) -> bool:
    return math.isfinite(pose.x_m) and math.isfinite(pose.y_m) and math.isfinite(pose.yaw_rad)


def _shrunk(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    height, width = image.shape[:2]
    if width <= FRUSTUM_WIDTH_PX:
        return image
    size = (FRUSTUM_WIDTH_PX, round(height * FRUSTUM_WIDTH_PX / width))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
