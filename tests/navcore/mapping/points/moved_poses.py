"""Poses that are moved as by a correction of the map."""

from __future__ import annotations

from collections.abc import Mapping

from navcore.geometry.transform import Pose2
from navcore.mapping.points.pose_ids import PoseIds


def move(pose_ids: PoseIds, poses: Mapping[int, Pose2]) -> None:
    """Replace poses by ID."""
    moved = PoseIds(pose_ids.spacing_m, pose_ids.spacing_deg)
    moved.extend(poses.get(number, pose) for number, pose in enumerate(pose_ids.poses))
    pose_ids.adopt(moved, {})
