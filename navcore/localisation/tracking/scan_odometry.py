"""Scan odometry: the motion since a scan of half a metre ago, by matching the newest scan with it.

Wheels measure lengths with an error of scale that is the same for a whole drive, up to some percent
on another floor or with other tyres. Two scans half a metre apart tell the motion between them to a
few millimetres, wherever the map lies, so many of them tell that scale. Over more than that the
parts of surfaces that come into view and leave it pull the match towards no motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, difference
from navcore.localisation.scans.matching import match
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tracking.pose_filter import PoseFilter


class ScanOdometry:
    """Keeps the scan at the reference of a filter, and measures the motion since."""

    def __init__(self, config: LocalisationConfig) -> None:
        self._config, self._rules = config, config.scan_odometry
        self._match = replace(config.match, fine_m=self._rules.window_m)
        self._reference: ScanMap | None = None

    def clear(self) -> None:
        """Forget the scan: the robot was placed elsewhere."""
        self._reference = None

    def follow(self, scan: Scan, own: PoseFilter) -> None:
        """Measure the motion by one more scan if it is far enough, and refer to that scan then."""
        moved, rules = own.motion, self._rules
        if self._reference is not None:
            is_far = np.hypot(moved.x_m, moved.y_m) >= rules.spacing_m
            if not is_far and abs(moved.yaw_rad) < np.radians(rules.spacing_deg):
                return
            self._fuse(scan, own, self._reference)
        self._reference = None
        if len(scan) >= self._config.match.min_points:
            self._reference = ScanMap(self._match)
            self._reference.put(Keyframe(pose_id=0, T_map_base=IDENTITY, scan=scan))
        own.refer()

    def _fuse(self, scan: Scan, own: PoseFilter, reference: ScanMap) -> None:
        rules, least = self._rules, self._config.match.min_points
        if len(scan) < least:
            return
        expected, loose = own.motion, np.diag([rules.loose_m, rules.loose_m, rules.loose_rad]) ** 2
        found = match(
            scan,
            reference,
            expected,
            loose,
            scale=rules.point_weight,
            search_m=rules.window_m,
            config=self._match,
        )
        if found.fitting < least or found.share_of_near < self._config.tracking.located_share:
            return
        # With z the motion by the scan alone: (prior + information) · (found − expected)
        # = information · (z − expected); the floor is then added to the covariance of z.
        known = rules.point_weight * found.information
        pull = (np.linalg.inv(loose) + known) @ difference(found.pose, expected)
        weakened = np.linalg.inv(np.eye(3) + known @ rules.floor)
        information = weakened @ known
        own.fuse_motion(
            np.asarray(weakened @ pull, dtype=np.float64),
            np.asarray((information + information.T) / 2, dtype=np.float64),
            gate=rules.gate_sigmas**2,
        )
