"""Confirmation of the place at which a robot starts in a saved map."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.localisation import StartConfig
from navcore.geometry.transform import Matrix
from navcore.localisation.estimate import LocalisationEstimate


class StartCheck:
    """Believes the place once the scans have fitted there for a while.

    Where too little is in view to tell, the place is believed as it was given: nothing speaks
    against it, and the robot goes on by dead reckoning.
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

    def after(self, estimate: LocalisationEstimate, stamp_ns: int) -> bool | None:
        """Return whether the place is believed after one more frame; None while it is open."""
        config, share = self._config, estimate.match_share
        self._began_ns = stamp_ns if self._began_ns is None else self._began_ns
        self._has_seen = self._has_seen or share is not None
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
