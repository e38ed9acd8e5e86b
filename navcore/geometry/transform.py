"""Poses in the plane and rigid transforms in space.

A transform is named `T_parent_child` and maps coordinates of the child frame into the parent frame,
so that neighbours cancel: `T_map_camera = T_map_base @ T_base_camera`. Frames follow REP 103/105:
base x forward, y left, z up; the optical camera frame has x right, y down and z forward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Matrix = npt.NDArray[np.float64]
"""Transform matrix, or points as rows."""


def wrap_angle(angle_rad: float) -> float:
    """Return the same angle in (−π, π]."""
    wrapped = math.pi - (math.pi - angle_rad) % (2 * math.pi)
    return math.pi if wrapped == -math.pi else wrapped


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose2:
    """Pose of a body in the floor plane of its parent frame."""

    x_m: float
    """Position along the parent's x axis in metres."""
    y_m: float
    """Position along the parent's y axis in metres."""
    yaw_rad: float
    """Heading in radians, counter-clockwise from the parent's x axis."""

    def matrix(self) -> Matrix:
        """Return (4, 4) T_parent_body with the body's origin on the floor."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.array(
            [
                [cos, -sin, 0.0, self.x_m],
                [sin, cos, 0.0, self.y_m],
                [0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )

    def __matmul__(self, child: Pose2) -> Pose2:
        """Return the composition T_a_c = T_a_b @ T_b_c."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return Pose2(
            x_m=self.x_m + cos * child.x_m - sin * child.y_m,
            y_m=self.y_m + sin * child.x_m + cos * child.y_m,
            yaw_rad=wrap_angle(self.yaw_rad + child.yaw_rad),
        )

    def inverse(self) -> Pose2:
        """Return T_body_parent."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return Pose2(
            x_m=-cos * self.x_m - sin * self.y_m,
            y_m=sin * self.x_m - cos * self.y_m,
            yaw_rad=wrap_angle(-self.yaw_rad),
        )

    def from_parent(self, points: Matrix) -> Matrix:
        """Transform (N, 2) or (2,) points from the parent frame to the body's frame."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.asarray(
            (points - np.array([self.x_m, self.y_m])) @ np.array([[cos, -sin], [sin, cos]])
        )

    def to_parent(self, points: Matrix) -> Matrix:
        """Transform (N, 2) or (2,) points from the body's frame to the parent frame."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.asarray(
            points @ np.array([[cos, sin], [-sin, cos]]) + np.array([self.x_m, self.y_m])
        )

    def distance_to(self, x_m: float, y_m: float) -> float:
        """Return the distance in metres to a point of the parent frame."""
        return math.hypot(x_m - self.x_m, y_m - self.y_m)


IDENTITY = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
"""The pose of a frame in itself."""


def camera_mount(*, x_m: float, y_m: float, z_m: float, pitch_down_rad: float) -> Matrix:
    """Return (4, 4) T_base_camera of a forward-facing optical frame, pitched down by
    `pitch_down_rad`."""
    cos, sin = math.cos(pitch_down_rad), math.sin(pitch_down_rad)
    # Columns: the optical x (right), y (down) and z (forward) axes, seen from the base.
    return np.array(
        [[0.0, -sin, cos, x_m], [-1.0, 0.0, 0.0, y_m], [0.0, -cos, -sin, z_m], [0.0, 0.0, 0.0, 1.0]]
    )


def tilt_matrix(roll_rad: float, pitch_rad: float) -> Matrix:
    """Return (4, 4) T_level_base of a body that is rolled about its x and then pitched about the
    level y axis (REP 103)."""
    (sin_r, cos_r), (sin_p, cos_p) = (
        (math.sin(angle), math.cos(angle)) for angle in (roll_rad, pitch_rad)
    )
    return np.array(
        [
            [cos_p, sin_p * sin_r, sin_p * cos_r, 0.0],
            [0.0, cos_r, -sin_r, 0.0],
            [-sin_p, cos_p * sin_r, cos_p * cos_r, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def transform_points(
    T_parent_child: Matrix, points_child: npt.NDArray[np.floating]
) -> npt.NDArray[np.float64]:
    """Transform (N, 3) points from the child frame to the parent frame."""
    return points_child @ T_parent_child[:3, :3].T + T_parent_child[:3, 3]


def invert(T_parent_child: Matrix) -> Matrix:
    """Return (4, 4) T_child_parent of a rigid transform."""
    inverse = np.eye(4)
    inverse[:3, :3] = T_parent_child[:3, :3].T
    inverse[:3, 3] = -T_parent_child[:3, :3].T @ T_parent_child[:3, 3]
    return inverse


@dataclass(frozen=True, slots=True, kw_only=True)
class Twist:
    """Planar velocity of a differential drive."""

    v_mps: float
    """Forward speed in metres per second."""
    w_radps: float
    """Yaw rate in radians per second, counter-clockwise."""


STANDSTILL = Twist(v_mps=0.0, w_radps=0.0)


def growth(now: Matrix, then: Matrix) -> Matrix:
    """Return by how much a symmetric matrix, as a covariance, is larger than another one, in the
    directions in which it is; 0 in the others."""
    values, axes = np.linalg.eigh(now - then)
    return np.asarray((axes * np.maximum(values, 0.0)) @ axes.T)


def difference(pose: Pose2, other: Pose2) -> Matrix:
    """Return (3,) x, y and yaw of a pose minus those of another."""
    return np.array(
        [pose.x_m - other.x_m, pose.y_m - other.y_m, wrap_angle(pose.yaw_rad - other.yaw_rad)]
    )
