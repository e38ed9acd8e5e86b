"""Evaluation of a robot that is pushed in a new map: recorded drives whose odometry misses a
motion."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from app.evaluation.localisation.recording import Recording
from app.evaluation.localisation.replay import Replay
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.arrays import Floats
from navcore.geometry.transform import Pose2

PUSHED_M = (0.1, 0.2, 0.4)
"""Lengths in metres of the pushes."""
_TURN_RAD_PER_M = math.radians(10.0)
"""Standard deviation of the turn of a push, by its length."""
_PUSH_FRAMES = 3
"""Number of frames that a push takes."""
_JUDGED_FRAMES = 25
"""Number of frames after which its effect is judged."""


def pushed(run: Recording, config: NavigatorConfig, count: int) -> dict[str, Any]:
    """Push the robot at `count` places of a drive in a new map by each of `PUSHED_M`, in a
    direction and with a turn that the number of the place draws.

    `left_m` is how far the error of the position is from what it is without the push, in the
    median: without the scans it would be the push. `told` counts the pushes that were noticed,
    `not_pushed` the same drives without any, and `false` those in which one was told.
    """
    starts = run.starts(count + 1)[1:]  # what has seen nothing yet cannot notice
    away: dict[float, list[float]] = {length_m: [] for length_m in PUSHED_M}
    told, false = dict.fromkeys(PUSHED_M, 0), 0
    for number, at in enumerate(starts):
        odometry = run.odometry(number, run.drive.true_poses[0])
        alone, was_told = _error_after(run, config, odometry, at)
        false += was_told
        rng = np.random.default_rng((run.seed, number))
        direction, turn = rng.uniform(-math.pi, math.pi), _TURN_RAD_PER_M * rng.standard_normal()
        for length_m in PUSHED_M:
            push = Pose2(
                x_m=length_m * math.cos(direction),
                y_m=length_m * math.sin(direction),
                yaw_rad=length_m * turn,
            )
            error, was_told = _error_after(run, config, _without(odometry, at, push), at)
            away[length_m].append(float(np.hypot(*(error - alone))))
            told[length_m] += was_told
    return {
        "lengths_m": list(PUSHED_M),
        "pushes": len(starts),
        "told": list(told.values()),
        "left_m": [float(np.median(values)) for values in away.values()],
        "worst_m": [max(values) for values in away.values()],
        "not_pushed": len(starts),
        "false": false,
    }


def _without(odometry: list[Pose2], at: int, push: Pose2) -> list[Pose2]:
    """Return odometry that misses a push, which is a part of the motion of some frames."""
    missed = Pose2(
        x_m=push.x_m / _PUSH_FRAMES,
        y_m=push.y_m / _PUSH_FRAMES,
        yaw_rad=push.yaw_rad / _PUSH_FRAMES,
    ).inverse()
    poses = odometry[:at]
    for k, (before, after) in enumerate(pairwise(odometry[at - 1 :])):
        step = before.inverse() @ after
        poses.append(poses[-1] @ (missed @ step if k < _PUSH_FRAMES else step))
    return poses


def _error_after(
    run: Recording, config: NavigatorConfig, odometry: list[Pose2], at: int
) -> tuple[Floats, bool]:
    """Return the (2,) error of the position in metres some frames after one, and whether a push was
    told by then."""
    replay, drive = Replay(config), run.drive
    last = min(at + _JUDGED_FRAMES, len(drive) - 1)
    for k in range(last + 1):
        place = replay.advance(drive, k, odometry[k])
    true = drive.true_poses[last]
    error = np.array([place.T_map_base.x_m - true.x_m, place.T_map_base.y_m - true.y_m])
    return error, replay.pushes > 0
