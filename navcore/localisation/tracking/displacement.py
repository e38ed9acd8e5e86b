"""Search beside the estimate: where the robot is if it was pushed, if its wheels have slipped, or
if the saved map is bent where it has come to."""

from __future__ import annotations

import math

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.scans.matching import Match, search
from navcore.localisation.scans.scan import Scan
from navcore.localisation.scans.scan_map import ScanMap

_SAME_M, _SAME_RAD = 0.1, math.radians(2.0)
"""Difference of two places in odometry's frame up to which they are the same."""


class DisplacementSearch:
    """Believes a place beside the estimate as one at which the robot is switched on: when scans
    have fitted there for a while."""

    def __init__(self, config: LocalisationConfig) -> None:
        self._config = config
        self._T_map_odom: Pose2 | None = None
        self._fits_s = 0.0

    def find(
        self, scan: Scan, saved: ScanMap, expected: Pose2, T_odom_base: Pose2, seen_s: float
    ) -> Match | None:
        """Return the match of one more scan, which does not fit at the expected T_map_base, if the
        scans of a while fit the saved map at the same place beside it; else None. `seen_s`: time in
        seconds that the scan may tell of."""
        rules = self._config.start
        result = search(scan, saved, expected, config=self._config.match)
        if result.share < rules.share or result.fitting < self._config.match.min_points:
            self.clear()
            return None
        T_map_odom = result.pose @ T_odom_base.inverse()
        if self._T_map_odom is None or not is_same_pose(
            self._T_map_odom @ T_odom_base, T_map_odom @ T_odom_base
        ):
            self._T_map_odom, self._fits_s = T_map_odom, 0.0
        else:
            self._fits_s += seen_s
        return result if self._fits_s >= rules.fitting_s else None

    def clear(self) -> None:
        """Forget the place: the scans fit where the robot was expected."""
        self._T_map_odom = None


def is_same_pose(one: Pose2, two: Pose2) -> bool:
    """Return whether two poses in the map are the same place."""
    turn = abs(wrap_angle(one.yaw_rad - two.yaw_rad))
    return one.distance_to(two.x_m, two.y_m) <= _SAME_M and turn <= _SAME_RAD
