"""Scans of the last metres, by odometry: whether the newest one continues them.

They say whether the robot was moved by other means than its wheels, wherever the map is wrong: over
some metres odometry is exact.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Pose2, wrap_angle
from navcore.localisation.scans.matching import Match, lines_blocked_share, match
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.scans.view import is_in_view
from navcore.localisation.tracking.odometry_model import OdometryStep

_KEPT = 8
"""Number of scans beside the newest."""
_NEWEST = -1
"""Number of the newest scan while it is not one of these."""
_SPACING_M, _SPACING_RAD = 0.4, math.radians(15.0)
"""Motion between two of them."""
_DRIFT = np.diag([0.05, 0.05, math.radians(1.5)]) ** 2
"""Covariance of odometry over the way that they cover."""
_MOST_HELD = 32_768
"""Number of surfaces from which the memory of those is freed that the robot has left behind."""
_WINDOW_M = 0.15
"""Distance in metres within which the surface of a point is looked for."""


def is_elsewhere(result: Match, scan: Scan, scan_map: ScanMap, config: LocalisationConfig) -> bool:
    """Return whether little of a scan fits a map and lines of sight cross surfaces: a place that is
    new shows the first alone.

    Where nearly all of a good part of it that is near surfaces fits them, lines that cross some are
    the scatter of far ones, and the rest of the scan is new.
    """
    rules = config.tracking
    is_mapped = result.near >= rules.fitting_near * result.points
    fits = is_mapped and result.share_of_near >= rules.fitting_share
    if result.share >= rules.elsewhere_share or fits:
        return False
    blocked = lines_blocked_share(scan, scan_map, result.pose, config=config.match)
    return blocked > rules.elsewhere_blocked_share


class RecentScans:
    """The last scans at their poses in odometry's frame, and pushes that are known."""

    def __init__(self, config: LocalisationConfig) -> None:
        self._config = config
        # Odometry is that good over this way that one step towards the surfaces tells.
        self._rules = replace(config.match, iterations=1)
        self._map = ScanMap(config.match)
        self._count = 0
        self._kept: Pose2 | None = None
        self._newest: tuple[Scan, Pose2] | None = None
        self._T_here_odom = IDENTITY

    def push(self, motion: Pose2, T_odom_base: Pose2) -> None:
        """Expect the robot where it was pushed to from a pose: `motion` is T_before_after."""
        before = self._T_here_odom @ T_odom_base
        self._T_here_odom = before @ motion @ T_odom_base.inverse()

    def are_continued(self, scan: Scan, T_odom_base: Pose2, step: OdometryStep) -> bool | None:
        """Return whether a scan shows the surfaces of the last metres where odometry expects them;
        None where too few were in view to tell, or the robot has moved too far in one step.

        It does not continue them if neither what it shows was seen before, which people cause as
        well, nor what was seen before is shown. Between two frames no person hides nearly all.
        """
        rules = self._config.tracking
        moves_far = step.distance_m > rules.step_m or abs(step.turn_rad) > rules.step_rad
        if self._newest is None or moves_far or len(scan) < rules.judged_points:
            return None
        here = self._T_here_odom @ T_odom_base
        share = self._share(scan, self._map, here)
        if share >= rules.discontinuous_share:
            return True
        newest, pose = self._newest
        before = newest.seen_from(here.inverse() @ pose)
        if share < rules.replaced_share:
            in_front = is_in_view(before, scan, self._config.scan, hidden=True)
            return False if in_front.sum() >= rules.judged_points else None
        expected = before.part(is_in_view(before, scan, self._config.scan))
        if len(expected) < rules.judged_points:
            return None
        now = ScanMap(self._config.match)
        now.put(Keyframe(pose_id=0, T_map_base=IDENTITY, scan=scan))
        return None if self._share(expected, now, IDENTITY) >= rules.discontinuous_share else False

    def _share(self, scan: Scan, surfaces: ScanMap, expected: Pose2) -> float:
        """Return the share of a scan's points that fit at about an expected pose, 0 to 1."""
        return match(
            scan,
            surfaces,
            expected,
            _DRIFT,
            scale=self._config.tracking.young_points / len(scan),
            search_m=_WINDOW_M,
            config=self._rules,
        ).share

    def add(self, scan: Scan, T_odom_base: Pose2) -> None:
        """Keep a scan until the next one comes, and longer if the robot has moved since the last
        that was kept so."""
        self._map.remove(_NEWEST)
        here = self._T_here_odom @ T_odom_base
        self._newest, last, pose_id = (scan, here), self._kept, _NEWEST
        if (
            last is None
            or last.distance_to(here.x_m, here.y_m) >= _SPACING_M
            or abs(wrap_angle(last.yaw_rad - here.yaw_rad)) >= _SPACING_RAD
        ):
            pose_id, self._kept, self._count = self._count, here, self._count + 1
            self._map.remove(pose_id - _KEPT)
            if self._map.held > _MOST_HELD:
                self._map.replace(self._map.keyframes)
        self._map.put(Keyframe(pose_id=pose_id, T_map_base=here, scan=scan))

    def clear(self) -> None:
        """Forget all scans."""
        self._map.replace(())
        self._kept = self._newest = None
        self._T_here_odom = IDENTITY
