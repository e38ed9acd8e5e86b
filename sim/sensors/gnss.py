"""The GNSS receiver: positions in the map, with the errors of RTK or of plain code measurements,
and outages."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navcore.geometry.transform import Pose2
from navcore.robot.fix import FixSource, PositionFix
from sim.sensors.gnss_settings import Gnss, GnssKind

KEPT_S = 1.0
"""Time for which a fix is in the frames: who skips frames misses no fix."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssErrors:
    """Errors of one kind of receiver, along each axis."""

    noise_m: float
    """Standard deviation of the error that is new in each fix."""
    bias_m: float
    """Standard deviation of the error that wanders: atmosphere and reflections."""
    bias_s: float
    """Time constant of the wandering error, a first-order Gauss–Markov process."""

    @property
    def sigma_m(self) -> float:
        """Standard deviation of a fix."""
        return math.hypot(self.noise_m, self.bias_m)


GNSS_ERRORS: dict[GnssKind, GnssErrors] = {
    "rtk": GnssErrors(noise_m=0.015, bias_m=0.013, bias_s=30.0),
    "plain": GnssErrors(noise_m=0.4, bias_m=1.45, bias_s=120.0),
}
"""Errors of each kind: 2 cm and 1.5 m in all."""


class GnssReceiver:
    """Measures the position of the base."""

    def __init__(self, gnss: Gnss, rng: np.random.Generator) -> None:
        self._gnss, self._rng, self._errors = gnss, rng, GNSS_ERRORS[gnss.kind]
        self._bias = self._errors.bias_m * rng.standard_normal(2)
        self._count = 0
        self.fixes: tuple[PositionFix, ...] = ()
        """Fixes of the last second, in order of time."""

    def observe(self, stamp_ns: int, pose: Pose2) -> None:
        """Measure a true pose, when a fix is due at this simulated time."""
        t_s = stamp_ns / 1e9
        if t_s * self._gnss.rate_hz < self._count:
            return
        self._count += 1
        fix = self._measured(stamp_ns, pose)
        recent = (one for one in self.fixes if stamp_ns - one.stamp_ns < KEPT_S * 1e9)
        in_outage = any(begin_s <= t_s < end_s for begin_s, end_s in self._gnss.outages_s)
        self.fixes = (*recent, *(() if in_outage else (fix,)))

    def _measured(self, stamp_ns: int, pose: Pose2) -> PositionFix:
        errors, period_s = self._errors, 1.0 / self._gnss.rate_hz
        kept = math.exp(-period_s / errors.bias_s)
        wander, noise = self._rng.standard_normal((2, 2))
        self._bias = kept * self._bias + math.sqrt(1 - kept * kept) * errors.bias_m * wander
        x, y = np.array([pose.x_m, pose.y_m]) + self._bias + errors.noise_m * noise
        return PositionFix(
            stamp_ns=stamp_ns,
            x_m=float(x),
            y_m=float(y),
            covariance=errors.sigma_m**2 * np.eye(2),
            source=FixSource.GNSS,
            correlation_s=errors.bias_s,
        )
