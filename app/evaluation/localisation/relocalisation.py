"""Recordings and wrong maps, and the evaluation of a robot that is carried away: recorded drives of
which parts are left out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.evaluation.localisation.drives import Drive
from app.evaluation.localisation.replay import RIGHT_M, odometry_of
from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.tracking.localiser import Localiser
from navcore.mapping.points.pose_ids import PoseIds
from sim.robot.odometry_grade import OdometryGrade

NOTICED_M, NOTICED_S = 2.0, 3.0
"""Way and time within which a robot that was carried away should know it."""
FOLLOWED_M = 10.0
"""Way in metres for which a robot that was carried away is followed."""
CARRIED_M = (1.0, 5.0, 20.0)
"""Distances in metres by which the robot is carried away."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """A drive, and the odometry with which it is driven again."""

    drive: Drive
    """The drive."""
    grade: OdometryGrade
    """Grade of the odometry with which it is driven again."""
    seed: int
    """First seed of that odometry."""

    def starts(self, count: int) -> list[int]:
        """Return the frames of `count` places along the drive, none within its last 50 frames."""
        last = max(len(self.drive) - 50, 1)
        return [int(k) for k in np.linspace(0, last, count, endpoint=False)]

    def odometry(self, number: int, start: Pose2 = IDENTITY) -> list[Pose2]:
        """Return T_odom_base of each frame in one run, the first is `start`."""
        return odometry_of(self.drive, self.grade, self.seed + number, start)


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


def carried_away(
    run: Recording,
    saved: Sequence[Keyframe],
    config: LocalisationConfig,
    pose_ids: PoseIds,
    count: int,
) -> dict[str, Any]:
    """Carry the robot away at `count` places of a drive by each of `CARRIED_M`, odometry going on,
    and count when it notices. `saved`: keyframes of the saved map, whose pose IDs are `pose_ids`;
    none for a new map.

    What is not noticed within `FOLLOWED_M` and not right again by then counts as unnoticed. The
    control, `not_carried`, are the same places without it: how often the robot believes itself lost
    for nothing.
    """
    metres: list[float] = []
    tried = in_time = right_again = unnoticed = false_alarms = 0
    known = pose_ids.array()
    # Without a map, a robot that has seen nothing yet cannot be carried away from anything.
    starts = run.starts(count) if saved else run.starts(count)[1:]
    for number, at in enumerate(starts):
        for distance_m in (0.0, *CARRIED_M):
            to = _away(run.drive, at, distance_m)
            if to is None:
                continue
            ids = PoseIds(pose_ids.spacing_m, pose_ids.spacing_deg)
            ids.restore(known)
            localiser = Localiser(ids, config)
            localiser.load(saved)
            way_m, seconds, is_right = _follow_over(localiser, run, number, at, to)
            if distance_m == 0.0:
                false_alarms += way_m is not None
                continue
            tried += 1
            if way_m is not None:
                metres.append(way_m)
                in_time += way_m <= NOTICED_M or seconds <= NOTICED_S
            else:
                right_again, unnoticed = right_again + is_right, unnoticed + (not is_right)
    return {
        "carried": tried,
        "noticed": len(metres),
        "in_time": in_time,
        "right_again": right_again,
        "unnoticed": unnoticed,
        "median_m": float(np.median(metres)) if metres else None,
        "not_carried": len(starts),
        "false_alarms": false_alarms,
    }


def _away(drive: Drive, at: int, distance_m: float) -> int | None:
    """Return the frame that is nearest to a distance from another and has enough way after it."""
    if distance_m == 0.0:
        return at
    here = drive.true_poses[at]
    away = np.array([pose.distance_to(here.x_m, here.y_m) for pose in drive.true_poses[:-50]])
    if not len(away):
        return None
    best = int(np.argmin(np.abs(away - distance_m)))
    return best if abs(away[best] - distance_m) < distance_m / 4 else None


def _follow_over(
    localiser: Localiser, run: Recording, number: int, at: int, to: int
) -> tuple[float | None, float, bool]:
    """Follow a drive up to a frame and go on from another; return the way in metres after which the
    place is not believed any more (None if it always is), the seconds, and whether it is right at
    the end."""
    drive = run.drive
    odometry = run.odometry(number, drive.true_poses[0])
    jump = odometry[at] @ odometry[to].inverse()
    frames = [*((k, odometry[k]) for k in range(at)), *(
        (k, jump @ odometry[k]) for k in range(to, len(drive))
    )]  # fmt: skip
    way_m, began_ns, stamp_ns, before = 0.0, 0, 0, odometry[0]
    is_right = False
    for index, (k, pose) in enumerate(frames):
        stamp_ns += 200_000_000
        if index >= at:
            began_ns = began_ns or stamp_ns
            way_m += pose.distance_to(before.x_m, before.y_m)
        before = pose
        estimate = localiser.follow(drive.frame(k, pose, stamp_ns), drive.scans[k])
        if index < at:
            continue
        if not estimate.is_known:
            return way_m, (stamp_ns - began_ns) / 1e9, False
        true = drive.true_poses[k]
        is_right = bool(estimate.T_map_base.distance_to(true.x_m, true.y_m) <= 2 * RIGHT_M)
        if way_m > FOLLOWED_M:
            break
    return None, 0.0, is_right
