"""Search for a robot that was pushed in a new map, or whose wheels have slipped: where odometry
expects it a scan does not fit the one of a moment ago, and it does beside that."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Matrix, Pose2, difference
from navcore.localisation.graph.edges import in_own_axes
from navcore.localisation.scans.ambiguity import poses_beside, spread_to
from navcore.localisation.scans.gauss_newton import AS_PROBABLE
from navcore.localisation.scans.matching import Match, match, search
from navcore.localisation.scans.scan import Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.scans.view import is_in_view
from navcore.localisation.tracking.pose_filter import PoseFilter

_PUSHED = np.diag([0.3, 0.3, math.radians(8.0)]) ** 2
"""Covariance of the motion of a robot that is pushed."""
_WINDOW = (0.6, math.radians(12.0))
"""Half the edge in metres and half the range of headings of the window that is searched for it; a
motion beyond it is none."""
_TOLD_M = 0.15
"""Standard deviation in metres up to which a push is told."""
_LEAST_SIZE_M = 2.0
"""Size in metres of what must be in view: two people who walk beside each other are less, and a
larger group walks on while the push has to be over (`ScanOdometry`)."""


class Push(NamedTuple):
    """A motion that odometry has not told."""

    motion: Pose2
    """T_before_after."""
    covariance: Matrix
    """(3, 3) covariance in the frame after it."""


class PushSearch:
    """Tells a push by the ratio of the likelihoods of a scan with and without it."""

    def __init__(self, config: LocalisationConfig) -> None:
        self._least_points, self._rules = config.tracking.judged_points, config.scan_odometry
        self._match, self._scan = config.match, config.scan

    def find(
        self, scan: Scan, reference: ScanMap, own: PoseFilter, so_far: Pose2 = IDENTITY
    ) -> Push | None:
        """Return the motion from where odometry has the robot to where a scan has it, which is
        relative to the `reference`, that of the filter; None if odometry is right as probably.

        `so_far`: T_found_expected of a push that was found a moment ago, around which it is looked
        for; the robot may be pushed on.
        Only what the camera had in view at the reference tells: along a wall that the robot has
        seen more of since, other motions would explain more of the scan. Where several motions are
        as probable, it is the least, as uncertain as those are apart; where they are far apart, as
        along a corridor, none in that direction.
        """
        rules, expected, view = self._rules, own.motion, reference.keyframes[0].scan
        around = so_far @ expected
        whole, scan = scan, self._part_in_view(scan, around, view)
        points = len(scan)
        if (
            points < self._least_points
            or np.hypot(*np.ptp(scan.points_base, axis=0)) < _LEAST_SIZE_M
        ):
            return None
        known = own.motion_covariance + rules.floor
        here = match(
            scan, reference, expected, known, scale=rules.point_weight, search_m=self._match.fine_m,
            config=self._match,
        )  # fmt: skip
        away = difference(here.pose, expected)
        against = here.cost + 0.5 * float(away @ np.linalg.solve(known, away)) / rules.point_weight
        most = against - rules.pushed_evidence * points
        is_known = so_far != IDENTITY  # by a search where more of the surfaces was near
        if (2 * here.near < points and not is_known) or most < 0.0:
            return None

        def tells(one: Match) -> bool:
            moved = difference(one.pose, around)
            is_near = math.hypot(moved[0], moved[1]) <= _WINDOW[0] and abs(moved[2]) <= _WINDOW[1]
            return is_near and one.share >= rules.pushed_share and one.cost <= most

        coarse = search(scan, reference, around, window=_WINDOW, config=self._match).pose
        found = [
            self._fit(scan, reference, around, coarse),
            self._fit(scan, reference, around, around, self._match.search_m),
        ]
        best = min(found, key=_cost)
        if not tells(best):
            return None
        beside = poses_beside(best.pose, self._covariance(best))
        found += (self._fit(scan, reference, around, start) for start in beside)
        possible = min(map(_cost, found)) + AS_PROBABLE / rules.point_weight
        alike = [one for one in found if one.cost < possible]
        best = min(alike, key=lambda one: one.pose.distance_to(expected.x_m, expected.y_m))
        if not tells(best) or not self._is_seen_from(whole, reference, best.pose):
            return None
        spread = self._covariance(best) + spread_to(best.pose, [one.pose for one in alike])
        there, spread = _as_told(best.pose, expected, spread + rules.floor)
        return Push(expected.inverse() @ there, in_own_axes(there, spread))

    def _part_in_view(self, scan: Scan, motion: Pose2, view: Scan) -> Scan:
        """Return what of a scan after a motion the camera of another one has had in view."""
        return scan.part(is_in_view(scan.seen_from(motion), view, self._scan, hidden=True))

    def _is_seen_from(self, scan: Scan, reference: ScanMap, motion: Pose2) -> bool:
        """Return whether a scan fits after a motion with all that the reference would have had in
        view then: far surfaces may come and go at the end of the camera's range, and what is left
        fits elsewhere by chance."""
        part = self._part_in_view(scan, motion, reference.keyframes[0].scan)
        if len(part) < self._least_points:
            return False
        fit = match(
            part,
            reference,
            motion,
            self._rules.floor,
            scale=self._rules.point_weight,
            search_m=self._match.fine_m,
            config=self._match,
        )
        return fit.share >= self._rules.pushed_share

    def _fit(
        self,
        scan: Scan,
        reference: ScanMap,
        around: Pose2,
        start: Pose2,
        search_m: float | None = None,
    ) -> Match:
        """Return the most probable motion of a robot that was pushed to around a place, from a
        start on."""
        return match(
            scan,
            reference,
            around,
            _PUSHED,
            start=start,
            scale=self._rules.point_weight,
            search_m=search_m or self._match.fine_m,
            config=self._match,
        )

    def _covariance(self, found: Match) -> Matrix:
        """Return the (3, 3) covariance of such a motion, along the axes of the reference."""
        information = self._rules.point_weight * found.information
        return np.asarray(np.linalg.inv(information + np.linalg.inv(_PUSHED)))


def _as_told(found: Pose2, expected: Pose2, spread: Matrix) -> tuple[Pose2, Matrix]:
    """Return a place with its (3, 3) covariance that is where it was expected in a direction in
    which the push is not told, as along a corridor, and uncertain there by all of it."""
    variances, axes = np.linalg.eigh(spread[:2, :2])
    moved = axes.T @ np.array([found.x_m - expected.x_m, found.y_m - expected.y_m])
    untold = axes @ np.where(variances > _TOLD_M**2, moved, 0.0)
    grown = spread.copy()
    grown[:2, :2] += np.outer(untold, untold)
    x, y = found.x_m - float(untold[0]), found.y_m - float(untold[1])
    return replace(found, x_m=x, y_m=y), grown


def _cost(one: Match) -> float:
    return one.cost
