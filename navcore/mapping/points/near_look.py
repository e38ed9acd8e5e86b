"""Near looks: where a frame measures a point of the map so near that its colour tells whether the
point is there."""

from __future__ import annotations

import numpy as np

from navcore.compiled import compiled, nested
from navcore.config.mapping import ClearingRules, FadingRules
from navcore.geometry.arrays import Bools, FloatImage
from navcore.geometry.camera import Pinhole
from navcore.geometry.transform import Matrix, invert
from navcore.mapping.points.clearing import pixel_of
from navcore.mapping.points.point_links import Records
from navcore.robot.frame import Frame


@nested
def near_pixel(
    point: np.void,
    depth_m: FloatImage,
    T_camera_map: Matrix,
    lens: Pinhole,
    clearing: ClearingRules,
    fading: FadingRules,
) -> tuple[int, int, float]:
    """Return row, column and depth in metres of a point at which an image has a near look; row and
    column are −1 where it has none: the point is far, out of view or covered."""
    height, width = depth_m.shape
    i, j, depth = pixel_of(point, T_camera_map, lens, clearing.nearest_m)
    if depth > fading.near_m or i < 0 or i >= height or j < 0 or j >= width:
        return -1, -1, depth
    tolerance = fading.tolerance_m + clearing.per_m2 * depth * depth
    if depth_m[i, j] <= 0 or abs(depth_m[i, j] - depth) > tolerance:
        return -1, -1, depth
    return i, j, depth


def has_near_look(
    points: Records, frame: Frame, clearing: ClearingRules, fading: FadingRules
) -> Bools:
    """Return (N,) whether a frame has a near look at points."""
    pinhole, T_camera_map = frame.intrinsics.pinhole, invert(frame.T_map_camera)
    return _have_near_look(points, frame.depth_m, T_camera_map, pinhole, clearing, fading)


@compiled
def _have_near_look(
    points: Records,
    depth_m: FloatImage,
    T_camera_map: Matrix,
    lens: Pinhole,
    clearing: ClearingRules,
    fading: FadingRules,
) -> Bools:
    seen = np.zeros(len(points), dtype=np.bool_)
    for k in range(len(points)):
        seen[k] = near_pixel(points[k], depth_m, T_camera_map, lens, clearing, fading)[0] >= 0
    return seen
