"""Wheel odometry: distance from the encoders, heading from the gyro. Both err as real ones do,
differently in each run."""

from __future__ import annotations

import math

import numpy as np

from navcore.geometry.transform import Pose2, Twist, wrap_angle
from sim.robot.odometry_grade import OdometryErrors

TICKS_PER_M = 78_000
"""Encoder ticks of the Husky per metre along the ground."""
GYRO_BIAS_DRIFT = math.radians(8.0) / 3600 / math.sqrt(3600)
"""Random walk of the bias, rad/s per √s: 8°/h within an hour."""
SPEED_FILTER_S = 0.025
"""Time constant of the low-pass filter on the encoder speed."""
SLIP_PERIOD_S = 0.2
"""Time for which the slip of a wheel stays the same: that of a patch of ground."""


class Gyro:
    """A gyro about z, read at every physics step."""

    def __init__(
        self,
        errors: OdometryErrors,
        rng: np.random.Generator,
        period_s: float,
        *,
        scale_rng: np.random.Generator,
    ) -> None:
        self._rng = rng
        self._bias_radps = errors.gyro_bias_radps * float(rng.standard_normal())
        self._drift_radps = GYRO_BIAS_DRIFT * math.sqrt(period_s)
        self._noise_radps = errors.gyro_noise / math.sqrt(period_s)
        self._scale = 1.0 + errors.gyro_scale * float(scale_rng.standard_normal())

    def measure(self, true_rate_radps: float) -> float:
        """Return the measured yaw rate in rad/s."""
        drift, noise = self._rng.standard_normal(2)
        self._bias_radps += self._drift_radps * float(drift)
        return self._scale * true_rate_radps + self._bias_radps + self._noise_radps * float(noise)


class Slip:
    """Distance in metres that the wheels roll, and the body does not move: more in turns, and
    downhill on slopes.

    The body of the simulation hardly slips, so the slip is added to what the encoders count; to
    odometry that is the same.
    """

    def __init__(self, errors: OdometryErrors, rng: np.random.Generator, period_s: float) -> None:
        self._errors, self._rng = errors, rng
        self._steps, self._every = 0, max(1, round(SLIP_PERIOD_S / period_s))
        self._shares = (0.0, 0.0)
        self._rolled: tuple[float, float] | None = None
        self.left_m = self.right_m = 0.0
        """Distance that the encoders of each side have counted too much since the start."""

    def update(self, left_m: float, right_m: float, gradient: tuple[float, float]) -> float:
        """Add the slip of one step. Returns the distance that the body slid to the right without
        any wheel rolling.

        `left_m` and `right_m`: distance that the wheels have rolled since the start; `gradient`:
        slope ahead and to the left, rise per metre.
        """
        errors = self._errors
        if self._steps % self._every == 0 and (errors.slip or errors.turn_slip):
            left, right = self._rng.standard_normal(2)
            self._shares = (float(left), float(right))
        self._steps += 1
        before, self._rolled = self._rolled or (left_m, right_m), (left_m, right_m)
        left_step, right_step = left_m - before[0], right_m - before[1]
        ahead_m = abs(left_step + right_step) / 2
        size_m = errors.slip * ahead_m + errors.turn_slip * abs(right_step - left_step) / 2
        uphill_m = errors.slope_slip * gradient[0] * ahead_m
        self.left_m += self._shares[0] * size_m + uphill_m
        self.right_m += self._shares[1] * size_m + uphill_m
        return errors.slope_slip * gradient[1] * ahead_m


class Odometry:
    """Dead reckoning by encoders and gyro; nothing corrects it."""

    def __init__(
        self,
        origin: Pose2,
        errors: OdometryErrors,
        rng: np.random.Generator,
        period_s: float,
        *,
        slip_rng: np.random.Generator,
    ) -> None:
        self.pose = origin
        """T_odom_base."""
        self.twist = Twist(v_mps=0.0, w_radps=0.0)
        """Measured velocity."""
        self._period_s = period_s
        self._scale = 1.0 + errors.length_scale * float(rng.standard_normal())
        self._slip = Slip(errors, slip_rng, period_s)
        self._ticks: tuple[int, int] | None = None

    def update(
        self,
        left_m: float,
        right_m: float,
        yaw_rate_radps: float,
        gradient: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Integrate one physics step: the distance in metres that the wheels of each side have
        rolled since the start, the measured yaw rate, and the slope of the ground ahead and to the
        left."""
        # The body slides to the right of where odometry believes it: odometry is to its left.
        beside_m = self._slip.update(left_m, right_m, gradient)
        ticks = (
            self._count(left_m + self._slip.left_m),
            self._count(right_m + self._slip.right_m),
        )
        before, self._ticks = self._ticks or ticks, ticks
        step_m = (ticks[0] - before[0] + ticks[1] - before[1]) / 2 / TICKS_PER_M
        turn_rad = yaw_rate_radps * self._period_s
        heading = self.pose.yaw_rad + turn_rad / 2
        cos, sin = math.cos(heading), math.sin(heading)
        self.pose = Pose2(
            x_m=self.pose.x_m + step_m * cos - beside_m * sin,
            y_m=self.pose.y_m + step_m * sin + beside_m * cos,
            yaw_rad=wrap_angle(self.pose.yaw_rad + turn_rad),
        )
        share = self._period_s / (SPEED_FILTER_S + self._period_s)
        speed = self.twist.v_mps + share * (step_m / self._period_s - self.twist.v_mps)
        self.twist = Twist(v_mps=speed, w_radps=yaw_rate_radps)

    def _count(self, rolled_m: float) -> int:
        return math.floor(rolled_m * self._scale * TICKS_PER_M)
