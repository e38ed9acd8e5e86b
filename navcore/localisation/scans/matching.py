"""Matching of a scan with the surfaces of a scan map.

`match` finds the most probable pose given where odometry expects it and how sure that is; `search`
tries all poses of a window first, and `match_widely` does where several may fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from navcore.config.localisation.localisation import MatchConfig
from navcore.geometry.transform import Matrix, Pose2, difference, wrap_angle
from navcore.localisation.scans.ambiguity import poses_beside, spread_to
from navcore.localisation.scans.correlative_search import STEP_M, coarse_pose
from navcore.localisation.scans.gauss_newton import AS_PROBABLE, most_probable_pose
from navcore.localisation.scans.scan import Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.scans.surface_grid import blocked_share

_DEFAULT = MatchConfig()
_FREE_M = 0.3
"""Distance in metres by which a line of sight must pass a surface to contradict it."""
_LEAST = 1e-6 * np.eye(3)
"""Information that is as good as none, so that any can be inverted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Match:
    """Result of matching one scan."""

    pose: Pose2
    """Most probable T_map_base."""
    information: Matrix
    """(3, 3) information about x, y in metres and yaw in radians from the scan alone, in map axes:
    every point counts as independent. There is none along a corridor."""
    found_with: Matrix
    """(3, 3) information that the pose was found with: more than `information` where several poses
    are nearly as probable."""
    points: int
    """Number of points of the scan."""
    near: int
    """Number of points with a surface of the map in the search radius."""
    fitting: int
    """Number of points that fit a surface."""
    residual_m: float
    """Root mean square distance of the fitting points from their surfaces, metres."""
    cost: float
    """Negative logarithm of the likelihood of the points at this pose, up to a constant: every
    point counts as independent, and one without a surface as one at the last search radius."""

    @property
    def share(self) -> float:
        """Share of the scan's points that fit, 0 to 1."""
        return self.fitting / max(self.points, 1)

    @property
    def share_of_near(self) -> float:
        """Share that fits of the points near surfaces of the map: in a map that is still being made
        the others are new."""
        return self.fitting / max(self.near, 1)

    def alone(self, expected: Pose2, prior: Matrix, scale: float) -> tuple[Matrix, Matrix]:
        """Return what the scan alone tells, where each point counts as `scale` measurements: (3,)
        its information times the difference of its pose from the one expected, whose (3, 3)
        information the match was given as `prior`, and the (3, 3) information."""
        # With z the pose by the scan alone: (prior + found_with) · (pose − expected)
        # = found_with · (z − expected).
        found_with, information = scale * self.found_with, scale * self.information
        pull = (prior + found_with) @ difference(self.pose, expected)
        return information @ np.linalg.solve(found_with + _LEAST, pull), information


def match(
    scan: Scan,
    scan_map: ScanMap,
    expected: Pose2,
    covariance: Matrix | None,
    *,
    start: Pose2 | None = None,
    scale: float = 1.0,
    search_m: float | None = None,
    config: MatchConfig = _DEFAULT,
) -> Match:
    """Return the most probable pose of a scan.

    `covariance` is the (3, 3) of `expected` in map axes, None without any expectation. `start` is
    where the search begins, by default at `expected`. `scale` is
    the number of measurements that a point counts as against that expectation. `search_m` is the
    first search radius, by default the configured one.
    """
    prior: Matrix = np.zeros((3, 3))
    if covariance is not None:
        prior = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    begin = start or expected
    poses = (
        (begin.x_m, begin.y_m, begin.yaw_rad),
        (expected.x_m, expected.y_m, expected.yaw_rad),
    )
    grid, rules = scan_map.grid, config.rules
    radius_m = rules.search_m if search_m is None else max(search_m, rules.fine_m)
    pose, information, found_with, counts, (residual, cost) = most_probable_pose(
        grid, scan.points_base, scan.normals, scan.variance_m2, scan.origin, poses, prior, scale,
        rules, radius_m,
    )  # fmt: skip
    return Match(
        pose=Pose2(x_m=pose[0], y_m=pose[1], yaw_rad=wrap_angle(pose[2])),
        information=information,
        found_with=found_with,
        points=len(scan),
        near=counts[0],
        fitting=counts[1],
        residual_m=residual,
        cost=cost,
    )


def match_widely(
    scan: Scan,
    scan_map: ScanMap,
    expected: Pose2,
    covariance: Matrix,
    *,
    scale: float = 1.0,
    around: bool = False,
    config: MatchConfig = _DEFAULT,
) -> Match:
    """Return the most probable pose as `match` does, where so little is known that several may fit:
    within three standard deviations, and beside the best. The information is less the farther those
    are apart that are nearly as probable. `around`: the match is begun beside the expected pose,
    too, so that on its other side no place is missed that fits as well."""
    sigma_m = math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
    window = (3.0 * sigma_m, 3.0 * math.sqrt(covariance[2, 2]))
    prior = np.linalg.inv(covariance)

    def fit(start: Pose2) -> Match:
        return match(
            scan, scan_map, expected, covariance, start=start, scale=scale,
            search_m=2.0 * config.fine_m, config=config,
        )  # fmt: skip

    def cost(one: Match) -> float:
        away = difference(one.pose, expected)
        return float(scale * one.cost + 0.5 * away @ prior @ away)

    first = fit(search(scan, scan_map, expected, window=window, config=config).pose)
    axes = _covariance(first, scale)
    beside = poses_beside(first.pose, axes) + (poses_beside(expected, axes) if around else [])
    found = [first, *map(fit, (expected, *beside))]
    best = min(found, key=cost)
    alike = [one.pose for one in found if cost(one) < cost(best) + AS_PROBABLE]
    spread = _covariance(best, scale) + spread_to(best.pose, alike)
    return replace(best, information=np.asarray(np.linalg.inv(spread)) / scale)


def _covariance(found: Match, scale: float) -> Matrix:
    """Return the (3, 3) covariance of a match without any expectation."""
    return np.asarray(np.linalg.inv(scale * found.information + _LEAST))


def lines_blocked_share(
    scan: Scan, scan_map: ScanMap, T_map_base: Pose2, *, config: MatchConfig = _DEFAULT
) -> float:
    """Return the share of a scan's lines of sight that pass through a surface of the map, 0 to
    1."""
    pose = (T_map_base.x_m, T_map_base.y_m, T_map_base.yaw_rad)
    min_hits = max(config.min_hits, 2)
    return blocked_share(scan_map.grid, pose, scan.points_base, scan.origin, _FREE_M, min_hits)


def search(
    scan: Scan,
    scan_map: ScanMap,
    expected: Pose2,
    *,
    window: tuple[float, float] = (math.inf, math.inf),
    config: MatchConfig = _DEFAULT,
) -> Match:
    """Return the best match within a window of poses around an expected one, whatever odometry
    says: for a pose that the operator gave, or after a fault.

    `window`: half its edge in metres and half its range of headings in radians, at most those that
    are configured.
    """
    if not len(scan):
        return match(scan, scan_map, expected, None, config=config)
    within = (min(window[0], config.window_m), min(window[1], math.radians(config.window_deg)))
    start = coarse_pose(scan_map.grid, scan.points_base, expected, within)
    return match(scan, scan_map, start, None, search_m=3 * STEP_M, config=config)
