"""Evaluation of localisation: recorded drives with the odometry of many runs.

A world is driven once with nearly perfect odometry and recorded with the true poses; then each seed
gives the same drive the odometry of another run of a grade, and the localiser follows it. The true
poses judge.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from app.episode.episode import Episode, EpisodeSettings
from navcore.config.localisation import LocalisationConfig
from navcore.geometry.arrays import Bools, Floats
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.estimate import LocalisationState
from navcore.localisation.scans.scan import Keyframe, Scan, scan_of
from navcore.localisation.tracking.keyframe_chain import KnownPoses
from navcore.localisation.tracking.localiser import Localiser
from navcore.localisation.tracking.odometry_model import OdometryStep
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.navigator import TickResult
from navcore.perception.ground import ground_heights
from navcore.robot.frame import Frame
from sim.robot.odometry import GYRO_BIAS_DRIFT
from sim.robot.odometry_grade import ODOMETRY_ERRORS, OdometryGrade
from sim.scenario.schema import Scenario

EVERY = 2
"""Every how many frames of a drive is kept: 5 a second."""
RPE_M = 10.0
"""Distance in metres over which the relative error is measured."""
TRACK_M = 0.55
"""Distance between the wheels of the two sides in metres, for their slip in turns."""
_LOOK_FIRST_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """A recorded drive."""

    frames: tuple[Frame, ...]
    """Frames with the pose by nearly perfect odometry."""
    excluded: tuple[Bools, ...]
    """(H, W) pixels of people and beware objects in each."""
    true_poses: tuple[Pose2, ...]
    """True T_map_base of each."""

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.frames)

    @property
    def distance_m(self) -> float:
        """Distance driven in metres."""
        pairs = zip(self.true_poses, self.true_poses[1:], strict=False)
        return sum(a.distance_to(b.x_m, b.y_m) for a, b in pairs)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """What a localiser made of a drive, one row a frame."""

    errors: Floats
    """(N, 3) estimated minus true pose: x and y in metres, yaw in radians."""
    odometry_errors: Floats
    """(N, 3) the same of odometry alone from the true start."""
    nees: Floats
    """(N,) normalised estimation error squared, 3 degrees of freedom."""
    states: tuple[LocalisationState, ...]
    """State of each estimate."""
    durations_s: Floats
    """(N,) processor time of each update without the scan, seconds."""
    true_poses: Floats
    """(N, 3) true poses."""


def record(
    scenario: Scenario,
    beware: BewareList,
    *,
    seed: int,
    goals: Sequence[tuple[float, float]] = (),
    max_time_s: float = 600.0,
    randomised: bool = False,
) -> Drive:
    """Drive a mission with nearly perfect odometry and keep every second frame."""
    episode = Episode(
        scenario,
        EpisodeSettings(
            beware=beware, goals=tuple(goals), max_time_s=max_time_s, randomised=randomised,
            odometry=OdometryGrade.IDEAL,
        ),
        seed=seed,
    )  # fmt: skip
    frames: list[Frame] = []
    excluded: list[Bools] = []
    poses: list[Pose2] = []
    ticks = 0

    def note(_: float, result: TickResult) -> None:
        nonlocal ticks
        ticks += 1
        if ticks % EVERY == 0:
            by_odometry = result.place.T_map_odom.inverse() @ result.frame.pose
            blank = np.zeros_like(result.frame.rgb[:1, :1])
            frames.append(replace(result.frame, rgb=blank, pose=by_odometry))
            excluded.append(result.labels.class_ids != NOTHING)
            poses.append(episode.simulator.true_pose())

    episode.on_decision = note
    try:
        episode.run(look_first_s=_LOOK_FIRST_S)
    finally:
        episode.close()
    return Drive(frames=tuple(frames), excluded=tuple(excluded), true_poses=tuple(poses))


def odometry_of(drive: Drive, grade: OdometryGrade, seed: int, start: Pose2) -> list[Pose2]:
    """Return T_odom_base of each frame in a run of a grade; the first is `start`."""
    errors, rng = ODOMETRY_ERRORS[grade], np.random.default_rng((seed, 77))
    length, gyro, bias = rng.standard_normal(3) * (
        errors.length_scale, errors.gyro_scale, errors.gyro_bias_radps
    )  # fmt: skip
    pose, poses = start, [start]
    for k in range(1, len(drive)):
        before, after = drive.frames[k - 1], drive.frames[k]
        seconds = (after.stamp_ns - before.stamp_ns) / 1e9
        step = OdometryStep.between(before.pose, after.pose, seconds)
        turn = wrap_angle(drive.true_poses[k].yaw_rad - drive.true_poses[k - 1].yaw_rad)
        left, right, noise, drift = rng.standard_normal(4)
        bias += GYRO_BIAS_DRIFT * math.sqrt(seconds) * drift
        slip = errors.slip * abs(step.along_m) + errors.turn_slip * abs(turn) * TRACK_M / 2
        along = (1 + length) * step.along_m + slip * (left + right) / 2
        measured = (1 + gyro) * turn + bias * seconds
        measured += errors.gyro_noise * math.sqrt(seconds) * noise
        half = measured / 2
        pose = pose @ Pose2(
            x_m=along * math.cos(half), y_m=along * math.sin(half), yaw_rad=measured
        )
        poses.append(pose)
    return poses


def scans_of(drive: Drive, max_slope: float, config: LocalisationConfig) -> tuple[Scan, ...]:
    """Return the scan of each frame, which is the same for the odometry of every run."""
    return tuple(
        scan_of(frame, excluded, ground_heights(frame, max_slope), config.scan)
        for frame, excluded in zip(drive.frames, drive.excluded, strict=True)
    )


def follow(
    localiser: Localiser, drive: Drive, odometry: Sequence[Pose2], scans: Sequence[Scan]
) -> Run:
    """Let a localiser follow a drive by the odometry of one run."""
    count = len(drive)
    errors, by_odometry, nees = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    durations, states = np.zeros(count), []
    for k, (frame, true) in enumerate(zip(drive.frames, drive.true_poses, strict=True)):
        moved = replace(frame, pose=odometry[k])
        started = time.thread_time()
        estimate = localiser.follow(moved, scans[k])
        durations[k] = time.thread_time() - started
        errors[k] = _minus(estimate.T_map_base, true)
        by_odometry[k] = _minus(drive.true_poses[0] @ odometry[0].inverse() @ odometry[k], true)
        spread = estimate.covariance + np.diag([1e-3, 1e-3, 1e-3]) ** 2
        nees[k] = errors[k] @ np.linalg.solve(spread, errors[k])
        states.append(estimate.state)
    return Run(
        errors=errors,
        odometry_errors=by_odometry,
        nees=nees,
        states=tuple(states),
        durations_s=durations,
        true_poses=np.array([[p.x_m, p.y_m, p.yaw_rad] for p in drive.true_poses]),
    )


def figures(run: Run) -> dict[str, float]:
    """Return the row of the table for one run: metres, degrees, shares and milliseconds."""
    away = np.hypot(run.errors[:, 0], run.errors[:, 1])
    odometry = np.hypot(run.odometry_errors[:, 0], run.odometry_errors[:, 1])
    yaw = np.degrees(np.abs(run.errors[:, 2]))
    milliseconds = 1e3 * run.durations_s
    return {
        "rms_m": float(np.sqrt(np.mean(away**2))),
        "p95_m": float(np.percentile(away, 95)),
        "max_m": float(away.max()),
        "final_m": float(away[-1]),
        "yaw_p95_deg": float(np.percentile(yaw, 95)),
        "rpe_m": relative_error_m(run),
        "nees": float(run.nees.mean()),
        "odometry_rms_m": float(np.sqrt(np.mean(odometry**2))),
        "odometry_final_m": float(odometry[-1]),
        "located_share": float(np.mean([s is LocalisationState.LOCATED for s in run.states])),
        "lost_share": float(np.mean([s is LocalisationState.LOST for s in run.states])),
        "p50_ms": float(np.percentile(milliseconds, 50)),
        "p99_ms": float(np.percentile(milliseconds, 99)),
    }


def relative_error_m(run: Run) -> float:
    """Return the root mean square error of the motion over `RPE_M`, metres; NaN on shorter
    drives."""
    steps = np.hypot(*np.diff(run.true_poses[:, :2], axis=0).T)
    driven = np.concatenate([[0.0], np.cumsum(steps)])
    ends = np.searchsorted(driven, driven + RPE_M)
    squares = []
    for k in np.flatnonzero(ends < len(driven)):
        true = _pose(run.true_poses[k]).inverse() @ _pose(run.true_poses[ends[k]])
        found = (
            _pose(run.true_poses[k] + run.errors[k]).inverse()
            @ _pose(run.true_poses[ends[k]] + run.errors[ends[k]])
        )  # fmt: skip
        squares.append((found.x_m - true.x_m) ** 2 + (found.y_m - true.y_m) ** 2)
    return float(np.sqrt(np.mean(squares))) if squares else math.nan


def keyframes_of(
    drive: Drive, scans: Sequence[Scan], pose_ids: KnownPoses, config: LocalisationConfig
) -> tuple[Keyframe, ...]:
    """Return the keyframes of a map at the true poses: one that was corrected well."""
    exact = replace(config, tracking=replace(config.tracking, young_points=0.0))
    localiser = Localiser(pose_ids, exact)
    follow(localiser, drive, drive.true_poses, scans)
    return localiser.keyframes


def summarise(rows: Iterable[dict[str, float]]) -> dict[str, Any]:
    """Return the median and the worst of each figure over the seeds."""
    rows = list(rows)
    names = rows[0] if rows else {}
    return {
        "runs": len(rows),
        "median": {name: float(np.median([row[name] for row in rows])) for name in names},
        "worst": {
            name: float((np.min if name == "located_share" else np.max)([r[name] for r in rows]))
            for name in names
        },
        "rows": rows,
    }


def _minus(pose: Pose2, other: Pose2) -> npt.NDArray[np.float64]:
    return np.array(
        [pose.x_m - other.x_m, pose.y_m - other.y_m, wrap_angle(pose.yaw_rad - other.yaw_rad)]
    )


def _pose(row: npt.NDArray[np.float64]) -> Pose2:
    return Pose2(x_m=float(row[0]), y_m=float(row[1]), yaw_rad=float(row[2]))
