"""Matches with the saved map that the estimate excludes: when they are right and it is wrong.

Where all that is in view fits the map beside the estimate, a shelf may have been moved, or the
robot is not where it takes itself to be. A shelf is out of view after some metres.
"""

from __future__ import annotations

import math

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import Matrix, Pose2, difference
from navcore.localisation.scans.matching import Match, match_widely
from navcore.localisation.scans.scan import Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tracking.displacement import is_same_pose
from navcore.localisation.tracking.pose_filter import PoseFilter
from navcore.localisation.tracking.pose_matcher import PoseMatcher

_SPACING_M = 0.2
"""Motion in metres after which a scan is another view; a radian counts as half a metre."""
_LEAST_SHARE = 0.5
"""Share of the views since the first that must have told the same place."""
_NOTHING = np.zeros(2)


class RefusedMatches:
    """The place that they agree on, since a match confirmed the estimate last.

    Each is looked for in the window of a displaced robot, with the places beside it: where several
    fit, as along a corridor or a row of equal shelves, the match is as uncertain as they are apart,
    and does not contradict the estimate.
    """

    def __init__(self, config: LocalisationConfig, matcher: PoseMatcher, displaced: Matrix) -> None:
        """`displaced`: (3, 3) covariance of a displacement."""
        self._config, self._matcher, self._displaced = config, matcher, displaced
        self._T_map_odom: Pose2 | None = None
        self._offset, self._count = _NOTHING, 0
        self._since_view_m, self._since_first_m = math.inf, 0.0
        self.told: Match | None = None
        """The newest match, if those of some metres have told the same place."""

    @property
    def is_open(self) -> bool:
        """Whether enough of the views since the first have told the same place."""
        told_m = self._count * _SPACING_M
        return self._T_map_odom is not None and told_m >= _LEAST_SHARE * self._since_first_m

    @property
    def offset(self) -> Matrix:
        """(2,) metres from the estimate to where these matches have the robot; 0 unless several
        agree."""
        return self._offset if self._count > 1 and self.is_open else _NOTHING

    def move(self, moved_m: float) -> None:
        """Note a motion, in which a radian counts as half a metre."""
        self._since_view_m += moved_m
        self._since_first_m += moved_m

    def is_due(self) -> bool:
        """Return whether the newest scan is another view."""
        return self._since_view_m >= _SPACING_M

    def look(self, scan: Scan, saved: ScanMap, own: PoseFilter, T_odom_base: Pose2) -> bool | None:
        """Look for one more scan around the filter's pose; return whether it contradicts that, None
        if it does not, but the robot may be at the place of these as well."""
        is_view, self.told = self.is_due(), None
        self._since_view_m = 0.0 if is_view else self._since_view_m
        result = match_widely(
            scan, saved, own.pose, self._displaced, around=True,
            scale=self._matcher.scale(len(scan), absolute=True), config=self._config.match,
        )  # fmt: skip
        away = difference(result.pose, own.pose)
        spread = own.covariance_by_motion + self._matcher.error(result)
        if result.share < self._config.start.share or not self._matcher.excludes(away, spread):
            is_possible = self.is_open and not self.are_contradicted(away[:2], spread[:2, :2])
            return None if is_possible else False
        T_map_odom = result.pose @ T_odom_base.inverse()
        if (
            not self.is_open
            or self._T_map_odom is None
            or not is_same_pose(self._T_map_odom @ T_odom_base, result.pose)
        ):
            self._T_map_odom, self._count, self._since_first_m = T_map_odom, 0, 0.0
        self._offset, self._count = away[:2], self._count + is_view
        if self._since_first_m >= self._config.tracking.refused_m and self.is_open:
            self.told = result
        return True

    def are_contradicted(self, residual: Matrix, covariance: Matrix) -> bool:
        """Return whether a position that the estimate does not exclude, with its (2,) difference
        from it in metres and (2, 2) covariance, contradicts them."""
        spread = covariance + self._matcher.floor[:2, :2]
        return self.is_open and self._matcher.excludes(residual - self._offset, spread)

    def clear(self) -> None:
        """Forget them: the estimate was set."""
        self._T_map_odom, self._offset, self._count, self.told = None, _NOTHING, 0, None
        self._since_view_m = math.inf
