"""The accelerometer: roll and pitch against gravity."""

from __future__ import annotations

import math

import numpy as np

BIAS_RAD = math.radians(0.2)
"""Standard deviation over runs of the constant error of each angle: mounting and accelerometer."""
NOISE_RAD = math.radians(0.1)
"""Standard deviation of the error of one measurement, after the filter with the gyro."""


class Accelerometer:
    """Measures how the body is tilted."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        roll, pitch = BIAS_RAD * rng.standard_normal(2)
        self._bias = (float(roll), float(pitch))

    def measure(self, roll_rad: float, pitch_rad: float) -> tuple[float, float]:
        """Return the measured roll and pitch in radians of a body with the true ones."""
        roll, pitch = NOISE_RAD * self._rng.standard_normal(2)
        return roll_rad + self._bias[0] + float(roll), pitch_rad + self._bias[1] + float(pitch)
