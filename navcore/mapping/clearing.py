"""Which points of the map a new picture disproves or measures anew."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.mapping.point_table import Cells, Records
from navcore.mapping.voxels import Box
from navcore.mission.beware_list import NOTHING

FLAT_M = 0.05
"""Beware points below this lie on the floor, as far as depth can tell."""
NEAREST_M = 0.2
"""Nothing nearer to the camera is measured."""
Indices = npt.NDArray[np.int64]


@compiled
def pixel_of(
    point: np.void, T_camera_map: npt.NDArray[np.float64], lens: npt.NDArray[np.float64]
) -> tuple[int, int, float]:
    """Row, column and depth at which the camera would see a point of the map; (−1, −1) where it is
    behind or too near."""
    t, x, y, z = T_camera_map, float(point.x), float(point.y), float(point.z)  # type: ignore[attr-defined]
    depth = t[2, 0] * x + t[2, 1] * y + t[2, 2] * z + t[2, 3]
    if depth < NEAREST_M:
        return -1, -1, depth
    j = round((t[0, 0] * x + t[0, 1] * y + t[0, 2] * z + t[0, 3]) / depth * lens[0] + lens[2])
    i = round((t[1, 0] * x + t[1, 1] * y + t[1, 2] * z + t[1, 3]) / depth * lens[1] + lens[3])
    return i, j, depth


@compiled
def find_outdated(
    records: Records,
    count: int,
    first: Cells,
    cols: int,
    box: Box,
    depth_m: npt.NDArray[np.float32],
    T_camera_map: npt.NDArray[np.float64],
    lens: npt.NDArray[np.float64],
    clearing: npt.NDArray[np.float64],
    max_range_m: float,
    pose_id: int,
) -> Indices:
    """Indices of the points that the frame sees through, or measures again for the same pose or
    from much nearer.

    A point's pixel and its neighbours in the picture are looked at: one that measures something
    nearer hides the point, and the point is seen through only when all that measure anything
    measure beyond it. Points of a beware class are never "measured again" by depth alone, and flat
    ones never seen through: a floor marking has no depth of its own, and neither a label lost at a
    grazing angle nor a nod of the robot when it brakes must free it.
    """
    found = np.empty(count, dtype=np.int64)
    found_count = 0
    for row in range(box[0], box[2]):
        for col in range(box[1], box[3]):
            at = first[row * cols + col]
            while at > 0:
                point = records[at - 1]
                if _is_outdated(point, depth_m, T_camera_map, lens, clearing, max_range_m, pose_id):
                    found[found_count] = at - 1
                    found_count += 1
                at = point.next
    return found[:found_count]


@compiled
def _is_outdated(
    point: np.void,
    depth_m: npt.NDArray[np.float32],
    t: npt.NDArray[np.float64],
    lens: npt.NDArray[np.float64],
    clearing: npt.NDArray[np.float64],
    max_range_m: float,
    pose_id: int,
) -> bool:
    height, width = depth_m.shape
    i, j, depth = pixel_of(point, t, lens)
    if depth < NEAREST_M or depth > max_range_m or i < 0 or i >= height or j < 0 or j >= width:
        return False
    tolerance = clearing[0] + clearing[1] * depth * depth
    nearest = np.inf
    for r in range(max(i - 1, 0), min(i + 2, height)):
        for c in range(max(j - 1, 0), min(j + 2, width)):
            if 0.0 < depth_m[r, c] < nearest:
                nearest = depth_m[r, c]
    beware = point.class_id != NOTHING  # type: ignore[attr-defined]
    flat = beware and point.z < FLAT_M  # type: ignore[attr-defined]
    if nearest == np.inf or nearest < depth - tolerance or flat:
        return False
    again = not beware and (point.pose_id == pose_id or depth < 0.7 * point.range_m)  # type: ignore[attr-defined]
    return bool(nearest > depth + tolerance or again)
