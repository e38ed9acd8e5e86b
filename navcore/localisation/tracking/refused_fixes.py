"""Absolute positions that contradict the estimate: when they are right and it is wrong.

One of them is an outlier. If they agree with each other for seconds while nothing confirms the
estimate, the robot was moved by other means than its wheels.
"""

from __future__ import annotations

import numpy as np

from navcore.config.localisation import TrackingConfig
from navcore.geometry.transform import Matrix

_LEAST = 4
"""Number of fixes that must agree."""


class RefusedFixes:
    """The refused fixes since the estimate was confirmed last."""

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._first_ns, self._count = 0, 0
        self._mean = np.zeros(2)

    def add(self, stamp_ns: int, residual: Matrix, covariance: Matrix) -> bool:
        """Note a refused fix; return whether it is to be believed after all.

        `residual`: (2,) measured minus estimated position in metres; `covariance`: its (2, 2).
        """
        away = residual - self._mean
        spread = 2.0 * covariance + self._config.floor_m**2 * np.eye(2)
        if not self._count or away @ np.linalg.solve(spread, away) > self._config.gate_sigmas**2:
            self._first_ns, self._count, self._mean = stamp_ns, 1, residual
            return False
        self._count += 1
        self._mean = self._mean + away / self._count
        lasted_s = (stamp_ns - self._first_ns) / 1e9
        return self._count >= _LEAST and lasted_s >= self._config.refused_s

    def clear(self) -> None:
        """Forget them: the estimate was confirmed, or set."""
        self._count = 0
