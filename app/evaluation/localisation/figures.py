"""Figures of a replayed drive: errors, consistency and processor time."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from app.evaluation.localisation.drives import FRAME_NS
from app.evaluation.localisation.replay import Run
from navcore.geometry.arrays import Bools
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationState

OVERCONFIDENT = 30.0
"""NEES that must not last."""
RPE_M = 10.0
"""Distance in metres over which the relative error is measured."""


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
        "overconfident_s": longest_s(run.nees > OVERCONFIDENT),
        "loops_right": float(run.loops[0]),
        "loops_wrong": float(run.loops[1]),
        "odometry_rms_m": float(np.sqrt(np.mean(odometry**2))),
        "worse_than_odometry_m": float(np.sqrt(np.mean(away**2)) - np.sqrt(np.mean(odometry**2))),
        "odometry_final_m": float(odometry[-1]),
        "located_share": float(np.mean([s is LocalisationState.LOCATED for s in run.states])),
        "lost_share": float(np.mean([s is LocalisationState.LOST for s in run.states])),
        "p50_ms": float(np.percentile(milliseconds, 50)),
        "p99_ms": float(np.percentile(milliseconds, 99)),
    }


def longest_s(frames: Bools) -> float:
    """Return the longest time without a break for which (N,) frames are true, in seconds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], frames.astype(np.int8), [0]])))
    return float(np.max(edges[1::2] - edges[::2], initial=0)) * FRAME_NS / 1e9


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


def summarise(rows: Iterable[dict[str, float]]) -> dict[str, Any]:
    """Return each figure of every run, to four digits, with its median and its worst."""
    rows = list(rows)
    names = rows[0] if rows else {}
    by_run = {name: [float(f"{row[name]:.4g}") for row in rows] for name in names}
    return {
        "runs": len(rows),
        "median": {name: float(np.median(values)) for name, values in by_run.items()},
        "worst": {
            name: (min if name == "located_share" else max)(values)
            for name, values in by_run.items()
        },
        "by_run": by_run,
    }


def _pose(row: npt.NDArray[np.float64]) -> Pose2:
    return Pose2(x_m=float(row[0]), y_m=float(row[1]), yaw_rad=float(row[2]))
