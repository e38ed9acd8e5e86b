"""Localisation follows a log of a laser scanner: a new map, loops and all, and no other sensor.

The log is of a robot whose wheels are bad, and its scans are about 0.7 m apart, so the navigation's
own configuration, which expects a camera at several frames a second, is told so here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from app.evaluation.laser_log.carmen_log import LaserLog, Relation
from app.evaluation.localisation.drives import Drive
from app.evaluation.localisation.replay import Replay
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.arrays import Floats
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationState
from navcore.localisation.scans.scan import Scan, scan_of_points

SIGMA_M, NEAREST_M = 0.015, 0.2
"""Standard deviation of a range, and the least that is taken, metres."""
NEIGHBOURS_M = 0.4
"""Distance in metres within which the neighbours of a point decide on its normal: rays are a degree
apart."""
CELL_M, MARGIN_M = 0.05, 1.0
"""Size of a pixel of the picture of the map, and its border, metres."""
_DEFAULT = NavigatorConfig()


def laser_config(config: NavigatorConfig = _DEFAULT) -> NavigatorConfig:
    """Return the configuration for such a log."""
    own = config.localisation
    return replace(
        config,
        localisation=replace(
            own,
            odometry=replace(
                own.odometry, length_scale=0.1, gyro_scale=0.1, gyro_noise_deg=5.0,
                slip_m=0.1, aside_m=0.1,
            ),
            scan_odometry=replace(own.scan_odometry, gate_sigmas=6.0),
            # Scans that are seconds apart are each as good as many of a camera, and what one of
            # them contradicts, or wheels that slip, is no robot that was carried away.
            tracking=replace(
                own.tracking, young_points=2.0, gate_sigmas=5.0, judged_points=1000,
                lost_s=60.0, lost_m=50.0,
            ),
        ),
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaserReplay:
    """What localisation has made of a log of N scans."""

    poses: tuple[Pose2, ...]
    """T_map_base of each scan, as the map has it in the end."""
    loops: int
    """Number of loops that were closed."""
    located_share: float
    """Share of the scans at which the robot was located."""
    durations_s: Floats
    """(N,) processor time of each update without the tasks beside it, seconds."""


def drive_of(log: LaserLog, *, view_rad: float, range_m: float) -> Drive:
    """Return a log as a drive; of its scans only what lies within a view and a range."""
    scans = tuple(_scan(log.bearings_rad, row, view_rad, range_m) for row in log.ranges_m)
    return Drive(
        stamps_ns=tuple(int(stamp * 1e9) for stamp in log.stamps_s),
        by_odometry=log.odometry,
        pitch_rad=(0.0,) * len(scans),
        true_poses=log.logged,
        scans=scans,
    )


def _scan(bearings_rad: Floats, ranges_m: Floats, view_rad: float, range_m: float) -> Scan:
    seen = (np.abs(bearings_rad) <= view_rad / 2 + 1e-9) & (ranges_m >= NEAREST_M)
    seen &= ranges_m < range_m
    # From left to right, as the columns of an image.
    along, away = bearings_rad[seen][::-1], ranges_m[seen][::-1]
    points = np.column_stack([away * np.cos(along), away * np.sin(along)])
    return scan_of_points(points, np.zeros(2), sigma_m=SIGMA_M, neighbours_m=NEIGHBOURS_M)


def follow_log(
    drive: Drive, config: NavigatorConfig, on_progress: Callable[[int], None] = lambda done: None
) -> LaserReplay:
    """Let localisation follow a log."""
    replay, at, located, durations = Replay(config), list[tuple[int, Pose2]](), 0, list[float]()
    ids = replay.pose_ids
    for k, odometry in enumerate(drive.by_odometry):
        estimate = replay.advance(drive, k, odometry)
        pose_id = ids.id_of(estimate.T_map_base)
        at.append((pose_id, ids[pose_id].inverse() @ estimate.T_map_base))
        located += estimate.state is LocalisationState.LOCATED
        durations.append(replay.duration_s)
        on_progress(k + 1)
    return LaserReplay(
        poses=tuple(ids[pose_id] @ beside for pose_id, beside in at),
        loops=len(replay.loops),
        located_share=located / len(drive),
        durations_s=np.array(durations),
    )


def relation_errors(poses: Sequence[Pose2], relations: Sequence[Relation]) -> dict[str, Any]:
    """Return mean, standard deviation and median of the errors in metres and degrees over all
    relations, the metric of Kümmerle et al."""
    errors = []
    for one in relations:
        moved = poses[one.first].inverse() @ poses[one.second]
        error = one.T_first_second.inverse() @ moved
        errors.append((math.hypot(error.x_m, error.y_m), math.degrees(abs(error.yaw_rad))))
    rows: Floats = np.array(errors)
    return {
        f"{name}_{kind}": round(float(value), 4)
        for name, column in (("m", rows[:, 0]), ("deg", rows[:, 1]))
        for kind, value in (
            ("mean", column.mean()), ("std", column.std()), ("median", np.median(column))
        )
    }  # fmt: skip


def picture_of(drive: Drive, poses: Sequence[Pose2]) -> bytes:
    """Return a PNG of all points at the poses of their scans, and the way."""
    points = np.concatenate(
        [pose.to_parent(scan.points_base) for pose, scan in zip(poses, drive.scans, strict=True)]
    )
    way = np.array([(pose.x_m, pose.y_m) for pose in poses])
    low = np.minimum(points.min(axis=0), way.min(axis=0)) - MARGIN_M
    high = np.maximum(points.max(axis=0), way.max(axis=0)) + MARGIN_M
    columns, rows = np.ceil((high - low) / CELL_M).astype(int).tolist()
    image = np.full((rows, columns, 3), 255, dtype=np.uint8)
    at = ((points - low) / CELL_M).astype(int)
    image[rows - 1 - at[:, 1], at[:, 0]] = 0
    line = ((way - low) / CELL_M).astype(np.int32)
    line[:, 1] = rows - 1 - line[:, 1]
    cv2.polylines(image, [line[:, None]], False, (200, 120, 0), 1, cv2.LINE_AA)
    return cv2.imencode(".png", image)[1].tobytes()
