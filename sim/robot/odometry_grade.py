"""Grades of odometry: how large the errors of encoders and gyro are in a run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from navcore.errors import BadConfiguration


class OdometryGrade(StrEnum):
    """How good the odometry of the simulated robot is."""

    IDEAL = "ideal"
    """Calibrated wheels that hardly slip and a gyro of tactical grade; better than usual."""
    TYPICAL = "typical"
    """Wheels and a MEMS gyro as a serviced robot has them."""
    POOR = "poor"
    """Worn tyres, loose ground and a cheap gyro."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryErrors:
    """Sizes of the errors of one grade; those "over runs" are drawn once in each run."""

    length_scale: float
    """Standard deviation over runs of the relative error of the wheel circumference, caused by tyre
    pressure and load."""
    gyro_scale: float
    """Standard deviation over runs of the relative error of the yaw rate."""
    gyro_bias_radps: float
    """Standard deviation over runs of the bias that the calibration at standstill leaves, rad/s."""
    gyro_noise: float
    """White noise density of the yaw rate, rad/s per √Hz."""
    slip: float
    """Standard deviation of the slip of one side's wheels on 0.2 s of straight driving, as a share
    of the distance."""
    turn_slip: float
    """The same for the distance that the sides roll against each other in a turn, which drags the
    wheels sideways."""
    slope_slip: float
    """Slip per slope: the share of the distance that the body slides downhill, divided by the rise
    per metre."""


def _degrees_per_hour(rate: float) -> float:
    return math.radians(rate) / 3600


ODOMETRY_ERRORS: dict[OdometryGrade, OdometryErrors] = {
    OdometryGrade.IDEAL: OdometryErrors(
        length_scale=0.0015,
        gyro_scale=0.0,
        gyro_bias_radps=_degrees_per_hour(4.0),
        gyro_noise=math.radians(0.005),
        slip=0.0,
        turn_slip=0.0,
        slope_slip=0.0,
    ),
    OdometryGrade.TYPICAL: OdometryErrors(
        length_scale=0.01,
        gyro_scale=0.003,
        gyro_bias_radps=_degrees_per_hour(18.0),
        gyro_noise=math.radians(0.01),
        slip=0.03,
        turn_slip=0.1,
        slope_slip=0.1,
    ),
    OdometryGrade.POOR: OdometryErrors(
        length_scale=0.02,
        gyro_scale=0.01,
        gyro_bias_radps=_degrees_per_hour(108.0),
        gyro_noise=math.radians(0.02),
        slip=0.05,
        turn_slip=0.2,
        slope_slip=0.25,
    ),
}
"""Errors of each grade."""


def odometry_grade(name: str) -> OdometryGrade:
    """Return the grade of a name; raises `BadConfiguration` for an unknown one."""
    try:
        return OdometryGrade(name)
    except ValueError:
        known = ", ".join(OdometryGrade)
        raise BadConfiguration(f"odometry is {name!r}, expected one of: {known}") from None
