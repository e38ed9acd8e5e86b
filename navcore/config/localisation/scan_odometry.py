"""Configuration of the motion that is measured by matching scans with each other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanOdometryConfig:
    """Motion between a scan and one a short way before."""

    spacing_m: float = ranged(0.1, 5.0, default=0.5)
    """Distance in metres between the two scans: over more of it, the parts of surfaces that come
    into view and leave it pull the match towards no motion."""
    spacing_deg: float = ranged(1.0, 90.0, default=15.0)
    """Turn in degrees between them, if the robot turns."""
    window_m: float = ranged(0.01, 1.0, default=0.08)
    """Distance in metres within which the surface of a point is looked for."""
    loose_m: float = ranged(0.001, 1.0, default=0.03)
    """Standard deviation in metres of the motion by odometry, as far as the match is held to it."""
    loose_rad: float = ranged(0.001, 1.0, default=0.01)
    """The same for the turn in radians."""
    point_weight: float = ranged(0.0, 1.0, default=0.1)
    """Number of measurements that a point counts as: neighbours err alike."""
    floor_m: float = ranged(0.0, 0.5, default=0.005)
    """Standard deviation in metres of a motion that no number of points makes smaller."""
    floor_deg: float = ranged(0.0, 10.0, default=0.1)
    """The same for the turn in degrees."""
    gate_sigmas: float = ranged(1.0, 10.0, default=3.0)
    """Deviation from odometry in standard deviations beyond which a motion is refused."""
    check_s: float = ranged(0.1, 10.0, default=0.5)
    """Time in seconds after which a robot that has not come so far looks whether it was pushed."""
    refused_s: float = ranged(0.0, 10.0, default=0.2)
    """Time in seconds between two searches for where the robot was pushed to: a push takes as
    long."""
    over_m: float = ranged(0.0, 1.0, default=0.05)
    """Largest distance in metres between the places found by two searches, one after the other, for
    the push to be over: people who walk together before the camera go farther between them."""
    over_deg: float = ranged(0.0, 90.0, default=2.0)
    """Largest angle in degrees between the two."""
    pushed_share: float = ranged(0.0, 1.0, default=0.7)
    """Least share of the points of a scan that fits where the robot was pushed to."""
    pushed_evidence: float = ranged(0.0, 100.0, default=0.8)
    """Least logarithm of the ratio of likelihoods of that place and where odometry has the robot,
    for each point of the scan."""

    @property
    def floor(self) -> npt.NDArray[np.float64]:
        """(3, 3) covariance of a motion that no number of points makes smaller."""
        return np.diag([self.floor_m, self.floor_m, math.radians(self.floor_deg)]) ** 2
