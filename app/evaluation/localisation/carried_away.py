"""Evaluation of a robot that is carried away: recorded drives of which parts are left out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.evaluation.localisation.drives import FRAME_NS, Drive
from app.evaluation.localisation.recording import JUDGED_M, Recording
from app.evaluation.localisation.replay import RIGHT_M, Replay
from app.evaluation.localisation.trials import SavedMap
from navcore.config.navigator import NavigatorConfig

NOTICED_M, NOTICED_S = 2.0, 3.0
"""Way and time within which a robot that was carried away should know it."""
CARRIED_M = (1.0, 5.0, 20.0)
"""Distances in metres by which the robot is carried away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Carried:
    """How the robot went on."""

    noticed_m: float | None
    """Way in metres after which the place was not believed any more; None if it always was."""
    noticed_s: float
    """The same in seconds."""
    is_right: bool
    """Whether the place that is believed at the end is right."""


def carried_away(
    run: Recording, saved: SavedMap | None, config: NavigatorConfig, count: int
) -> dict[str, Any]:
    """Carry the robot away at `count` places of a drive by each of `CARRIED_M`, odometry going on,
    in a saved map or a new one, and count when it notices.

    It has noticed when it does not believe its place any more, or has corrected it
    (`right_again`). What it has not within `JUDGED_M` counts as `unnoticed`. The control,
    `not_carried`, are the same places without it: how often the robot believes itself lost for
    nothing.
    """
    metres: list[float] = []
    tried = in_time = right_again = unnoticed = false_alarms = 0
    starts = run.starts(count)[1:]  # what has seen nothing yet cannot be carried away from anything
    for number, at in enumerate(starts):
        for distance_m in (0.0, *CARRIED_M):
            to = _away(run.drive, at, distance_m)
            if to is None:
                continue
            went = _follow_over(run, saved, config, number, at, to)
            if distance_m == 0.0:
                false_alarms += went.noticed_m is not None
                continue
            tried += 1
            if went.noticed_m is not None:
                metres.append(went.noticed_m)
                in_time += went.noticed_m <= NOTICED_M or went.noticed_s <= NOTICED_S
            else:
                right_again += went.is_right
                unnoticed += not went.is_right
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
    run: Recording,
    saved: SavedMap | None,
    config: NavigatorConfig,
    number: int,
    at: int,
    to: int,
) -> _Carried:
    """Follow a drive up to a frame and go on from another."""
    odometry = run.odometry(number, run.drive.true_poses[0])
    jump = odometry[at] @ odometry[to].inverse()
    frames = [*range(at), *range(to, len(run.drive))]
    stamps = tuple(FRAME_NS * (1 + index) for index in range(len(frames)))
    poses = [*odometry[:at], *(jump @ odometry[k] for k in frames[at:])]
    drive = _spliced(run.drive, frames, stamps)
    replay = Replay(config) if saved is None else Replay(config, saved.keyframes, saved.poses)
    way_m, is_right = 0.0, False
    for k, pose in enumerate(poses):
        place = replay.advance(drive, k, pose)
        if k < at:
            continue
        way_m += pose.distance_to(poses[k - 1].x_m, poses[k - 1].y_m) if k else 0.0
        if not place.is_known:
            seconds = (stamps[k] - stamps[at]) / 1e9
            return _Carried(noticed_m=way_m, noticed_s=seconds, is_right=False)
        true = drive.true_poses[k]
        is_right = place.T_map_base.distance_to(true.x_m, true.y_m) <= 2 * RIGHT_M
        if way_m > JUDGED_M:
            break
    return _Carried(noticed_m=None, noticed_s=0.0, is_right=is_right)


def _spliced(drive: Drive, frames: list[int], stamps: tuple[int, ...]) -> Drive:
    """Return the frames of a drive in another order, at other times."""
    return replace(
        drive,
        stamps_ns=stamps,
        by_odometry=tuple(drive.by_odometry[k] for k in frames),
        pitch_rad=tuple(drive.pitch_rad[k] for k in frames),
        true_poses=tuple(drive.true_poses[k] for k in frames),
        scans=tuple(drive.scans[k] for k in frames),
    )
