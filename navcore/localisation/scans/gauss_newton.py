"""The most probable pose of a scan by Gauss–Newton with a robust kernel.

Points on lines are matched across the line, points on legs, posts and corners in both directions,
and only with surfaces that face the camera.
"""

from __future__ import annotations

import math

import numpy as np

from navcore.compiled import compiled, nested
from navcore.config.localisation.localisation import MatchRules
from navcore.geometry.arrays import Floats
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
        is_last = iteration == rules.iterations
        fine = radius <= rules.fine_m
        # Wide at first, or the points that happen to lie on any surface would hold the rest back.
        loose = 0.0 if fine else (_LOOSE_SHARE * radius) ** 2
        cos, sin = math.cos(yaw), math.sin(yaw)
        hessian[:] = 0.0
        gradient[:] = 0.0
        fitting, squares, cost = 0, 0.0, 0.0
        for k in range(0, len(points), 1 if fine or iteration == 0 or is_last else 2):
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
                max(radius, rules.search_m) if iteration == 0 else radius,
                rules.min_hits,
            )
            if surface < 0:
                if iteration == 0:
                    alone[k] = True
                    near -= 1
                cost += _cost_alone(variance[k], rules)
                continue
            sums = grid.sums[surface]
            ex = x + rx - sums[X] / sums[WEIGHT]
            ey = y + ry - sums[Y] / sums[WEIGHT]
            if ex * ex + ey * ey > radius * radius:
                cost += _cost_alone(variance[k], rules)
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
    return (x, y, yaw), hessian, (near, fitting), (residual, cost)


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
