"""Picking of the floor point on a pointer's ray. Rays come from a browser and are not trusted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Point = tuple[float, float]

FARTHEST_M = 1e4
"""Largest coordinate of a picked point in metres."""
MIN_SLOPE = 1e-4
"""Least vertical share of a ray's direction; flatter rays meet the floor too far away."""


def floor_point(origin: Sequence[float], direction: Sequence[float]) -> Point | None:
    """Return the intersection of a ray with the plane z = 0 in metres; None for a ray that is not
    finite, is horizontal, or points away from the plane."""
    try:
        start, along = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if (
        start.shape != (3,)
        or along.shape != (3,)
        or not (np.isfinite(start).all() and np.isfinite(along).all())
    ):
        return None
    length = float(np.abs(along).max())
    if length == 0 or abs(along[2] / length) < MIN_SLOPE:
        return None
    distance = -start[2] / (along[2] / length)
    point = start + distance * (along / length)
    if not distance > 0 or not np.abs(point).max() < FARTHEST_M:
        return None
    return float(point[0]), float(point[1])
