"""Edges of the pose graph: measured poses of one keyframe in the frame of another."""

from __future__ import annotations

from dataclasses import dataclass

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
    keyframe: an error is the motion that follows `T_from_to`."""
