"""Submaps: the surfaces of several scans in one frame, placed beside each other by odometry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navcore.geometry.arrays import Floats, Points
from navcore.geometry.transform import Pose2
from navcore.localisation.scans.scan import Scan

CELL_M = 0.1
"""Edge in metres of the cells that keep one point for each direction of the surface."""
LEAST_VARIANCE_M2 = 0.01**2
"""Variance in square metres below which a point does not weigh more."""
DIRECTIONS = 8
"""Directions of surfaces that a cell tells apart."""
View = tuple[Pose2, Scan]
"""T_odom_base, and the scan that was taken there."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Submap:
    """Surface points with the positions they were seen from, all (N, 2) in metres of the frame of
    `T_odom_base`; the arrays are read-only."""

    points: Points
    """Positions of the surfaces."""
    normals: Points
    """Unit normals towards the viewer; (0, 0) where unknown."""
    origins: Points
    """Positions of the camera."""
    T_odom_base: Pose2
    """Pose of the robot, in odometry's frame, in whose frame the points are."""

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)

    @property
    def mirrored(self) -> Submap:
        """What a mirror along the robot's heading shows: surfaces of the same kind, at no place of
        any map."""
        flip = np.array([1.0, -1.0])
        return Submap(
            points=self.points * flip,
            normals=self.normals * flip,
            origins=self.origins * flip,
            T_odom_base=self.T_odom_base,
        )

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.points, self.normals, self.origins):
            array.flags.writeable = False


def submap_of(views: Sequence[View], *, reference: Pose2 | None = None) -> Submap:
    """Return the surfaces of scans, in the frame of `reference`, by
    default the last pose; the points of a surface in one cell become their mean.

    Raises `ValueError` without a view.
    """
    if not views:
        raise ValueError("a submap needs at least one view")
    if reference is None:
        reference = views[-1][0]
    parts, weights = [], []
    for pose, scan in views:
        place = reference.inverse() @ pose
        turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=place.yaw_rad)
        origin = np.broadcast_to(place.to_parent(scan.origin), scan.points_base.shape)
        parts.append(
            np.hstack([place.to_parent(scan.points_base), turn.to_parent(scan.normals), origin])
        )
        weights.append(1.0 / np.maximum(scan.variance_m2, LEAST_VARIANCE_M2))
    rows = _means(np.vstack(parts), np.concatenate(weights))
    return Submap(
        points=rows[:, :2].copy(),
        normals=rows[:, 2:4].copy(),
        origins=rows[:, 4:].copy(),
        T_odom_base=reference,
    )


def _means(rows: Floats, weights: Floats) -> Floats:
    """Return one row for each cell and direction: mean position and unit normal, and the origin of
    one of its points, so that the line of sight is a real one."""
    angle = np.arctan2(rows[:, 3], rows[:, 2])
    direction = np.round(angle / (2.0 * math.pi / DIRECTIONS)).astype(np.int64) % DIRECTIONS
    direction[~(rows[:, 2:4] != 0.0).any(axis=1)] = DIRECTIONS
    cells = np.floor(rows[:, :2] / CELL_M).astype(np.int64)
    low = cells.min(axis=0, initial=0)
    span = cells.max(axis=0, initial=0) - low + 1
    keys = ((cells[:, 0] - low[0]) * span[1] + cells[:, 1] - low[1]) * (DIRECTIONS + 1) + direction
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    total = np.bincount(index, weights=weights)
    means = rows[first]
    for column in range(4):
        means[:, column] = np.bincount(index, weights=weights * rows[:, column]) / total
    length = np.hypot(means[:, 2], means[:, 3])
    means[:, 2:4] /= np.where(length > 0.0, length, 1.0)[:, None]
    return means
