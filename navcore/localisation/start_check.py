"""Confirmation of the place at which a robot starts in a saved map: by its first looks, and by what
it sees on its first metres."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.localisation import StartConfig
from navcore.geometry.transform import Matrix


class StartCheck:
    """Believes the place once the scans have fitted there for a while.

    Where too little is in view to tell, the place is believed as it was given: nothing speaks
    against it, and the robot goes on by dead reckoning. Much in view where the map shows nothing is
    no such case: this may be another map.
    """

    def __init__(self, config: StartConfig) -> None:
        self._config = config
        self._began_ns: int | None = None
        self._fits_since_ns: int | None = None
        self._has_seen = False

    @property
    def covariance(self) -> Matrix:
        """(3, 3) covariance of the place that was given."""
        sigma_rad = math.radians(self._config.sigma_deg)
        return np.diag([self._config.sigma_m, self._config.sigma_m, sigma_rad]) ** 2

    def after(self, share: float | None, points: int, stamp_ns: int) -> bool | None:
        """Return whether the place is believed after one more frame, whose scan has `points` of
        which a share fits the saved map, None where it shows none of them; None while it is
        open."""
        config = self._config
        self._began_ns = stamp_ns if self._began_ns is None else self._began_ns
        self._has_seen = self._has_seen or share is not None or points >= config.telling_points
        if share is None or share < config.share:
            self._fits_since_ns = None
        elif self._fits_since_ns is None:
            self._fits_since_ns = stamp_ns
        since_ns = self._fits_since_ns
        if since_ns is not None and stamp_ns - since_ns >= config.fitting_s * 1e9:
            return True
        if stamp_ns - self._began_ns < config.decide_s * 1e9:
            return None
        return not self._has_seen


class Probation:
    """The first metres from a place that the first looks have confirmed.

    Rooms are alike: a wrong map fits, too, where the robot stands. What it sees on its way has to
    fit as well for some metres, or the place was wrong.
    """

    def __init__(self, config: StartConfig) -> None:
        self._config = config
        self._fitting_m = self._doubt_m = 0.0

    def after(self, share: float | None, points: int, moved_m: float) -> bool | None:
        """Return whether the place is right after one more frame, as `StartCheck.after` takes it,
        at which the robot has moved by some metres; None while it is open."""
        config = self._config
        if share is not None and share >= config.share:
            self._fitting_m += moved_m
            self._doubt_m = max(self._doubt_m - moved_m, 0.0)
        elif points >= config.telling_points:
            self._doubt_m += moved_m
        if self._doubt_m >= config.doubt_m:
            return False
        return True if self._fitting_m >= config.probation_m else None
