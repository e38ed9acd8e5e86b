"""Edges of the pose graph: measured poses of one keyframe in the frame of another, and the errors
that all edges by odometry have in common."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from navcore.geometry.transform import Matrix, Pose2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Edge:
    """A measured relative pose of two keyframes."""

    from_id: int
    """Pose ID of the keyframe in whose frame the other was measured."""
    to_id: int
    """Pose ID of the keyframe whose pose was measured."""
    T_from_to: Pose2
    """Pose of the second keyframe in the frame of the first."""
    covariance: Matrix
    """(3, 3) covariance of x, y in metres and yaw in radians, in the frame of the second
    keyframe: an error is the motion that follows `T_from_to`. The constant errors of odometry have
    no part in it."""
    by_constant_errors: Matrix = field(default_factory=lambda: np.zeros((3, 3)))
    """(3, 3) derivative of the true motion by the constant errors of odometry, in the frame of the
    second keyframe; zero for what was not measured by odometry."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ConstantErrors:
    """The errors of odometry that stay the same for a whole drive, as far as they are known."""

    mean: Matrix
    """(3,) gyro bias in rad/s, relative errors of lengths and of turns."""
    covariance: Matrix
    """(3, 3) their covariance."""


NO_ERRORS = ConstantErrors(mean=np.zeros(3), covariance=np.zeros((3, 3)))
"""Odometry without constant errors."""


def in_own_axes(pose: Pose2, spread: Matrix) -> Matrix:
    """Return a (3, 3) covariance, or information, along the axes of a pose's parent in those of the
    pose, as edges have it."""
    return in_parent_axes(pose.inverse(), spread)


def in_parent_axes(pose: Pose2, spread: Matrix) -> Matrix:
    """Return a (3, 3) covariance along the axes of a pose in those of its parent: the inverse of
    `in_own_axes`."""
    rotation = np.eye(3)
    rotation[:2, :2] = pose.matrix()[:2, :2]
    return np.asarray(rotation @ spread @ rotation.T)
