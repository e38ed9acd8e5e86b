"""Grades of odometry, integrated without physics along a drive of 124 m."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, Twist, wrap_angle
from sim.robot.odometry import Gyro, Odometry
from sim.robot.odometry_grade import (
    ODOMETRY_ERRORS,
    OdometryErrors,
    OdometryGrade,
    odometry_grade,
)
from sim.scenario.variation import Source, generator

PERIOD_S = 1 / 12
TRACK_M = 0.57
RUNS = 60
OUT = ((-8, -5.5), (-8, 0), (3, 0), (3, 3), (0, 7.6))
ON = ((5, 7), (12, 6), (9, 4), (9, 0), (11, 0), (11, -5), (10.5, -7))
BACK = ((11, -5), (11, 0), (-8, 0), (-8, -5.5), (-12.5, -6))
ROUTE = ((-12.5, -6), *OUT, *ON, *BACK, *OUT)
"""Corners of a drive through the three goals of the office, back, and to the first goal again."""


def drive() -> Iterator[Twist]:
    """Yield the velocity in each period."""
    yaw_rad = 0.0
    for (x0, y0), (x1, y1) in pairwise(ROUTE):
        heading = math.atan2(y1 - y0, x1 - x0)
        turn, length_m = wrap_angle(heading - yaw_rad), math.hypot(x1 - x0, y1 - y0)
        yaw_rad = heading
        turning, driving = math.ceil(abs(turn) / 0.6 / PERIOD_S), round(length_m / 0.75 / PERIOD_S)
        yield from [Twist(v_mps=0.0, w_radps=turn / max(turning, 1) / PERIOD_S)] * turning
        yield from [Twist(v_mps=length_m / driving / PERIOD_S, w_radps=0.0)] * driving


def exact() -> OdometryErrors:
    """Return errors of zero."""
    ideal = ODOMETRY_ERRORS[OdometryGrade.IDEAL]
    return replace(ideal, length_scale=0.0, gyro_bias_radps=0.0, gyro_noise=0.0)


class Drive:
    """True motion and odometry side by side."""

    def __init__(self, errors: OdometryErrors, seed: int = 0) -> None:
        slip = generator(seed, Source.SLIP)
        self.gyro = Gyro(errors, generator(seed, Source.GYRO), PERIOD_S, scale_rng=slip)
        self.true = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
        self.odometry = Odometry(
            self.true, errors, generator(seed, Source.ENCODER), PERIOD_S, slip_rng=slip
        )
        self.left_m = self.right_m = 0.0
        self.odometry.update(0.0, 0.0, 0.0)

    def step(self, twist: Twist, gradient: tuple[float, float] = (0.0, 0.0)) -> None:
        turn, ahead_m = twist.w_radps * PERIOD_S, twist.v_mps * PERIOD_S
        half = Pose2(x_m=0.0, y_m=0.0, yaw_rad=turn / 2)
        self.true = self.true @ half @ Pose2(x_m=ahead_m, y_m=0.0, yaw_rad=turn / 2)
        self.left_m += ahead_m - turn * TRACK_M / 2
        self.right_m += ahead_m + turn * TRACK_M / 2
        self.odometry.update(self.left_m, self.right_m, self.gyro.measure(twist.w_radps), gradient)

    def errors(self) -> tuple[float, float]:
        """Return the errors in metres and degrees."""
        pose = self.odometry.pose
        turned = math.degrees(abs(wrap_angle(pose.yaw_rad - self.true.yaw_rad)))
        return self.true.distance_to(pose.x_m, pose.y_m), turned


def driven(errors: OdometryErrors, seed: int) -> tuple[float, float]:
    run = Drive(errors, seed)
    for twist in drive():
        run.step(twist)
    return run.errors()


@pytest.mark.long
@pytest.mark.parametrize(
    "grade, median_m, most_m, median_deg",
    [
        (OdometryGrade.IDEAL, 0.04, 0.09, 0.15),
        (OdometryGrade.TYPICAL, 0.35, 0.77, 1.3),
        (OdometryGrade.POOR, 1.4, 3.1, 5.3),
    ],
)
def test_after_124_m_the_errors_of_each_grade_are_of_the_size_that_it_promises(
    grade: OdometryGrade, median_m: float, most_m: float, median_deg: float
) -> None:
    found = np.array([driven(ODOMETRY_ERRORS[grade], seed) for seed in range(RUNS)])
    assert np.median(found[:, 0]) == pytest.approx(median_m, rel=0.4)
    assert np.quantile(found[:, 0], 0.9) == pytest.approx(most_m, rel=0.4)
    assert np.median(found[:, 1]) == pytest.approx(median_deg, rel=0.6)


@given(st.sampled_from(list(OdometryGrade)), st.integers(0, 50))
def test_the_same_seed_errs_the_same(grade: OdometryGrade, seed: int) -> None:
    runs = [Drive(ODOMETRY_ERRORS[grade], seed) for _ in range(2)]
    for run in runs:
        for _ in range(24):
            run.step(Twist(v_mps=0.5, w_radps=0.4), (0.1, -0.05))
    assert runs[0].odometry.pose == runs[1].odometry.pose


def spread_m(errors: OdometryErrors, twist: Twist) -> float:
    """Return the standard deviation over runs of the position after 20 s."""
    found = []
    for seed in range(40):
        run = Drive(errors, seed)
        for _ in range(round(20 / PERIOD_S)):
            run.step(twist)
        found.append(run.errors()[0])
    return float(np.sqrt(np.mean(np.square(found))))


def test_wheels_slip_on_straights_and_more_in_turns() -> None:
    straight, turn = Twist(v_mps=0.5, w_radps=0.0), Twist(v_mps=0.0, w_radps=0.8)
    slipping = replace(exact(), slip=0.03)
    assert spread_m(exact(), straight) < 1e-3 and spread_m(exact(), turn) < 1e-3
    assert 0.01 < spread_m(slipping, straight) < 0.04
    assert spread_m(slipping, turn) < 1e-3
    assert spread_m(replace(slipping, turn_slip=0.1), turn) > 5e-3


@pytest.mark.parametrize(
    "v_mps, gradient, ahead_m, left_m",
    [
        (0.5, (0.1, 0.0), 0.1, 0.0),  # uphill the wheels count more than the body moves
        (0.5, (-0.1, 0.0), -0.1, 0.0),
        (-0.5, (0.1, 0.0), 0.1, 0.0),  # in reverse downhill they count less
        (0.5, (0.0, 0.1), 0.0, 0.1),  # the ground rises to the left, and the body slides right
        (0.5, (0.0, -0.1), 0.0, -0.1),
        (0.0, (0.1, 0.1), 0.0, 0.0),
    ],
)
def test_on_a_slope_the_body_slides_downhill_and_odometry_does_not(
    v_mps: float, gradient: tuple[float, float], ahead_m: float, left_m: float
) -> None:
    """Over 10 m, with a slip of 0.1 per slope, the slope of 0.1 makes 0.1 m."""
    run = Drive(replace(exact(), slope_slip=0.1))
    for _ in range(round(20 / PERIOD_S)):
        run.step(Twist(v_mps=v_mps, w_radps=0.0), gradient)
    pose = run.odometry.pose
    assert pose.x_m - run.true.x_m == pytest.approx(ahead_m, abs=2e-3)
    assert pose.y_m - run.true.y_m == pytest.approx(left_m, abs=2e-3)


def test_an_unknown_grade_is_refused_by_name() -> None:
    assert odometry_grade("poor") is OdometryGrade.POOR
    with pytest.raises(BadConfiguration, match="'good', expected one of: ideal, typical, poor"):
        odometry_grade("good")
