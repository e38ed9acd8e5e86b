"""Recorded drives replayed: each seed gives the drive the odometry of another run of a grade, and
localisation follows it with everything that it does beside the tick."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from app.evaluation.localisation.drives import FRAME_NS, Drive
from navcore.config.localisation.localisation import LocalisationConfig
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.arrays import Floats
from navcore.geometry.transform import Pose2, Twist, wrap_angle
from navcore.grid.grid import GridSpec
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.graph.edges import Edge
from navcore.localisation.localisation import Localisation
from navcore.localisation.map_correction import MapCorrection
from navcore.localisation.scans.scan import Keyframe
from navcore.localisation.tracking.keyframe_chain import KeyframeChain, KnownPoses
from navcore.localisation.tracking.odometry_model import OdometryStep
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.pose_ids import PoseIds
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from sim.robot.odometry import GYRO_BIAS_DRIFT
from sim.robot.odometry_grade import ODOMETRY_ERRORS, OdometryGrade

RIGHT_M, RIGHT_RAD = 0.15, math.radians(2.0)
"""Largest error of a place, or of a loop, that counts as right."""
TRACK_M = 0.55
"""Distance between the wheels of the two sides in metres, for their slip in turns."""
_GRID = GridSpec.centred(size_m=(1.0, 1.0), resolution_m=0.1)
_STANDING_FRAMES = 3
"""Number of frames for which the robot stands."""


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
    loops: tuple[int, int]
    """Number of right and of wrong loops that were closed."""


def odometry_of(drive: Drive, grade: OdometryGrade, seed: int, start: Pose2) -> list[Pose2]:
    """Return T_odom_base of each frame in a run of a grade; the first is `start`."""
    errors, rng = ODOMETRY_ERRORS[grade], np.random.default_rng((seed, 77))
    length, gyro, bias = rng.standard_normal(3) * (
        errors.length_scale, errors.gyro_scale, errors.gyro_bias_radps
    )  # fmt: skip
    pose, poses = start, [start]
    for k in range(1, len(drive)):
        seconds = (drive.stamps_ns[k] - drive.stamps_ns[k - 1]) / 1e9
        step = OdometryStep.between(drive.by_odometry[k - 1], drive.by_odometry[k], seconds)
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


class Replay:
    """Localisation along a recorded drive, with the tasks that run beside the tick and the
    corrections of the map; the map itself stays empty of points."""

    def __init__(
        self, config: NavigatorConfig, saved: Sequence[Keyframe] = (), poses: Floats | None = None
    ) -> None:
        """`saved`: keyframes of the saved map, and `poses` (P, 3) all its poses by ID."""
        self._map = PointMap(_GRID, config.map)
        if poses is not None:
            self._map.pose_ids.restore(poses, "")
        self.localisation = Localisation(
            self._map.pose_ids, config.localisation, HUSKY.depth_sensor
        )
        """What is judged."""
        self.localisation.load(saved)
        self._correction = MapCorrection(self._map, self.localisation, config.localisation.tracking)
        self._place = LocalisationEstimate()
        self._outcome: Any = None
        self._stood_ns = 0
        self._before: Frame | None = None
        self.loops: list[Edge] = []
        """Loops that were closed."""
        self.frames: dict[int, int] = {}
        """Frame of the drive at which each new pose ID was first seen."""
        self.pushes = 0
        """Number of pushes that scans have told."""
        self.duration_s = 0.0
        """Processor time of the newest frame without tasks, seconds."""

    @property
    def pose_ids(self) -> PoseIds:
        """The poses of the map by ID, as corrected last."""
        return self._map.pose_ids

    @property
    def poses(self) -> Floats:
        """(P, 3) poses by ID, to begin another session with."""
        return self._map.pose_ids.array()

    def advance(self, drive: Drive, k: int, T_odom_base: Pose2) -> LocalisationEstimate:
        """Return the estimate for a frame of a drive; the robot stands as long as a correction
        waits for it."""
        estimate = self._tick(drive, k, T_odom_base)
        for _ in range(_STANDING_FRAMES):
            if not self._correction.waits_for_standstill:
                break
            self._stood_ns += FRAME_NS
            estimate = self._tick(drive, k, T_odom_base)
        return estimate

    def _tick(self, drive: Drive, k: int, T_odom_base: Pose2) -> LocalisationEstimate:
        stamp_ns = drive.stamps_ns[k] + self._stood_ns
        frame = self._moving(drive.frame(k, T_odom_base, stamp_ns))
        if self._outcome is not None:
            self._correction.take(self._outcome)
        closures = self.localisation.closures
        started = time.thread_time()
        applied = self._correction.apply(self._place.T_map_base, frame.twist)
        self._place = self.localisation.follow(frame, drive.scans[k])
        self.duration_s = time.thread_time() - started
        self.pushes += self._place.pushed_m > 0.0
        if applied is not None and closures is not None:
            self.loops.extend(closures.new_loops)
        if self._place.is_known:  # as the map does, which takes the frame's points then
            self.frames.setdefault(self._map.pose_ids.id_of(self._place.T_map_base), k)
        task = self._correction.next_task()
        self._outcome = None if task is None else task.run(lambda: False)
        return self._place

    def _moving(self, frame: Frame) -> Frame:
        """Return a frame with its velocity since the one before."""
        before, self._before = self._before, frame
        if before is None:
            return frame
        seconds = max((frame.stamp_ns - before.stamp_ns) / 1e9, 1e-3)
        step = OdometryStep.between(before.pose, frame.pose, seconds)
        twist = Twist(v_mps=step.along_m / seconds, w_radps=step.turn_rad / seconds)
        return replace(frame, twist=twist)


def follow(replay: Replay, drive: Drive, odometry: Sequence[Pose2]) -> Run:
    """Let localisation follow a drive by the odometry of one run."""
    count = len(drive)
    errors, by_odometry, nees = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    durations, states = np.zeros(count), []
    for k, true in enumerate(drive.true_poses):
        estimate = replay.advance(drive, k, odometry[k])
        durations[k] = replay.duration_s
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
        loops=_judged(replay, drive),
    )


def _judged(replay: Replay, drive: Drive) -> tuple[int, int]:
    """Return the numbers of right and of wrong loops."""
    right = 0
    for loop in replay.loops:
        ends = (drive.true_poses[replay.frames[i]] for i in (loop.from_id, loop.to_id))
        before, after = ends
        error = (before.inverse() @ after).inverse() @ loop.T_from_to
        right += math.hypot(error.x_m, error.y_m) <= RIGHT_M and abs(error.yaw_rad) <= RIGHT_RAD
    return right, len(replay.loops) - right


def keyframes_of(
    drive: Drive, pose_ids: KnownPoses, config: LocalisationConfig
) -> tuple[Keyframe, ...]:
    """Return the keyframes of a map at the true poses: one that was corrected perfectly."""
    chain = KeyframeChain(pose_ids, config)
    for stamp_ns, pose, scan in zip(drive.stamps_ns, drive.true_poses, drive.scans, strict=True):
        if len(scan) >= config.match.min_points:
            chain.add(scan, pose, stamp_ns)
    return chain.map.keyframes


def _minus(pose: Pose2, other: Pose2) -> npt.NDArray[np.float64]:
    return np.array(
        [pose.x_m - other.x_m, pose.y_m - other.y_m, wrap_angle(pose.yaw_rad - other.yaw_rad)]
    )
