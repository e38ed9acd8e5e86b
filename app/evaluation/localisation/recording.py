"""Recordings: drives that are driven again by the odometry of many runs; and a wrong map."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from app.evaluation.localisation.drives import Drive
from app.evaluation.localisation.replay import odometry_of
from navcore.geometry.arrays import Points
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.scans.scan import Keyframe, Scan
from sim.robot.odometry_grade import OdometryGrade

JUDGED_M = 10.0
"""Distance in metres over which a robot that was switched on or carried away is judged."""
KNOWN_M = 4.0
"""Distance in metres from the drive that made a map within which a place may be on it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """A drive, and the odometry with which it is driven again."""

    drive: Drive
    """The drive."""
    grade: OdometryGrade
    """Grade of the odometry with which it is driven again."""
    seed: int
    """First seed of that odometry."""
    mapped: Drive | None = None
    """The drive that made the map; None for this one."""

    def starts(self, count: int) -> list[int]:
        """Return the frames of `count` places along the drive, evenly in time, each with `JUDGED_M`
        of the drive after it and within `KNOWN_M` of the drive that made the map."""
        here = _positions(self.drive)
        driven_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(here, axis=0).T))])
        last = max(int(np.searchsorted(driven_m, driven_m[-1] - JUDGED_M, side="right")), 1)
        frames = np.arange(last)
        if self.mapped is not None:
            away_m, _ = cKDTree(_positions(self.mapped)).query(here[:last])
            frames = frames[away_m <= KNOWN_M]
        chosen = np.linspace(0, len(frames), count, endpoint=False).astype(np.int64)
        return [int(frame) for frame in frames[chosen]]

    def odometry(self, number: int, start: Pose2 = IDENTITY) -> list[Pose2]:
        """Return T_odom_base of each frame in one run, the first is `start`."""
        return odometry_of(self.drive, self.grade, self.seed + number, start)


def _positions(drive: Drive) -> Points:
    """Return the (N, 2) true positions of a drive in metres of the map."""
    return np.array([(pose.x_m, pose.y_m) for pose in drive.true_poses])


def mirrored(keyframes: Iterable[Keyframe]) -> list[Keyframe]:
    """Return the map of the world that a mirror along the x axis shows: every room is there, and no
    place of it is that of the robot."""
    flip = np.array([1.0, -1.0])
    return [
        replace(
            frame,
            T_map_base=Pose2(
                x_m=frame.T_map_base.x_m,
                y_m=-frame.T_map_base.y_m,
                yaw_rad=-frame.T_map_base.yaw_rad,
            ),
            scan=Scan(
                points_base=frame.scan.points_base * flip,
                variance_m2=frame.scan.variance_m2.copy(),
                normals=frame.scan.normals * flip,
                origin=frame.scan.origin * flip,
            ),
        )
        for frame in keyframes
    ]
