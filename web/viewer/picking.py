"""From a ray of the pointer to a point on the floor. Rays come from a browser: nothing about them
is taken for granted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navcore.grid.grid import GridSpec

Point = tuple[float, float]

FARTHEST_M = 1e4
STEEPEST_HORIZON = 1e-4
"""Least downward share of a ray; flatter ones meet the floor nowhere sensible."""


def floor_point(origin: Sequence[float], direction: Sequence[float]) -> Point | None:
    """Where a ray meets the plane z = 0, in metres; None for a ray that is not finite, horizontal,
    or leads away from it."""
    try:
        start, way = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if (
        start.shape != (3,)
        or way.shape != (3,)
        or not (np.isfinite(start).all() and np.isfinite(way).all())
    ):
        return None
    length = float(np.abs(way).max())
    if length == 0 or abs(way[2] / length) < STEEPEST_HORIZON:
        return None
    distance = -start[2] / (way[2] / length)
    point = start + distance * (way / length)
    if not distance > 0 or not np.abs(point).max() < FARTHEST_M:
        return None
    return float(point[0]), float(point[1])


def clamped(point: Point, spec: GridSpec) -> Point:
    """The nearest point on the map, a hair inside its border."""
    hair = spec.resolution_m * 0.05
    right = spec.origin_x_m + spec.cols * spec.resolution_m
    top = spec.origin_y_m + spec.rows * spec.resolution_m
    return (
        min(max(point[0], spec.origin_x_m + hair), right - hair),
        min(max(point[1], spec.origin_y_m + hair), top - hair),
    )
