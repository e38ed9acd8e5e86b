"""Figures of a replayed drive, of made-up errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from app.evaluation.localisation.figures import (
    figures,
    longest_s,
    relative_error_m,
    summarise,
)
from app.evaluation.localisation.replay import Run
from navcore.geometry.arrays import Floats
from navcore.localisation.estimate import LocalisationState

STEP_M = 0.5


def ran(
    errors: Floats, *, heading_rad: float = 0.0, states: tuple[LocalisationState, ...] = ()
) -> Run:
    """Return a straight drive of `STEP_M` a frame with these (N, 3) errors, and odometry that is
    ten times as wrong."""
    count = len(errors)
    along = STEP_M * np.arange(count)
    ways = (along * math.cos(heading_rad), along * math.sin(heading_rad))
    return Run(
        errors=errors,
        odometry_errors=10 * errors,
        nees=np.arange(float(count)),
        states=states or (LocalisationState.LOCATED,) * count,
        durations_s=np.linspace(0.001, 0.003, count),
        true_poses=np.column_stack([*ways, np.full(count, heading_rad)]),
        loops=(2, 1),
    )


def test_the_longest_time_is_that_of_frames_without_a_break() -> None:
    assert longest_s(np.zeros(5, dtype=np.bool_)) == 0.0
    assert longest_s(np.array([], dtype=np.bool_)) == 0.0
    assert longest_s(np.array([1, 1, 0, 1, 1, 1, 0, 1], dtype=np.bool_)) == pytest.approx(0.6)
    assert longest_s(np.ones(4, dtype=np.bool_)) == pytest.approx(0.8)


def test_an_error_that_stays_is_no_error_of_the_motion_and_one_that_grows_is() -> None:
    count = 41  # 20 m
    offset = np.tile((0.3, -0.2, 0.0), (count, 1))
    assert relative_error_m(ran(offset)) == pytest.approx(0.0, abs=1e-9)
    grows = np.zeros((count, 3))
    grows[:, 1] = 0.01 * STEP_M * np.arange(count)  # 1 % of the way, to the side
    for heading_rad in (0.0, 2.0):
        assert relative_error_m(ran(grows, heading_rad=heading_rad)) == pytest.approx(0.1)


def test_a_wrong_heading_is_an_error_of_the_motion_after_it() -> None:
    turned = np.tile((0.0, 0.0, 0.1), (41, 1))  # as a wrong map would have it
    assert relative_error_m(ran(turned)) == pytest.approx(10.0 * 2 * math.sin(0.05))


def test_a_short_drive_has_no_relative_error() -> None:
    assert math.isnan(relative_error_m(ran(np.zeros((20, 3)))))  # 9.5 m


def test_the_figures_of_a_run_are_of_its_frames() -> None:
    errors = np.zeros((4, 3))
    errors[:, 0], errors[:, 2] = (0.0, 0.0, 0.3, 0.4), (0.0, 0.0, 0.0, -math.radians(2.0))
    located, lost = LocalisationState.LOCATED, LocalisationState.LOST
    row = figures(ran(errors, states=(located, located, lost, located)))
    assert row["rms_m"] == pytest.approx(0.25) and row["max_m"] == row["final_m"] == 0.4
    assert row["odometry_rms_m"] == pytest.approx(2.5)
    assert row["worse_than_odometry_m"] == pytest.approx(-2.25)
    assert row["yaw_p95_deg"] == pytest.approx(1.7)
    assert (row["nees"], row["overconfident_s"]) == (1.5, 0.0)
    assert (row["located_share"], row["lost_share"]) == (0.75, 0.25)
    assert (row["loops_right"], row["loops_wrong"]) == (2.0, 1.0)
    assert row["p50_ms"] == pytest.approx(2.0)


def test_the_worst_run_is_the_largest_error_and_the_smallest_share_located() -> None:
    rows = [
        {"rms_m": 0.123456, "located_share": 0.9},
        {"rms_m": 0.5, "located_share": 0.99},
        {"rms_m": 0.2, "located_share": 0.7},
    ]
    told = summarise(rows)
    assert told["runs"] == 3
    assert told["median"] == {"rms_m": 0.2, "located_share": 0.9}
    assert told["worst"] == {"rms_m": 0.5, "located_share": 0.7}
    assert told["by_run"]["rms_m"] == [0.1235, 0.5, 0.2]
    assert summarise([]) == {"runs": 0, "median": {}, "worst": {}, "by_run": {}}
