"""The robot's own keyframes of a session, and the edges between consecutive ones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from navcore.config.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Matrix, Pose2
from navcore.localisation.graph.edges import Edge
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tracking.odometry_model import OdometryStep, edge_covariance
from navcore.localisation.tracking.pose_filter import PoseFilter


class KnownPoses(Protocol):
    """The map's poses by ID."""

    def id_of(self, pose: Pose2) -> int:
        """Return the ID of the known pose near a pose, or a new one."""

    @property
    def frozen(self) -> int:
        """Number of the first IDs, whose poses are constants: those of a saved map."""

    def __getitem__(self, pose_id: int) -> Pose2:
        """Return T_map_base of an ID."""


class KeyframeChain:
    """Makes a keyframe of each new pose ID, and an edge from the one before.

    A pose ID that was known before keeps the scan it has: the robot's pose in the map may have
    drifted since, and whether it has is for loop closure to find out.
    """

    def __init__(self, pose_ids: KnownPoses, config: LocalisationConfig) -> None:
        self._pose_ids, self._config = pose_ids, config.odometry
        self.map = ScanMap(config.match)
        """Surfaces of these keyframes."""
        self._last: Keyframe | None = None
        self._since = PoseFilter(IDENTITY, config.odometry)
        self._since_m = 0.0
        self._edges: list[Edge] = []

    def advance(self, step: OdometryStep) -> None:
        """Follow odometry from the last keyframe."""
        self._since.predict(step)
        self._since_m += step.distance_m

    def add(self, scan: Scan, T_map_base: Pose2, stamp_ns: int, own: PoseFilter) -> Keyframe | None:
        """Keep a scan if the pose is a new one; returns its keyframe, else None. The next edge is
        by odometry as far as `own` knows its errors."""
        pose_id = self._pose_ids.id_of(T_map_base)
        if pose_id < self._pose_ids.frozen or pose_id in self.map:
            return None
        pose = self._pose_ids[pose_id]
        offset = pose.inverse() @ T_map_base
        keyframe = Keyframe(
            pose_id=pose_id, T_map_base=pose, scan=scan.seen_from(offset), stamp_ns=stamp_ns
        )
        if self._last is not None:
            self._connect(self._last, keyframe, offset)
        self.map.put(keyframe)
        self._last, self._since_m = keyframe, 0.0
        self._since = own.at(offset)
        return keyframe

    def take_edges(self) -> tuple[Edge, ...]:
        """Return the edges made since the last call."""
        taken, self._edges = tuple(self._edges), []
        return taken

    def correct(self, poses: Mapping[int, Pose2]) -> Pose2 | None:
        """Move keyframes to corrected poses; returns T_new_old of the newest, None if it stays."""
        last = self._last
        motion = None
        if last is not None and last.pose_id in poses:
            motion = poses[last.pose_id] @ last.T_map_base.inverse()
        self.map.correct(poses)
        if last is not None:
            self._last = self.map.keyframe(last.pose_id)
        return motion

    def restart(self) -> None:
        """Begin a new chain: the robot was placed, and no edge leads there."""
        self._last = None

    def _connect(self, last: Keyframe, new: Keyframe, offset: Pose2) -> None:
        """Add the edge by odometry, whose errors are known as well as at the last keyframe."""
        expected = self._since.pose @ offset.inverse()
        covariance = edge_covariance(self._since.covariance, self._since_m, self._config)
        self._edges.append(
            Edge(
                from_id=last.pose_id,
                to_id=new.pose_id,
                T_from_to=expected,
                covariance=_in_frame_of(expected, covariance),
            )
        )


def _in_frame_of(pose: Pose2, covariance: Matrix) -> Matrix:
    """Return the covariance of a pose's errors in the axes of the pose itself."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turn @ covariance @ turn.T)
