"""Trials in a saved map: a wrong place at the start, disturbances on the way, and many days."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.evaluation.localisation.drives import FRAME_NS, Drive
from app.evaluation.localisation.recording import JUDGED_M, Recording, mirrored
from app.evaluation.localisation.replay import RIGHT_M, RIGHT_RAD, Replay, follow
from app.evaluation.localisation.turns import turned_first
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.arrays import Floats
from navcore.geometry.transform import IDENTITY, Pose2, wrap_angle
from navcore.localisation.scans.scan import Keyframe

JUMP = Pose2(x_m=0.3, y_m=0.0, yaw_rad=math.radians(3.0))
"""Motion of the robot that its odometry does not notice."""
GYRO_STEP_RADPS = math.radians(0.05)
"""Change of the bias of the gyro: 180 degrees per hour."""
SPIN_M, SPIN_S = 0.5, 2.0
"""Distance that slipping wheels measure beyond what the robot drives, and for how long."""
COVERED_S = 10.0
"""Time in seconds for which the lens is covered."""
_FRAME_S = FRAME_NS / 1e9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedMap:
    """The map of an earlier day."""

    keyframes: tuple[Keyframe, ...]
    """Its keyframes."""
    poses: Floats
    """(P, 3) its poses by ID."""

    def moved(self, motion: Pose2) -> SavedMap:
        """Return the map with everything moved rigidly: T_new_old."""
        frames = (replace(one, T_map_base=motion @ one.T_map_base) for one in self.keyframes)
        poses = [motion @ Pose2(x_m=x, y_m=y, yaw_rad=yaw) for x, y, yaw in self.poses.tolist()]
        rows = np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in poses]).reshape(-1, 3)
        return SavedMap(keyframes=tuple(frames), poses=rows)

    def mirrored(self) -> SavedMap:
        """Return the map of the world that a mirror along the x axis shows."""
        rows = self.poses * (1.0, -1.0, -1.0)
        return SavedMap(keyframes=tuple(mirrored(self.keyframes)), poses=rows)


def half_turn(saved: SavedMap) -> Pose2:
    """Return the motion that turns a map by 180 degrees about its middle."""
    x, y = saved.poses[:, :2].mean(axis=0).tolist()
    return Pose2(x_m=2 * x, y_m=2 * y, yaw_rad=math.pi)


def started_in(
    run: Recording,
    saved: SavedMap,
    config: NavigatorConfig,
    count: int,
    motion: Pose2 = IDENTITY,
    *,
    is_here: bool = True,
    searches: bool = False,
    turn_at: Callable[[int], Drive] | None = None,
) -> dict[str, Any]:
    """Start at `count` places of a drive in the map moved by `motion`, and count whether the place
    that is believed after some metres is the right one of the moved map, a wrong one, or none; in
    the map of another world every place is wrong.

    Odometry says the place of the unmoved map; a robot that `searches` is told to look in the whole
    map. `turn_at` gives the turn that is driven first at a frame; without it the robot drives on at
    once. `misled` of them believed a wrong place on the way, for `misled_m` metres at most;
    `median_m`: metres after which a place was believed first.
    """
    moved = saved.moved(motion)
    true_motion = motion if is_here else None
    found = []
    for number, start in enumerate(run.starts(count)):
        way, at = run, start
        if turn_at is not None:
            way, at = replace(run, drive=turned_first(turn_at(start), run.drive, start)), 0
        found.append(_started(way, moved, config, number, at, true_motion, searches=searches))
    ends = [one.is_right for one in found]
    misled = [one.misled_m for one in found if one.misled_m > 0.0]
    metres = [one.believed_m for one in found if one.believed_m is not None]
    return {
        "starts": len(found),
        "right": ends.count(True),
        "wrong": ends.count(False),
        "refused": ends.count(None),
        "misled": len(misled),
        "misled_m": max(misled, default=0.0),
        "median_m": float(np.median(metres)) if metres else None,
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _Start:
    """How one start went."""

    is_right: bool | None
    """Whether the place at the end of the way is right; None while none is believed."""
    misled_m: float
    """Metres for which a wrong place was believed."""
    believed_m: float | None
    """Metres after which a place was believed first; None if none was."""


def _started(
    run: Recording,
    saved: SavedMap,
    config: NavigatorConfig,
    number: int,
    start: int,
    motion: Pose2 | None,
    *,
    searches: bool,
) -> _Start:
    """Start at a frame of a drive; `motion` is that of the map, None for the map of another
    world."""
    drive = run.drive
    odometry = run.odometry(number)
    origin = drive.true_poses[start] @ odometry[start].inverse()
    replay, driven_m, misled_m = Replay(config, saved.keyframes, saved.poses), 0.0, 0.0
    verdict: bool | None = None
    believed_m: float | None = None
    for k in range(start, len(drive)):
        step_m = odometry[k].distance_to(odometry[k - 1].x_m, odometry[k - 1].y_m) if k else 0.0
        driven_m += step_m if k > start else 0.0
        if driven_m > JUDGED_M:
            break
        place = replay.advance(drive, k, origin @ odometry[k])
        if searches and k == start:
            replay.localisation.search(drive.stamps_ns[k])
            continue
        true = None if motion is None else motion @ drive.true_poses[k]
        is_right = true is not None and _is_right(place.T_map_base, true)
        verdict = is_right if place.is_known else None
        misled_m += step_m if verdict is False else 0.0
        if believed_m is None and verdict is not None:
            believed_m = driven_m
    return _Start(is_right=verdict, misled_m=misled_m, believed_m=believed_m)


def disturbed(
    run: Recording, saved: SavedMap, config: NavigatorConfig, count: int
) -> dict[str, dict[str, Any]]:
    """Disturb `count` drives in the saved map, each further on its way than the one before, and
    count how they end: right, lost and known to be so, or wrong; with the median error of odometry
    alone as control."""
    kinds: dict[str, Callable[[Drive, list[Pose2], int], tuple[Drive, list[Pose2]]]] = {
        "jump": _jump,
        "gyro": _gyro_step,
        "spin": _spin,
        "covered": _covered,
    }
    return {name: _disturbed(run, saved, config, count, kind) for name, kind in kinds.items()}


def _disturbed(
    run: Recording,
    saved: SavedMap,
    config: NavigatorConfig,
    count: int,
    disturb: Callable[[Drive, list[Pose2], int], tuple[Drive, list[Pose2]]],
) -> dict[str, Any]:
    ends = {"right": 0, "lost": 0, "wrong": 0}
    away: list[float] = []
    for number in range(count):
        start = run.drive.true_poses[0]
        at = len(run.drive) * (number + 1) // (count + 2)
        drive, odometry = disturb(run.drive, run.odometry(number, start), at)
        result = follow(Replay(config, saved.keyframes, saved.poses), drive, odometry)
        is_known = result.states[-1].is_known
        x, y, yaw = result.errors[-1]
        is_right = math.hypot(x, y) <= RIGHT_M and abs(yaw) <= RIGHT_RAD
        ends["right" if is_known and is_right else "wrong" if is_known else "lost"] += 1
        away.append(float(np.hypot(*result.odometry_errors[-1, :2])))
    return {"runs": count, **ends, "odometry_m": float(np.median(away))}


def _jump(drive: Drive, odometry: list[Pose2], at: int) -> tuple[Drive, list[Pose2]]:
    """The robot moves without its odometry."""
    before = odometry[at]
    moved = [before @ JUMP.inverse() @ before.inverse() @ pose for pose in odometry[at:]]
    return drive, [*odometry[:at], *moved]


def _gyro_step(drive: Drive, odometry: list[Pose2], at: int) -> tuple[Drive, list[Pose2]]:
    """The bias of the gyro changes."""
    poses = odometry[: at + 1]
    turned = Pose2(x_m=0.0, y_m=0.0, yaw_rad=GYRO_STEP_RADPS * _FRAME_S)
    for before, after in zip(odometry[at:], odometry[at + 1 :], strict=False):
        poses.append(poses[-1] @ (before.inverse() @ after) @ turned)
    return drive, poses


def _spin(drive: Drive, odometry: list[Pose2], at: int) -> tuple[Drive, list[Pose2]]:
    """The wheels slip: they turn faster than the robot drives."""
    poses, frames = odometry[: at + 1], round(SPIN_S / _FRAME_S)
    for k in range(at + 1, len(odometry)):
        step = odometry[k - 1].inverse() @ odometry[k]
        slip_m = SPIN_M / frames if k <= at + frames else 0.0
        poses.append(poses[-1] @ step @ Pose2(x_m=slip_m, y_m=0.0, yaw_rad=0.0))
    return drive, poses


def _covered(drive: Drive, odometry: list[Pose2], at: int) -> tuple[Drive, list[Pose2]]:
    """Nothing is seen for a while."""
    frames = range(at, at + round(COVERED_S / _FRAME_S))
    scans = tuple(
        scan.part(np.zeros(len(scan), dtype=np.bool_)) if k in frames else scan
        for k, scan in enumerate(drive.scans)
    )
    return replace(drive, scans=scans), odometry


def days(drives: Sequence[Recording], config: NavigatorConfig, count: int) -> dict[str, Any]:
    """Make a map on the first day and drive `count` days in it, the drives by turns, each day
    keeping what the one before has kept; return the error of each day."""
    keyframes: tuple[Keyframe, ...] = ()
    poses: Floats | None = None
    rms, kept = [], []
    for day in range(count):
        run = drives[day % len(drives)]
        replay = Replay(config, keyframes, poses)
        result = follow(replay, run.drive, run.odometry(day, run.drive.true_poses[0]))
        rms.append(float(np.sqrt(np.mean(np.square(result.errors[:, :2]).sum(axis=1)))))
        keyframes, poses = replay.localisation.keyframes, replay.poses
        kept.append(len(keyframes))
    return {
        "days": count,
        "rms_first_m": rms[0],
        "rms_m": rms,
        "keyframes": kept,
    }


def _is_right(place: Pose2, true: Pose2) -> bool:
    return (
        place.distance_to(true.x_m, true.y_m) <= RIGHT_M
        and abs(wrap_angle(place.yaw_rad - true.yaw_rad)) <= RIGHT_RAD
    )
