"""The motion between two scans, by matching them; odometry tells where to look.

Two scans half a metre apart tell the motion between them to a few millimetres, wherever the map
lies. Over more than that the parts of surfaces that come into view and leave it pull the match
towards no motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Matrix, Pose2
from navcore.localisation.scans.matching import match, match_widely
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap

_WEAK = np.diag([1.0, 1.0, 1.0])
"""Information of a motion by scans in metres and radians below which it tells nothing, as along a
corridor; so that it can be inverted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScanMotion:
    """A measured motion, in axes of the scan that it begins at."""

    expected: Pose2
    """The motion expected by odometry."""
    pull: Matrix
    """(3,) information times the difference of the measured motion from the one expected."""
    information: Matrix
    """(3, 3) information about x and y in metres and yaw in radians, which may be singular."""

    def located(self) -> tuple[Pose2, Matrix]:
        """Return the measured motion and its (3, 3) covariance along the axes after it; what is not
        measured is as expected, and uncertain by a metre."""
        covariance = np.linalg.inv(self.information + _WEAK)
        x, y, yaw = (covariance @ self.pull).tolist()
        motion = Pose2(
            x_m=self.expected.x_m + x,
            y_m=self.expected.y_m + y,
            yaw_rad=self.expected.yaw_rad + yaw,
        )
        into = np.eye(3)
        into[:2, :2] = motion.matrix()[:2, :2].T
        return motion, np.asarray(into @ covariance @ into.T)


class ScanReference:
    """A scan from which the motion to later ones is measured."""

    def __init__(self, scan: Scan, config: LocalisationConfig) -> None:
        """`scan` has at least the points that a match needs."""
        self._config, self._rules = config, config.scan_odometry
        self._match = replace(config.match, fine_m=self._rules.window_m)
        self.surfaces = ScanMap(self._match)
        """Its surfaces, in its own frame."""
        self.surfaces.put(Keyframe(pose_id=0, T_map_base=IDENTITY, scan=scan))

    def motion_to(self, scan: Scan, expected: Pose2, spread: Matrix) -> ScanMotion | None:
        """Return the motion to a later scan; None if that does not fit near where odometry expects
        it, or has too few points to tell. `spread` is the (3, 3) covariance of the motion expected,
        in axes of this scan: where that is more than the match is held to, all places within it are
        tried."""
        rules, least = self._rules, self._config.match.min_points
        if len(scan) < least:
            return None
        prior = np.diag([rules.loose_m, rules.loose_m, rules.loose_rad]) ** 2
        sigma_m = math.sqrt(float(np.linalg.eigvalsh(spread[:2, :2])[-1]))
        if sigma_m <= rules.loose_m and spread[2, 2] <= rules.loose_rad**2:
            found = match(
                scan, self.surfaces, expected, prior, scale=rules.point_weight,
                search_m=rules.window_m, config=self._match,
            )  # fmt: skip
        else:
            prior = spread
            found = match_widely(
                scan, self.surfaces, expected, prior, scale=rules.point_weight,
                config=self._config.match,
            )  # fmt: skip
        if found.fitting < least or found.share_of_near < self._config.tracking.located_share:
            return None
        pull, known = found.alone(expected, np.linalg.inv(prior), rules.point_weight)
        # The floor is added to the covariance of z.
        weakened = np.linalg.inv(np.eye(3) + known @ rules.floor)
        information = weakened @ known
        return ScanMotion(
            expected=expected,
            pull=np.asarray(weakened @ pull, dtype=np.float64),
            information=np.asarray((information + information.T) / 2, dtype=np.float64),
        )
