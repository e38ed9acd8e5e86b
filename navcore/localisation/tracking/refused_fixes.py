"""Absolute positions that contradict the estimate: when they are right and it is wrong.

One of them is an outlier. If they agree with each other for seconds while nothing confirms the
estimate, the robot was moved by other means than its wheels.
"""

from __future__ import annotations

import numpy as np

from navcore.config.localisation.localisation import TrackingConfig
from navcore.geometry.transform import Matrix

_LEAST = 4
"""Number of fixes that must agree."""
_LEAST_LIFE_S = 2.0
"""Least time in seconds for which they count: some receivers bring one each second."""
_NOTHING = np.zeros(2)


class RefusedFixes:
    """The fixes that contradict the estimate, since it was confirmed last. Those after which none
    has come for longer than they must agree say nothing more."""

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._life_ns = max(config.refused_s, _LEAST_LIFE_S) * 1e9
        self._first_ns, self._newest_ns, self._count = 0, 0, 0
        self._newest, self._is_interrupted = _NOTHING, False

    def offset(self, stamp_ns: int) -> Matrix:
        """Return (2,) metres from the estimate to where these fixes have the robot at the time of a
        frame; 0 unless enough of them agree."""
        is_told = self._count >= _LEAST and stamp_ns - self._newest_ns <= self._life_ns
        return self._newest if is_told else _NOTHING

    def add(self, stamp_ns: int, residual: Matrix, covariance: Matrix) -> bool:
        """Note a fix that contradicts the estimate; return whether it is to be believed after all.

        `residual`: (2,) measured minus estimated position in metres; `covariance`: its (2, 2). It
        is compared with the one before, as a wrong heading of the estimate lets the residual grow
        with the distance driven.
        """
        if stamp_ns - self._newest_ns > self._life_ns:
            self.clear()
        self._newest_ns = stamp_ns
        if not self._agrees(residual, 2.0 * covariance):
            if self._count > 1 and not self._is_interrupted:
                self._is_interrupted = True  # one outlier among those that agree
                return False
            self._first_ns, self._count = stamp_ns, 0
        self._count += 1
        self._newest, self._is_interrupted = residual, False
        lasted_s = (stamp_ns - self._first_ns) / 1e9
        return self._count >= _LEAST and lasted_s >= self._config.refused_s

    def confirm(self, residual: Matrix, covariance: Matrix) -> None:
        """Forget them if a position that confirms the estimate contradicts them: one that is too
        uncertain to tell, or only across a corridor, does not. Arguments as of `add`."""
        if not self._agrees(residual, covariance):
            self.clear()

    def clear(self) -> None:
        """Forget them: the estimate was set."""
        self._count, self._is_interrupted = 0, False

    def _agrees(self, residual: Matrix, covariance: Matrix) -> bool:
        if not self._count:
            return False
        away = residual - self._newest
        spread = covariance + self._config.floor_m**2 * np.eye(2)
        return bool(away @ np.linalg.solve(spread, away) <= self._config.gate_sigmas**2)
