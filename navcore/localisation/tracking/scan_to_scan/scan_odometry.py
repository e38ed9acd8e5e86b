"""Scan odometry: the motion since a scan of half a metre ago, by matching the newest scan with it.

Wheels measure lengths with an error of scale that is the same for a whole drive, up to some percent
on another floor or with other tyres. Many motions by two scans (`scan_motion`) tell that scale.

They also tell when the robot was pushed, or its wheels have slipped: once that is over. People who
walk together before the camera look the same for a moment, but they walk on.
"""

from __future__ import annotations

import math

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Pose2, difference
from navcore.localisation.scans.scan import Scan
from navcore.localisation.tracking.pose_filter import PoseFilter
from navcore.localisation.tracking.scan_to_scan.push_search import Push, PushSearch
from navcore.localisation.tracking.scan_to_scan.scan_motion import ScanReference

_MOST_SPACINGS = 2.0
"""Number of spacings over which a scan is compared with the reference if it does not fit."""
_MORE_SPACINGS = 1.0
"""Number of spacings more over which it is if a push was found that may not be over."""


class ScanOdometry:
    """Keeps the scan at the reference of a filter, and measures the motion since."""

    def __init__(self, config: LocalisationConfig) -> None:
        self._config, self._rules = config, config.scan_odometry
        self._pushes = PushSearch(config)
        self._reference: ScanReference | None = None
        self._checked_ns = 0
        self._refused_ns: int | None = None
        self._pushed: Pose2 | None = None
        """T_found_expected of the push that the search before has found, in the reference's
        frame."""

    def clear(self) -> None:
        """Forget the scan: the robot was placed elsewhere."""
        self._reference = self._refused_ns = self._pushed = None

    def follow(self, scan: Scan, own: PoseFilter, stamp_ns: int) -> Push | None:
        """Measure the motion by one more scan if it is far enough, and refer to that scan then.

        Returns by what the robot was pushed, if it was; `own` knows it then.
        """
        rules = self._rules
        if self._reference is None:
            self._refer(scan, own)
            return None
        spacings = self._spacings(own)
        is_far = spacings >= 1.0
        # A clock that was set back must not stop the checks until the old time is reached.
        is_due = not 0 <= stamp_ns - self._checked_ns < rules.check_s * 1e9
        if not (is_far or is_due or self._refused_ns is not None):
            return None
        self._checked_ns = stamp_ns
        push = None
        is_measured = self._measured(scan, own, self._reference, fuse=is_far)
        if is_measured:
            self._refused_ns = self._pushed = None
        elif self._refused_ns is None or stamp_ns - self._refused_ns >= rules.refused_s * 1e9:
            self._refused_ns = stamp_ns
            so_far = self._pushed or IDENTITY
            push = self._told(self._pushes.find(scan, self._reference.surfaces, own, so_far), own)
        if push is not None:
            own.push(*push)
        # A push takes a while: until all of it is told, no part of it becomes the reference.
        is_over = is_measured and is_far
        most = _MOST_SPACINGS + (_MORE_SPACINGS if self._pushed else 0.0)
        if is_over or push is not None or spacings >= most:
            self._refer(scan, own)
        return push

    def _told(self, push: Push | None, own: PoseFilter) -> Push | None:
        """Return the push that a search has found if it is over: the search before has found the
        same one. Where the reference is about to get out of view, it is told as far as it goes."""
        before, self._pushed = self._pushed, None
        if push is None:
            return None
        found = own.motion @ push.motion
        self._pushed = found @ own.motion.inverse()
        if before is None:
            return None
        apart, rules = difference(found, before @ own.motion), self._rules
        is_over = math.hypot(apart[0], apart[1]) <= rules.over_m
        is_over &= abs(apart[2]) <= math.radians(rules.over_deg)
        is_last = self._spacings(own) >= _MOST_SPACINGS
        return push if is_over or is_last else None

    def _spacings(self, own: PoseFilter) -> float:
        """Return how far the robot has come from the reference, in spacings."""
        moved, rules = own.motion, self._rules
        return max(
            math.hypot(moved.x_m, moved.y_m) / rules.spacing_m,
            abs(moved.yaw_rad) / math.radians(rules.spacing_deg),
        )

    def _refer(self, scan: Scan, own: PoseFilter) -> None:
        """Refer to the newest scan."""
        self.clear()
        if len(scan) >= self._config.match.min_points:
            self._reference = ScanReference(scan, self._config)
        own.refer()

    def _measured(
        self, scan: Scan, own: PoseFilter, reference: ScanReference, *, fuse: bool
    ) -> bool:
        """Return whether a scan fits near where odometry expects it; `fuse` the motion."""
        found = reference.motion_to(scan, own.motion, own.motion_covariance)
        return found is not None and own.fuse_motion(
            found.pull,
            found.information,
            gate=self._rules.gate_sigmas**2,
            only_judge=not fuse,
        )
