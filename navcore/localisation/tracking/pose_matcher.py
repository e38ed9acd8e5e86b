"""Matching of a scan where the filter expects it, and what the match is worth there."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import Matrix
from navcore.localisation.scans.matching import Match, match, match_widely
from navcore.localisation.scans.scan import Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tracking.pose_filter import PoseFilter

_WIDE_M, _WIDE_RAD = 0.1, math.radians(6.0)
"""Standard deviations of the pose from which a whole window is searched: surfaces lie so close to
each other that those next to such a pose may be others."""
_UNKNOWN = 1e-6 * np.eye(3)
"""Information about a direction that a scan tells nothing of."""


class PoseMatcher:
    """Matches scans with the saved map (`absolute`) or the robot's own, and weighs the result."""

    def __init__(self, config: LocalisationConfig) -> None:
        self._config = config
        rules = config.tracking
        self.floor: Matrix = (
            np.diag([rules.floor_m, rules.floor_m, math.radians(rules.floor_deg)]) ** 2
        )
        """(3, 3) covariance that no match falls below."""

    def match(self, scan: Scan, scan_map: ScanMap, own: PoseFilter, *, absolute: bool) -> Match:
        """Return the most probable pose of a scan given the filter's."""
        config = self._config.match
        covariance = own.covariance_by_motion if absolute else own.covariance_within
        scale = self.scale(len(scan), absolute=absolute)
        sigma_m = math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
        sigma_rad = math.sqrt(covariance[2, 2])
        if absolute and (sigma_m > _WIDE_M or sigma_rad > _WIDE_RAD):
            return match_widely(scan, scan_map, own.pose, covariance, scale=scale, config=config)
        return match(
            scan,
            scan_map,
            own.pose,
            covariance,
            scale=scale,
            search_m=min(config.search_m, 2 * config.fine_m + 3 * sigma_m),
            config=config,
        )

    def scale(self, points: int, *, absolute: bool) -> float:
        """Return the number of measurements that a point of a scan counts as."""
        rules = self._config.tracking
        return 1.0 / rules.correlated_points if absolute else rules.young_points / points

    def error(self, result: Match) -> Matrix:
        """Return the (3, 3) covariance of a match besides that of the surfaces."""
        information = self.scale(result.points, absolute=True) * result.information
        return np.asarray(np.linalg.inv(information + _UNKNOWN) + self.floor)

    def excludes(self, residual: Matrix, covariance: Matrix) -> bool:
        """Return whether an (N,) difference from the expected pose is too large to be believed,
        given its (N, N) covariance."""
        most = self._config.tracking.gate_sigmas**2 + 2.0 * (len(residual) - 1)
        return bool(residual @ np.linalg.solve(covariance, residual) > most)
