"""The most probable pose of a scan by Gauss–Newton with a robust kernel.

Points on lines are matched across the line, points on legs, posts and corners in both directions,
and only with surfaces that face the camera.

Along a bare corridor the far points, which show no line, are matched in both directions with
whatever surfaces are nearest, wherever the pose is, and the derivatives take that for a measurement
of the way along it. So where lines do not tell the position, the scan is tried beside the pose, and
where it fits as well on a side of the best of these, nothing is known of that direction.
"""

from __future__ import annotations

import math

import numpy as np

from navcore.compiled import compiled, nested
from navcore.config.localisation.localisation import MatchRules
from navcore.geometry.arrays import Bools, Floats
from navcore.localisation.scans.surface_grid import (
    FACING_X,
    FACING_Y,
    WEIGHT,
    SurfaceGrid,
    X,
    Y,
    forms_line,
    nearest_surface,
)

_KERNEL_SIGMAS = 4.0
"""Residual in standard deviations at which the weight of a point is halved."""
_LOOSE_SHARE = 0.5
"""Width of the kernel as a share of the search radius, while that shrinks."""
_SHRINK = 0.6
"""Ratio of the search radius from one step to the next."""
_STEP_M = 0.1
"""Distance in metres between the poses beside the found one at which the scan is tried."""
_STEPS = (0, -1, 1, -2, 2)
"""Numbers of steps at which it is tried first."""
_BESIDE = 2
"""Number of steps from the best of them at which it must fit worse for the position to be told: two
cells and a half of the map, so that neighbouring cells of a wall are no different."""
_TOLD_BY_LINES = 1200.0
"""Information in 1/m² of lines, each point counting as a measurement, from which they tell a
position by themselves."""
_BY_CHANCE = 12.0
"""Difference of the costs at two poses up to which it may be due to the noise of the scan and the
spacing of the map's surfaces: along bare walls it is at most 7."""
AS_PROBABLE = 4.5
"""Difference of the logarithms of the probabilities of two poses up to which both are possible:
that of three standard deviations."""


@compiled
def most_probable_pose(
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
) -> tuple[tuple[float, float, float], Floats, Floats, tuple[int, int], tuple[float, float]]:
    """Return the pose, the information of the points and that which the pose was found with, (near,
    fitting) and (residual, cost); `poses` are that of the start and the expected one."""
    (x, y, yaw), expected = poses
    scan = points, normals, variance, origin
    # The last is the information of the points that are matched across a line.
    hessian, gradient, across = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    # A point without a surface in the widest radius has none in the later ones.
    alone = np.zeros(len(points), dtype=np.bool_)
    fitting, squares, cost = 0, 0.0, 0.0
    for iteration in range(rules.iterations + 1):
        is_last = iteration == rules.iterations
        fine = radius <= rules.fine_m
        # Wide at first, or the points that happen to lie on any surface would hold the rest back.
        loose = 0.0 if fine else (_LOOSE_SHARE * radius) ** 2
        first = iteration == 0
        stride = 1 if fine or first or is_last else 2
        fitting, squares, cost = _residuals(
            grid, scan, (x, y, yaw), rules, (radius, loose), stride, first, alone, hessian,
            gradient, across,
        )  # fmt: skip
        if is_last:
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
    weakest_x, weakest_y = _weakest(hessian)
    by_lines = (
        weakest_x * (across[0, 0] * weakest_x + across[0, 1] * weakest_y)
        + weakest_y * (across[1, 0] * weakest_x + across[1, 1] * weakest_y)
    )  # fmt: skip
    information, counts = hessian.copy(), (len(points) - int(alone.sum()), fitting)
    if by_lines < _TOLD_BY_LINES and fitting > 0:
        weakest = weakest_x, weakest_y
        if not _is_told(grid, scan, (x, y, yaw), weakest, rules, radius, alone):
            _forget(information, weakest)
    return (x, y, yaw), information, hessian, counts, (residual, cost)


@nested
def _residuals(
    grid: SurfaceGrid,
    scan: tuple[Floats, Floats, Floats, Floats],
    pose: tuple[float, float, float],
    rules: MatchRules,
    radii: tuple[float, float],
    stride: int,
    first: bool,
    alone: Bools,
    hessian: Floats,
    gradient: Floats,
    across: Floats,
) -> tuple[int, float, float]:
    """Write the derivatives of the negative log-likelihood at a pose, those by lines alone to
    `across`, and return the number of points that fit, the sum of their squares, and the cost.

    `radii`: the search radius, and what the width of the kernel is squared at least. At `first`
    the points without a surface are noted as `alone`.
    """
    (points, normals, variance, origin), (x, y, yaw), (radius, loose) = scan, pose, radii
    cos, sin = math.cos(yaw), math.sin(yaw)
    hessian[:] = 0.0
    gradient[:] = 0.0
    across[:] = 0.0
    fitting, squares, cost = 0, 0.0, 0.0
    for k in range(0, len(points), stride):
        if alone[k]:
            cost += _cost_alone(variance[k], rules)
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
            max(radius, rules.search_m) if first else radius,
            rules.min_hits,
        )
        if surface < 0:
            if first:
                alone[k] = True
            cost += _cost_alone(variance[k], rules)
            continue
        sums = grid.sums[surface]
        ex = x + rx - sums[X] / sums[WEIGHT]
        ey = y + ry - sums[Y] / sums[WEIGHT]
        if ex * ex + ey * ey > radius * radius:
            cost += _cost_alone(variance[k], rules)
            continue
        is_line = forms_line(sums)
        if is_line or nx != 0.0 or ny != 0.0:
            # What the map has seen from afar alone shows no line, however straight the scan is.
            own_sigma_m = rules.surface_sigma_m if is_line else rules.point_sigma_m
            if is_line:
                length = max(math.hypot(sums[FACING_X], sums[FACING_Y]), 1e-12)
                nx, ny = sums[FACING_X] / length, sums[FACING_Y] / length
            along = vx * nx + vy * ny
            sigma2 = variance[k] * along * along + own_sigma_m**2 + 1.0 / sums[WEIGHT]
            error = nx * ex + ny * ey
            weight = _robust(error * error, sigma2, loose) / sigma2
            lever = ny * rx - nx * ry
            _accumulate(hessian, gradient, nx, ny, lever, error, weight)
            across[0, 0] += weight * nx * nx
            across[0, 1] += weight * nx * ny
            across[1, 1] += weight * ny * ny
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
    across[1, 0] = across[0, 1]
    return fitting, squares, cost


@nested
def _weakest(information: Floats) -> tuple[float, float]:
    """Return the unit vector in the plane along which a (3, 3) information tells least."""
    half = (information[0, 0] - information[1, 1]) / 2
    root = math.hypot(half, information[0, 1])
    # The eigenvector of the larger eigenvalue, turned by a quarter.
    angle = 0.5 * math.atan2(information[0, 1], half) + math.pi / 2 if root > 0.0 else 0.0
    return math.cos(angle), math.sin(angle)


@nested
def _is_told(
    grid: SurfaceGrid,
    scan: tuple[Floats, Floats, Floats, Floats],
    pose: tuple[float, float, float],
    along: tuple[float, float],
    rules: MatchRules,
    radius: float,
    alone: Bools,
) -> bool:
    """Return whether a scan tells the position along a unit vector in the plane: whether it fits
    worse on both sides of where it fits best, which may be beside the pose, as the expectation has
    a share in that."""
    (x, y, yaw), middle, best = pose, 2 * _BESIDE, 0
    costs = np.full(4 * _BESIDE + 1, np.nan)
    scratch = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for n in range(len(_STEPS) + 2):
        is_first = n < len(_STEPS)
        # The last two are beside the best of those before.
        steps = _STEPS[n] if is_first else best + _BESIDE * (2 * (n - len(_STEPS)) - 1)
        if math.isnan(costs[middle + steps]):
            away_m = steps * _STEP_M
            at = x + away_m * along[0], y + away_m * along[1], yaw
            _, _, costs[middle + steps] = _residuals(
                grid, scan, at, rules, (radius, 0.0), 1, False, alone, *scratch
            )
        if is_first and costs[middle + steps] < costs[middle + best]:
            best = steps
    beside = min(costs[middle + best - _BESIDE], costs[middle + best + _BESIDE])
    return bool(beside - costs[middle + best] >= _BY_CHANCE)


@nested
def _forget(information: Floats, along: tuple[float, float]) -> None:
    """Remove from a (3, 3) information what it tells along a unit vector in the plane, together
    with what the other directions know through it."""
    column = information[:, 0] * along[0] + information[:, 1] * along[1]
    about = column[0] * along[0] + column[1] * along[1]
    if about > 0.0:
        for i in range(3):
            for j in range(3):
                information[i, j] -= column[i] * column[j] / about


@nested
def _cost(square: float, sigma2: float) -> float:
    """Return the negative logarithm of the likelihood of a residual by its square and variance, for
    which `_robust` is the weight."""
    width = _KERNEL_SIGMAS * _KERNEL_SIGMAS
    return 0.5 * width * math.log1p(square / (width * sigma2))


@nested
def _cost_alone(variance: float, rules: MatchRules) -> float:
    """Return that of a point without a surface in the last search radius."""
    return _cost(rules.fine_m**2, variance + rules.point_sigma_m**2)


@nested
def _robust(square: float, sigma2: float, loose: float) -> float:
    """Return the weight of a residual by its square and variance (Cauchy); `loose` is added to the
    square of the kernel's width."""
    return 1.0 / (1.0 + square / (_KERNEL_SIGMAS * _KERNEL_SIGMAS * sigma2 + loose))


@nested
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
