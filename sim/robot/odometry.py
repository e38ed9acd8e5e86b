"""Wheel odometry: distance from the encoders, heading from the gyro. Both err as real ones do,
differently in each run."""

from __future__ import annotations

import math

import numpy as np

from navcore.geometry.transform import Pose2, Twist, wrap_angle

TICKS_PER_M = 78_000
"""Encoder ticks of the Husky per metre along the ground."""
ENCODER_SCALE_ERROR = 0.0015
"""Standard deviation over runs of the relative error of the wheel circumference, caused by tyre
pressure and load."""
GYRO_NOISE = math.radians(0.005)
"""White noise density, rad/s per √Hz."""
GYRO_BIAS_RADPS = math.radians(4.0) / 3600
"""Standard deviation over runs of the bias that the calibration at standstill leaves."""
GYRO_BIAS_DRIFT = math.radians(8.0) / 3600 / math.sqrt(3600)
"""Random walk of the bias, rad/s per √s: 8°/h within an hour."""
SPEED_FILTER_S = 0.025
"""Time constant of the low-pass filter on the encoder speed."""


class Gyro:
    """A gyro about z, read at every physics step."""

    def __init__(self, rng: np.random.Generator, period_s: float) -> None:
        self._rng = rng
        self._bias_radps = GYRO_BIAS_RADPS * float(rng.standard_normal())
        self._drift_radps = GYRO_BIAS_DRIFT * math.sqrt(period_s)
        self._noise_radps = GYRO_NOISE / math.sqrt(period_s)

    def measure(self, true_rate_radps: float) -> float:
        """Return the measured yaw rate in rad/s."""
        drift, noise = self._rng.standard_normal(2)
        self._bias_radps += self._drift_radps * float(drift)
        return true_rate_radps + self._bias_radps + self._noise_radps * float(noise)


class Odometry:
    """Dead reckoning by encoders and gyro from the true pose at the start; nothing corrects it
    afterwards."""

    def __init__(self, start: Pose2, rng: np.random.Generator, period_s: float) -> None:
        self.pose = start
        """T_map_base by odometry."""
        self.twist = Twist(v_mps=0.0, w_radps=0.0)
        """Measured velocity."""
        self._period_s = period_s
        self._scale = 1.0 + ENCODER_SCALE_ERROR * float(rng.standard_normal())
        self._ticks: tuple[int, int] | None = None

    def update(self, left_m: float, right_m: float, yaw_rate_radps: float) -> None:
        """Integrate one physics step: the distance in metres that the wheels of each side have
        rolled since the start, and the measured yaw rate."""
        ticks = (self._count(left_m), self._count(right_m))
        before, self._ticks = self._ticks or ticks, ticks
        step_m = (ticks[0] - before[0] + ticks[1] - before[1]) / 2 / TICKS_PER_M
        turn_rad = yaw_rate_radps * self._period_s
        heading = self.pose.yaw_rad + turn_rad / 2
        self.pose = Pose2(
            x_m=self.pose.x_m + step_m * math.cos(heading),
            y_m=self.pose.y_m + step_m * math.sin(heading),
            yaw_rad=wrap_angle(self.pose.yaw_rad + turn_rad),
        )
        share = self._period_s / (SPEED_FILTER_S + self._period_s)
        speed = self.twist.v_mps + share * (step_m / self._period_s - self.twist.v_mps)
        self.twist = Twist(v_mps=speed, w_radps=yaw_rate_radps)

    def _count(self, rolled_m: float) -> int:
        return math.floor(rolled_m * self._scale * TICKS_PER_M)
