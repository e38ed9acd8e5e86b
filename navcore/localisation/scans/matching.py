"""Matching of a scan with the surfaces of a scan map.

`match` finds the most probable pose given where odometry expects it and how sure that is
(Gauss–Newton with a robust kernel): points on lines are matched across the line, points on legs,
posts and corners in both directions, and only with surfaces that face the camera. `search` tries
all poses of a window first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from navcore.compiled import compiled
from navcore.config.localisation.localisation import MatchConfig, MatchRules
from navcore.geometry.arrays import Bools, Floats
from navcore.geometry.transform import Matrix, Pose2, difference, wrap_angle
from navcore.localisation.scans.ambiguity import poses_beside, spread_to
from navcore.localisation.scans.scan import Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.scans.surface_grid import (
    FACING_X,
    FACING_Y,
    HITS,
    SECTORS,
    TILE,
    WEIGHT,
    SurfaceGrid,
    X,
    Y,
    blocked_share,
    forms_line,
    nearest_surface,
    tile_at,
)

_DEFAULT = MatchConfig()
_KERNEL_SIGMAS = 4.0
"""Residual in standard deviations at which the weight of a point is halved."""
_LOOSE_SHARE = 0.5
"""Width of the kernel as a share of the search radius, while that shrinks."""
_SHRINK = 0.6
"""Ratio of the search radius from one step to the next."""
_FREE_M = 0.3
"""Distance in metres by which a line of sight must pass a surface to contradict it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Match:
    """Result of matching one scan."""

    pose: Pose2
    """Most probable T_map_base."""
    information: Matrix
    """(3, 3) information about x, y in metres and yaw in radians from the scan alone, in map axes:
    every point counts as independent. Its smallest eigenvector is the way along a corridor."""
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
    pose, information, counts, (residual, cost) = _gauss_newton(
        grid, scan.points_base, scan.normals, scan.variance_m2, scan.origin, poses, prior, scale,
        rules, radius_m,
    )  # fmt: skip
    return Match(
        pose=Pose2(x_m=pose[0], y_m=pose[1], yaw_rad=wrap_angle(pose[2])),
        information=information,
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
    config: MatchConfig = _DEFAULT,
) -> Match:
    """Return the most probable pose as `match` does, where so little is known that several may fit:
    within three standard deviations, and beside the best. The information is less the farther those
    are apart that are nearly as probable."""
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
    beside = poses_beside(first.pose, _covariance(first, scale))
    found = [first, *map(fit, (expected, *beside))]
    best = min(found, key=cost)
    alike = [one.pose for one in found if cost(one) < cost(best) + _AS_PROBABLE]
    spread = _covariance(best, scale) + spread_to(best.pose, alike)
    return replace(best, information=np.asarray(np.linalg.inv(spread)) / scale)


_AS_PROBABLE = 4.5
"""Difference of the logarithms of the probabilities of two poses up to which both are possible:
that of three standard deviations."""


def _covariance(found: Match, scale: float) -> Matrix:
    """Return the (3, 3) covariance of a match without any expectation."""
    return np.asarray(np.linalg.inv(scale * found.information + 1e-6 * np.eye(3)))


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
    window_m = min(window[0], config.window_m)
    window_rad = min(window[1], math.radians(config.window_deg))
    reach_m = float(np.max(np.linalg.norm(scan.points_base, axis=1), initial=0.0))
    if not len(scan):
        return match(scan, scan_map, expected, None, config=config)
    half_m = reach_m + window_m + 2 * _COARSE_M
    cells = math.ceil(2 * half_m / _COARSE_M)
    x0, y0 = expected.x_m - half_m, expected.y_m - half_m
    image = _occupied(scan_map.grid, x0, y0, cells, _COARSE_M)
    step_rad = _COARSE_M / max(reach_m, 1.0)
    turns = math.ceil(window_rad / step_rad)
    best = _correlate(
        image,
        np.array(scan.points_base[:: max(len(scan) // _COARSE_POINTS, 1)]),
        (expected.x_m - x0, expected.y_m - y0, expected.yaw_rad),
        (math.ceil(window_m / _COARSE_M), turns),
        step_rad,
    )
    start = Pose2(x_m=x0 + best[0], y_m=y0 + best[1], yaw_rad=wrap_angle(best[2]))
    return match(scan, scan_map, start, None, search_m=3 * _COARSE_M, config=config)


_COARSE_M = 0.1
"""Step of the correlative search in metres."""
_COARSE_POINTS = 100
"""Number of points that it takes of a scan."""


@compiled
def _gauss_newton(
    grid: SurfaceGrid,
    points: Floats,
    normals: Floats,
    variance: Floats,
    origin: Floats,
    poses: tuple[tuple[float, float, float], tuple[float, float, float]],
    prior: Floats,
    scale: float,
    rules: MatchRules,
    radius: float,
) -> tuple[tuple[float, float, float], Floats, tuple[int, int], tuple[float, float]]:
    """Return the pose, the information of the points, (near, fitting) and (residual, cost); `poses`
    are that of the start and the expected one."""
    (x, y, yaw), expected = poses
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    fitting, squares, cost = 0, 0.0, 0.0
    # A point without a surface in the widest radius has none in the later ones.
    alone = np.zeros(len(points), dtype=np.bool_)
    near = len(points)
    for iteration in range(rules.iterations + 1):
        fine = radius <= rules.fine_m
        # Wide at first, or the points that happen to lie on any surface would hold the rest back.
        loose = 0.0 if fine else (_LOOSE_SHARE * radius) ** 2
        cos, sin = math.cos(yaw), math.sin(yaw)
        hessian[:] = 0.0
        gradient[:] = 0.0
        fitting, squares, cost = 0, 0.0, 0.0
        for k in range(0, len(points), 1 if fine or iteration == 0 else 2):
            if alone[k]:
                cost += _cost(rules.fine_m**2, variance[k] + rules.point_sigma_m**2)
                continue
            rx = cos * points[k, 0] - sin * points[k, 1]
            ry = sin * points[k, 0] + cos * points[k, 1]
            vx = cos * (origin[0] - points[k, 0]) - sin * (origin[1] - points[k, 1])
            vy = sin * (origin[0] - points[k, 0]) + cos * (origin[1] - points[k, 1])
            distance = max(math.hypot(vx, vy), 1e-6)
            vx, vy = vx / distance, vy / distance
            nx = cos * normals[k, 0] - sin * normals[k, 1]
            ny = sin * normals[k, 0] + cos * normals[k, 1]
            surface = nearest_surface(
                grid,
                x + rx,
                y + ry,
                (vx, vy),
                (nx, ny),
                max(radius, rules.search_m) if iteration == 0 else radius,
                rules.min_hits,
            )
            if surface < 0:
                if iteration == 0:
                    alone[k] = True
                    near -= 1
                cost += _cost(rules.fine_m**2, variance[k] + rules.point_sigma_m**2)
                continue
            sums = grid.sums[surface]
            ex = x + rx - sums[X] / sums[WEIGHT]
            ey = y + ry - sums[Y] / sums[WEIGHT]
            if ex * ex + ey * ey > radius * radius:
                cost += _cost(rules.fine_m**2, variance[k] + rules.point_sigma_m**2)
                continue
            is_line = forms_line(sums)
            if is_line:
                length = max(math.hypot(sums[FACING_X], sums[FACING_Y]), 1e-12)
                nx, ny = sums[FACING_X] / length, sums[FACING_Y] / length
                along = vx * nx + vy * ny
                sigma2 = variance[k] * along * along + rules.surface_sigma_m**2 + 1.0 / sums[WEIGHT]
                error = nx * ex + ny * ey
                weight = _robust(error * error, sigma2, loose) / sigma2
                lever = ny * rx - nx * ry
                _accumulate(hessian, gradient, nx, ny, lever, error, weight)
            else:
                sigma2 = variance[k] + rules.point_sigma_m**2 + 1.0 / sums[WEIGHT]
                error = math.hypot(ex, ey)
                weight = _robust(error * error, sigma2, loose) / sigma2
                _accumulate(hessian, gradient, 1.0, 0.0, -ry, ex, weight)
                _accumulate(hessian, gradient, 0.0, 1.0, rx, ey, weight)
            cost += _cost(error * error, sigma2)
            if abs(error) < rules.fit_m + 3.0 * math.sqrt(variance[k]):
                fitting += 1
                squares += error * error
        if iteration == rules.iterations:
            break
        system = scale * hessian + prior
        turn = (expected[2] - yaw + math.pi) % (2 * math.pi) - math.pi
        right = prior @ np.array([expected[0] - x, expected[1] - y, turn]) - scale * gradient
        # A direction that nothing measures stays as it is.
        for i in range(3):
            system[i, i] += 1e-6
        step = np.linalg.solve(system, right)
        longest = max(abs(step[0]), abs(step[1]), abs(step[2]))
        if longest > 0.5:
            step *= 0.5 / longest
        x, y, yaw = x + step[0], y + step[1], yaw + step[2]
        if fine and longest < 1e-4:
            break
        radius = max(rules.fine_m, radius * _SHRINK)
    residual = math.sqrt(squares / fitting) if fitting > 0 else 0.0
    return (x, y, yaw), hessian, (near, fitting), (residual, cost)


@compiled
def _cost(square: float, sigma2: float) -> float:
    """Return the negative logarithm of the likelihood of a residual by its square and variance, for
    which `_robust` is the weight."""
    width = _KERNEL_SIGMAS * _KERNEL_SIGMAS
    return 0.5 * width * math.log1p(square / (width * sigma2))


@compiled
def _robust(square: float, sigma2: float, loose: float) -> float:
    """Return the weight of a residual by its square and variance (Cauchy); `loose` is added to the
    square of the kernel's width."""
    return 1.0 / (1.0 + square / (_KERNEL_SIGMAS * _KERNEL_SIGMAS * sigma2 + loose))


@compiled
def _accumulate(
    hessian: Floats, gradient: Floats, jx: float, jy: float, jt: float, error: float, weight: float
) -> None:
    """Add one residual with its derivatives by x, y and yaw."""
    hessian[0, 0] += weight * jx * jx
    hessian[0, 1] += weight * jx * jy
    hessian[0, 2] += weight * jx * jt
    hessian[1, 1] += weight * jy * jy
    hessian[1, 2] += weight * jy * jt
    hessian[2, 2] += weight * jt * jt
    hessian[1, 0], hessian[2, 0], hessian[2, 1] = hessian[0, 1], hessian[0, 2], hessian[1, 2]
    gradient[0] += weight * jx * error
    gradient[1] += weight * jy * error
    gradient[2] += weight * jt * error


@compiled
def _occupied(grid: SurfaceGrid, x0: float, y0: float, cells: int, step_m: float) -> Bools:
    """Return (cells, cells) whether a surface lies in a cell or beside it."""
    image = np.zeros((cells, cells), dtype=np.bool_)
    row0, col0 = math.floor(y0 / grid.cell_m), math.floor(x0 / grid.cell_m)
    count = math.ceil(cells * step_m / grid.cell_m) + 1
    for row in range(row0, row0 + count):
        for col in range(col0, col0 + count):
            tile = tile_at(grid, row, col)
            if tile < 0:
                continue
            for sector in range(SECTORS):
                surface = grid.heads[tile, row % TILE, col % TILE, sector]
                if surface < 0 or grid.sums[surface, HITS] < 1:
                    continue
                sums = grid.sums[surface]
                i = int((sums[Y] / sums[WEIGHT] - y0) / step_m)
                j = int((sums[X] / sums[WEIGHT] - x0) / step_m)
                for di in range(max(i - 1, 0), min(i + 2, cells)):
                    for dj in range(max(j - 1, 0), min(j + 2, cells)):
                        image[di, dj] = True
    return image


@compiled
def _correlate(
    image: Bools,
    points: Floats,
    centre: tuple[float, float, float],
    window: tuple[int, int],
    step_rad: float,
) -> tuple[float, float, float]:
    """Return the pose in metres of the image with the most points on surfaces; of equal ones the
    nearest to the centre."""
    steps, turns = window
    count = len(points)
    rows, cols = np.empty(count), np.empty(count)
    best_score, best_cost = -1, 0
    best = centre
    for turn in range(-turns, turns + 1):
        yaw = centre[2] + turn * step_rad
        cos, sin = math.cos(yaw), math.sin(yaw)
        for k in range(count):
            cols[k] = (centre[0] + cos * points[k, 0] - sin * points[k, 1]) / _COARSE_M
            rows[k] = (centre[1] + sin * points[k, 0] + cos * points[k, 1]) / _COARSE_M
        for dr in range(-steps, steps + 1):
            for dc in range(-steps, steps + 1):
                score = 0
                for k in range(count):
                    i, j = int(rows[k]) + dr, int(cols[k]) + dc
                    if 0 <= i < image.shape[0] and 0 <= j < image.shape[1] and image[i, j]:
                        score += 1
                cost = dr * dr + dc * dc + turn * turn
                if score > best_score or (score == best_score and cost < best_cost):
                    best_score, best_cost = score, cost
                    best = (centre[0] + dc * _COARSE_M, centre[1] + dr * _COARSE_M, yaw)
    return best
