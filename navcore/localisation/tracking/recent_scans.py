"""Scans of the last metres, by odometry: whether the newest one continues them.

They say whether the robot was moved by other means than its wheels, wherever the map is wrong: over
some metres odometry is exact.
"""

from __future__ import annotations

import math

from navcore.config.localisation import LocalisationConfig, TrackingConfig
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.scans.matching import Match, match
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap

_KEPT = 8
"""Number of scans."""
_SPACING_M, _SPACING_RAD = 0.4, math.radians(15.0)
"""Motion between two of them."""


def is_elsewhere(result: Match, rules: TrackingConfig) -> bool:
    """Return whether little of a scan fits and lines of sight cross surfaces: a place that is new
    shows the first alone."""
    return (
        result.share < rules.elsewhere_share
        and result.blocked_share > rules.elsewhere_blocked_share
    )


class RecentScans:
    """The last scans at their poses in odometry's frame."""

    def __init__(self, config: LocalisationConfig) -> None:
        self._config = config
        self._map = ScanMap(config.match)
        self._count = 0
        self._last: Pose2 | None = None

    def are_continued(self, scan: Scan, T_odom_base: Pose2) -> bool | None:
        """Return whether a scan shows the surfaces of the last metres; None where it shows too few
        of them, or too many others, to tell."""
        found = match(scan, self._map, T_odom_base, None, search_m=0.2, config=self._config.match)
        rules = self._config.tracking
        if is_elsewhere(found, rules):
            return False
        if found.near < self._config.match.min_points:
            return None
        if found.share_of_near <= rules.lost_share:
            return False
        return True if found.share >= rules.located_share else None

    def add(self, scan: Scan, T_odom_base: Pose2) -> None:
        """Keep a scan if the robot has moved since the last one."""
        last = self._last
        if (
            last is not None
            and last.distance_to(T_odom_base.x_m, T_odom_base.y_m) < _SPACING_M
            and abs(wrap_angle(last.yaw_rad - T_odom_base.yaw_rad)) < _SPACING_RAD
        ):
            return
        self._map.put(Keyframe(pose_id=self._count, T_map_base=T_odom_base, scan=scan))
        self._map.remove(self._count - _KEPT)
        self._last, self._count = T_odom_base, self._count + 1

    def clear(self) -> None:
        """Forget all scans."""
        self._map.replace(())
        self._last = None
