"""Picking of the floor point on a pointer's ray. Rays come from a browser and are not trusted."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import viser.transforms

Point = tuple[float, float]

FARTHEST_M = 1e4
"""Largest coordinate of a picked point in metres."""
MIN_SLOPE = 1e-4
"""Least vertical share of a ray's direction; flatter rays meet the floor too far away."""


def pixel_ray(
    wxyz: Sequence[float], fov_rad: float, aspect: float, right: float, down: float
) -> list[float]:
    """Return the direction (x, y, z) in the map frame of the ray through a pixel.

    `wxyz`: orientation of the camera (z forwards, y down). `fov_rad`: vertical field of view.
    `aspect`: width / height. `right`, `down`: shares of the image to the left of and above the
    pixel.
    """
    reach = math.tan(fov_rad / 2)
    along = np.array([(2 * right - 1) * reach * aspect, (2 * down - 1) * reach, 1.0])
    turned = viser.transforms.SO3(np.asarray(wxyz, dtype=np.float64)).apply(along)
    return [float(value) for value in turned]


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
