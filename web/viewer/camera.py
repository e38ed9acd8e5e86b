"""Views of the cameras of the 3D view, and the floor below a pointer."""

from __future__ import annotations

import math

import numpy as np
import viser

from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from web.interface.snapshots import TickSnapshot
from web.viewer.messages import CameraMove, Pointer
from web.viewer.picking import Point, floor_point, pixel_ray

FOLLOWED_M = 0.03
"""Least distance in metres of the robot from the middle of the view that moves a camera."""
Place = tuple[float, float, float]


def view_of(
    move: CameraMove, tick: TickSnapshot, pose: Pose2, lens: viser.CameraHandle
) -> tuple[Place, Place]:
    """Return eye and target of a view that the operator asks for."""
    if move.at == "place" and move.place is not None:
        x, y = move.place
        return (x, y - 3.5, 4.0), (x, y, 0.0)
    if move.at == "robot" and math.isfinite(pose.x_m + pose.y_m + pose.yaw_rad):
        x, y, cos, sin = pose.x_m, pose.y_m, math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        return (x - 2.8 * cos - 1.2 * sin, y - 2.8 * sin + 1.2 * cos, 2.2), (x + cos, y + sin, 0.0)
    return overview(tick) if move.at == "overview" else _top(tick.grid_spec, lens.fov, lens.aspect)


def follow(camera: viser.CameraHandle, pose: Pose2) -> None:
    """Move a camera sideways until it looks at the robot."""
    if not math.isfinite(pose.x_m + pose.y_m):
        return
    offset = np.array([pose.x_m, pose.y_m, 0.0]) - camera.look_at * [1.0, 1.0, 0.0]
    if math.hypot(*offset) > FOLLOWED_M:
        camera.position = camera.position + offset


def floor_below(pointer: Pointer, camera: viser.CameraHandle) -> Point | None:
    """Return the point (x, y) on the floor below a pointer; None above the horizon."""
    direction = pixel_ray(
        camera.wxyz.tolist(), camera.fov, camera.aspect, pointer.right, pointer.down
    )
    return floor_point(camera.position.tolist(), direction)


def overview(tick: TickSnapshot) -> tuple[Place, Place]:
    """Return eye and target of a view from −y onto the observed area."""
    spec = tick.grid_spec
    rows, cols = (np.flatnonzero(tick.seen.any(axis=axis)) for axis in (1, 0))
    x, y, width, height = _extent(spec)
    if len(rows):
        corners = spec.centres(np.array([[rows[0], cols[0]], [rows[-1], cols[-1]]]))
        (x, y), (width, height) = corners.mean(axis=0).tolist(), np.ptp(corners, axis=0).tolist()
    away = min(max(width, 1.3 * height, 9.0), 40.0)
    return (x - 0.1 * away, y - 0.6 * away, 0.58 * away), (x, y - 0.1 * away, 0.0)


def _top(spec: GridSpec, fov: float, aspect: float) -> tuple[Place, Place]:
    x, y, width, height = _extent(spec)
    fov, aspect = (fov if 0.1 < fov < 3 else 1.3), (aspect if 0.1 < aspect < 10 else 1.5)
    up = 1.05 * max(height, width / aspect) / 2 / math.tan(fov / 2)
    # Slightly off vertical: straight down, the up direction of the screen would be undefined.
    return (x, y - 1e-3 * up, up), (x, y, 0.0)


def _extent(spec: GridSpec) -> tuple[float, float, float, float]:
    width, height = spec.cols * spec.resolution_m, spec.rows * spec.resolution_m
    return spec.origin_x_m + width / 2, spec.origin_y_m + height / 2, width, height
