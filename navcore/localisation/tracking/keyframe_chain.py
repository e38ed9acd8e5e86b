"""The robot's own keyframes of a session, and the edges between consecutive ones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Matrix, Pose2, difference
from navcore.localisation.fresh_fixes import FreshFixes, Source, source_of
from navcore.localisation.graph.edges import NO_ERRORS, ConstantErrors, Edge, in_parent_axes
from navcore.localisation.graph.pose_graph import AbsolutePose
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tracking.odometry_model import (
    OdometryMotion,
    OdometryStep,
)
from navcore.localisation.tracking.scan_to_scan.scan_motion import ScanReference
from navcore.robot.fix import PositionFix

_CERTAIN: Matrix = np.zeros((3, 3))
_NEAR_M = 0.5
"""Distance in metres from a keyframe up to which a fix tells of its pose."""


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
        self._pose_ids, self._config = pose_ids, config
        self.map = ScanMap(config.match)
        """Surfaces of these keyframes."""
        self._last: Keyframe | None = None
        self._since = OdometryMotion(IDENTITY, config.odometry)
        self._edges: list[Edge] = []
        self._absolute: list[AbsolutePose] = []
        self._fresh = FreshFixes()
        self._fixed: dict[Source, int] = {}
        """Keyframe of the last fix of each source that was kept."""

    def advance(self, step: OdometryStep) -> None:
        """Follow odometry from the last keyframe."""
        self._since.advance(step)

    def push(self, motion: Pose2, covariance: Matrix) -> None:
        """Go on by a motion that odometry does not tell, T_before_after, with its (3, 3) covariance
        in the frame after it."""
        self._since.push(motion, covariance)

    def add(
        self,
        scan: Scan,
        T_map_base: Pose2,
        stamp_ns: int,
        covariance: Matrix = _CERTAIN,
        constant_errors: ConstantErrors = NO_ERRORS,
    ) -> Keyframe | None:
        """Keep a scan if the pose, which is uncertain by (3, 3) `covariance`, is a new one; returns
        its keyframe, else None. `constant_errors` are those of odometry as far as they are known
        now."""
        pose_id = self._pose_ids.id_of(T_map_base)
        if pose_id < self._pose_ids.frozen or pose_id in self.map:
            return None
        pose = self._pose_ids[pose_id]
        offset = pose.inverse() @ T_map_base
        keyframe = Keyframe(
            pose_id=pose_id,
            T_map_base=pose,
            scan=scan.seen_from(offset),
            stamp_ns=stamp_ns,
            covariance=covariance,
        )
        if self._last is not None:
            self._connect(self._last, keyframe, offset, constant_errors)
        self.map.put(keyframe)
        self._last = keyframe
        self._since = OdometryMotion(offset, self._config.odometry)
        return keyframe

    def take_edges(self) -> tuple[Edge, ...]:
        """Return the edges made since the last call."""
        taken, self._edges = tuple(self._edges), []
        return taken

    def fix(self, fix: PositionFix, measured: Pose2, rows: Matrix) -> None:
        """Keep a fix for the pose of the last keyframe, one of each source there, unless the robot
        has gone on from it. `measured` is T_map_base of the robot now as the fix tells it, and
        arbitrary where it does not; (M, 3) `rows` is the derivative of the fix by that pose."""
        last, source = self._last, source_of(fix)
        if last is None or self._fixed.get(source) == last.pose_id:
            return
        moved, noise, _ = self._since.to(IDENTITY)
        if math.hypot(moved.x_m, moved.y_m) > _NEAR_M:
            return
        self._fixed[source] = last.pose_id
        ((_, alike),) = self._fresh.of([fix], fix.stamp_ns)
        there, by_last = measured @ moved.inverse(), np.eye(3)
        by_last[:2, 2] = there.y_m - measured.y_m, measured.x_m - there.x_m
        covariance = alike * np.asarray(fix.covariance)[: len(rows), : len(rows)]
        covariance = covariance + rows @ in_parent_axes(measured, noise) @ rows.T
        rows = rows @ by_last
        self._absolute.append(
            AbsolutePose(
                pose_id=last.pose_id,
                T_map_base=there,
                information=rows.T @ np.linalg.solve(covariance, rows),
            )
        )

    def take_fixes(self) -> tuple[AbsolutePose, ...]:
        """Return the poses of keyframes that fixes have measured since the last call."""
        taken, self._absolute = tuple(self._absolute), []
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
        self._last, self._fresh, self._fixed = None, FreshFixes(), {}

    def _connect(
        self, last: Keyframe, new: Keyframe, offset: Pose2, constant_errors: ConstantErrors
    ) -> None:
        """Add the edge by odometry, and the one by the two scans; `offset` is the robot's pose in
        the frame of the new one."""
        measured, covariance, by_constant_errors = self._since.to(offset)
        edge = Edge(
            from_id=last.pose_id,
            to_id=new.pose_id,
            T_from_to=measured,
            covariance=covariance,
            by_constant_errors=by_constant_errors,
        )
        self._edges.append(edge)
        by_scans = self._by_scans(last, new, edge, constant_errors)
        if by_scans is not None:
            self._edges.append(by_scans)

    def _by_scans(
        self, last: Keyframe, new: Keyframe, by_odometry: Edge, constant_errors: ConstantErrors
    ) -> Edge | None:
        """Return the edge between two keyframes as their scans measure it, if odometry does not
        exclude it. Both are kept: odometry knows the way along a corridor, and scans the turn of a
        robot whose gyro errs."""
        rules, by_errors = self._config.scan_odometry, by_odometry.by_constant_errors
        x, y, yaw = (by_errors @ constant_errors.mean).tolist()
        expected = by_odometry.T_from_to @ Pose2(x_m=x, y_m=y, yaw_rad=yaw)
        spread = by_odometry.covariance + by_errors @ constant_errors.covariance @ by_errors.T
        found = ScanReference(last.scan, self._config).motion_to(
            new.scan, expected, in_parent_axes(expected, spread)
        )
        if found is None:
            return None
        motion, covariance = found.located()
        error = difference(expected.inverse() @ motion, IDENTITY)
        if error @ np.linalg.solve(spread + covariance, error) > rules.gate_sigmas**2:
            return None
        return Edge(
            from_id=last.pose_id, to_id=new.pose_id, T_from_to=motion, covariance=covariance
        )
