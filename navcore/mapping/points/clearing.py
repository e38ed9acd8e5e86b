"""Points of the map that a new depth image disproves or replaces."""

from __future__ import annotations

import numpy as np

from navcore.compiled import compiled, inlined, nested
from navcore.config.mapping import ClearingRules
from navcore.geometry.arrays import FloatImage, Indices
from navcore.geometry.camera import Pinhole, column_slope, row_slope
from navcore.geometry.transform import Matrix
from navcore.mapping.points.point_links import Records
from navcore.mission.beware_list import NOTHING

_DEEP_M = -0.1
"""Height in metres below which a point is that of a drop."""
_LEVEL_M = 0.05
"""Greatest distance in metres from the ground of what counts as ground."""
_NEAR_M = 4.0
"""Depth in metres up to which an image tells whether ground is where a drop was."""


@nested
def pixel_of(
    point: np.void, T_camera_map: Matrix, lens: Pinhole, nearest_m: float
) -> tuple[int, int, float]:
    """Return row, column and depth in metres of a map point in the camera image; row and column are
    −1 for a depth below `nearest_m`."""
    return pixel_at(point.x, point.y, point.z, T_camera_map, lens, nearest_m)  # type: ignore[attr-defined]


@nested
def pixel_at(
    x: float, y: float, z: float, t: Matrix, lens: Pinhole, nearest_m: float
) -> tuple[int, int, float]:
    """Return the same for a position."""
    depth = t[2, 0] * x + t[2, 1] * y + t[2, 2] * z + t[2, 3]
    if depth < nearest_m:
        return -1, -1, depth
    j = round((t[0, 0] * x + t[0, 1] * y + t[0, 2] * z + t[0, 3]) / depth * lens.fx + lens.cx)
    i = round((t[1, 0] * x + t[1, 1] * y + t[1, 2] * z + t[1, 3]) / depth * lens.fy + lens.cy)
    return i, j, depth


@compiled
def find_outdated(
    records: Records,
    held: Indices,
    depth_m: FloatImage,
    ground_m: FloatImage,
    T_camera_map: Matrix,
    lens: Pinhole,
    clearing: ClearingRules,
    max_range_m: float,
    pose_id: int,
) -> Indices:
    """Return the indices of those of (N,) `held` points that the frame sees through, or measures
    again for the same pose or from much nearer, or shows to be ground: raised ground of the
    heights `ground_m`, those of `ground.ground_heights`, or, of what was a drop, ground at the
    robot's own height.

    A point is judged by its pixel and the neighbouring pixels. One of them that measures something
    nearer occludes the point; the point is seen through only if all measured ones measure beyond
    it. Depth alone never measures points of a beware class again, and never sees through flat ones:
    a floor marking has no depth of its own, and neither a label lost at a grazing angle nor the
    pitch of the robot when it brakes must free it.
    """
    outdated, found = np.empty_like(held), 0
    for index in held:
        outdated[found] = index
        found += _is_outdated(
            records[index], depth_m, ground_m, T_camera_map, lens, clearing, max_range_m, pose_id
        )
    return outdated[:found]


@inlined
def _is_outdated(
    point: np.void,
    depth_m: FloatImage,
    ground_m: FloatImage,
    t: Matrix,
    lens: Pinhole,
    clearing: ClearingRules,
    max_range_m: float,
    pose_id: int,
) -> bool:
    height, width = depth_m.shape
    i, j, depth = pixel_of(point, t, lens, clearing.nearest_m)
    in_range = clearing.nearest_m <= depth <= max_range_m
    if not (in_range and 0 <= i < height and 0 <= j < width):
        return False
    nearest = _nearest_m(depth_m, i, j)
    tolerance = clearing.constant_m + clearing.per_m2 * depth * depth
    beware = point.class_id != NOTHING  # type: ignore[attr-defined]
    flat = beware and point.z < clearing.flat_m  # type: ignore[attr-defined]
    is_deep = not beware and point.z < _DEEP_M  # type: ignore[attr-defined]
    if is_deep and nearest < depth - tolerance:
        # The robot may have come down to its level: then there is ground at the robot's height.
        i, j, depth = pixel_at(point.x, point.y, 0.0, t, lens, clearing.nearest_m)  # type: ignore[attr-defined]
        if depth > _NEAR_M or not _is_ground(i, j, depth_m, ground_m, t, lens):
            return False
        # The line of sight is flat: over a trench it meets the ground behind.
        is_there = abs(depth_m[i, j] - depth) <= clearing.constant_m
        return bool(is_there and abs(ground_m[min(i, len(ground_m) - 1), j]) <= _LEVEL_M)
    if nearest == np.inf or nearest < depth - tolerance or flat:
        return False
    nearer = depth < clearing.nearer_share * point.range_m  # type: ignore[attr-defined]
    again = not beware and (point.pose_id == pose_id or nearer)  # type: ignore[attr-defined]
    if nearest > depth + tolerance or again:
        return True
    if beware or len(ground_m) == 1:
        return False
    # Above or below the robot's plane; on the plane the point's own height has told what it is.
    ground = ground_m[i, j]
    is_at_ground = abs(ground) > _LEVEL_M and abs(point.z - ground) <= -_DEEP_M  # type: ignore[attr-defined]
    return bool(is_at_ground and _is_ground(i, j, depth_m, ground_m, t, lens))


@nested
def _is_ground(
    i: int, j: int, depth_m: FloatImage, ground_m: FloatImage, t: Matrix, lens: Pinhole
) -> bool:
    """Whether a pixel and those beside it show ground, whose height is `ground_m`."""
    height, width = depth_m.shape
    if not (0 < i < height - 1 and 0 < j < width - 1):
        return False
    for row in range(i - 1, i + 2):
        for col in range(j - 1, j + 2):
            measured = depth_m[row, col]
            x = column_slope(col, lens) * measured - t[0, 3]
            y = row_slope(row, lens) * measured - t[1, 3]
            z = t[0, 2] * x + t[1, 2] * y + t[2, 2] * (measured - t[2, 3])
            ground = ground_m[row if len(ground_m) > 1 else 0, col]
            if abs(z - ground) > _LEVEL_M:
                return False
    return True


@inlined
def _nearest_m(depth_m: FloatImage, i: int, j: int) -> float:
    """Return the least depth measured at a pixel and beside it; infinite for none. Free of
    branches, which noise would make unpredictable."""
    far = np.float32(np.inf)
    nearest = far
    for row in range(i - 1, i + 2):
        for col in range(j - 1, j + 2):
            depth = depth_m[
                min(max(row, 0), depth_m.shape[0] - 1), min(max(col, 0), depth_m.shape[1] - 1)
            ]
            depth = depth if depth > np.float32(0) else far
            nearest = depth if depth < nearest else nearest
    return float(nearest)
