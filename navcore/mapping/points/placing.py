"""Points in the base frame of their pose ID, and where they are on the map.

Both directions are computed here alone, so that the same pose always gives the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, nested
from navcore.geometry.arrays import Floats, Indices
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_table import OFF_GRID, POINT

ROUNDING_M = 1e-3
"""Distance in metres beside the grid within which a point counts as in the cell at its border."""


class Grid(NamedTuple):
    """Size and position of a grid, as compiled kernels take it."""

    origin_x_m: float
    origin_y_m: float
    resolution_m: float
    rows: int
    cols: int


def pose_rows(poses: Iterable[Pose2]) -> Floats:
    """Return (P, 4) x and y in metres, cosine and sine of the heading of each pose."""
    return np.array(
        [(pose.x_m, pose.y_m, math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)) for pose in poses],
        dtype=np.float64,
    ).reshape(-1, 4)


def base_points(
    points_map: npt.NDArray[np.float32], pose_ids: npt.NDArray[np.int32], rows: Floats
) -> npt.NDArray[np.float32]:
    """Return (N, 2) x and y in the base frame at the pose of each of (N, 3) points of the map.

    `pose_ids`: (N,) row of each point's pose in the (P, 4) `pose_rows`.
    """
    points_base = np.empty((len(points_map), 2), dtype=np.float32)
    _leave(points_map, pose_ids, rows, points_base)
    return points_base


def map_points(
    points_base: npt.NDArray[np.float32], pose_ids: npt.NDArray[np.int32], rows: Floats
) -> npt.NDArray[np.float32]:
    """Return (N, 3) points of the map for (N, 3) points in the base frame at the pose of each, with
    the height of the map frame: the reverse of `base_points`."""
    anywhere = GridSpec(resolution_m=1.0, rows=1, cols=1, origin_x_m=0.0, origin_y_m=0.0)
    records = np.zeros(len(points_base), dtype=POINT)
    records["base_x"], records["base_y"], records["z"] = points_base.T
    place(records, pose_ids, rows, anywhere)
    return np.column_stack([records["x"], records["y"], records["z"]])


def place(
    records: Records, pose_ids: npt.NDArray[np.int32] | Indices, rows: Floats, spec: GridSpec
) -> None:
    """Compute x, y and cell of (N,) points from their position in the base frame.

    `pose_ids`: (N,) row of each point's pose in the (P, 4) `pose_rows`.
    """
    grid = Grid(spec.origin_x_m, spec.origin_y_m, spec.resolution_m, spec.rows, spec.cols)
    _place(records, pose_ids, rows, grid)


@compiled
def _leave(
    points_map: npt.NDArray[np.float32],
    pose_ids: npt.NDArray[np.int32],
    rows: Floats,
    points_base: npt.NDArray[np.float32],
) -> None:
    for index in range(len(points_map)):
        pose = pose_ids[index]
        dx = np.float64(points_map[index, 0]) - rows[pose, 0]
        dy = np.float64(points_map[index, 1]) - rows[pose, 1]
        cos, sin = rows[pose, 2], rows[pose, 3]
        points_base[index, 0] = cos * dx + sin * dy
        points_base[index, 1] = cos * dy - sin * dx


@compiled
def _place(
    records: Records, pose_ids: npt.NDArray[np.int32] | Indices, rows: Floats, grid: Grid
) -> None:
    for index in range(len(records)):
        pose = pose_ids[index]
        x0, y0, cos, sin = rows[pose, 0], rows[pose, 1], rows[pose, 2], rows[pose, 3]
        base_x, base_y = np.float64(records[index].base_x), np.float64(records[index].base_y)
        x = np.float32(x0 + (cos * base_x - sin * base_y))
        y = np.float32(y0 + (sin * base_x + cos * base_y))
        records[index].x, records[index].y = x, y
        row = _line(np.float64(y) - grid.origin_y_m, grid.resolution_m, grid.rows)
        col = _line(np.float64(x) - grid.origin_x_m, grid.resolution_m, grid.cols)
        on_grid = row >= 0 and col >= 0
        records[index].cell = row * grid.cols + col if on_grid else OFF_GRID


@nested
def _line(along_m: float, resolution_m: float, count: int) -> int:
    """Return the row or column at a distance from the grid's border; −1 beside the grid."""
    # A point inside the border may be outside by a rounding error in single precision.
    if along_m < -ROUNDING_M or along_m > count * resolution_m + ROUNDING_M:
        return -1
    return min(max(math.floor(along_m / resolution_m), 0), count - 1)
