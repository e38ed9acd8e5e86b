"""Which points of a map are people, and what is left of them when they have gone.

A person is a point of the beware list and, where higher than an obstacle, a geometric one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from navcore.geometry.arrays import Indices
from navcore.grid.bitplane import BitPlane
from navcore.grid.cell_mask import window
from navcore.grid.grid import Box, GridSpec, inflate
from navcore.mapping.points.point_queries import points_in
from navcore.mapping.points.point_table import PointTable
from navcore.mission.beware_list import NOTHING
from navcore.robot.frame import Frame


def class_set(class_ids: Iterable[int]) -> npt.NDArray[np.bool_]:
    """Return a set of classes as (256,) truth values by class id."""
    kinds = np.zeros(256, dtype=np.bool_)
    kinds[list(class_ids)] = True
    return kinds


def body_cells(planes: Iterable[BitPlane], spec: GridSpec, box: Box, body_m: float) -> Indices:
    """Return the (N, 2) row and column of the cells of a box within `body_m` of those that people
    occupy, by the planes of their classes."""
    bodies = [window(plane, *box) for plane in planes]
    if not any(body.any() for body in bodies):
        return np.empty((0, 2), dtype=np.int64)
    reach = math.ceil(body_m / spec.resolution_m)
    return np.argwhere(inflate(np.logical_or.reduce(bodies), reach)) + box[:2]


def points_of_bodies(
    points: PointTable, cells: Indices, spec: GridSpec, people: Iterable[int]
) -> Indices:
    """Return the indices of people and obstacles in (N, 2) cells, row and column."""
    flat = cells[:, 0] * spec.cols + cells[:, 1]
    return points_in(points.first, points.records, flat, class_set([NOTHING, *people]))


def within_image(points: PointTable, indices: Indices, frame: Frame) -> Indices:
    """Return those of (N,) points in whose cells the frame shows all of them: depth may see nothing
    at all behind remains that float in the air."""
    held = points.records[indices]
    outside = held["cell"][~frame.shows(np.column_stack([held["x"], held["y"], held["z"]]))]
    return np.asarray(indices[~np.isin(held["cell"], outside)])
