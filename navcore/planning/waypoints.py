"""Corners of a path, by turning angle (the paper's Algorithm 1, path refinement)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.config.planning import MAX_VERTEX_ANGLE_DEG
from navcore.grid.grid import GridSpec
from navcore.planning.path import Path

DEFAULT_VERTEX_ANGLE_RAD = math.radians(MAX_VERTEX_ANGLE_DEG)
"""Default of the largest angle at a corner, in rad."""


def choose_waypoints(
    path: Path, spec: GridSpec, *, max_vertex_angle_rad: float
) -> npt.NDArray[np.float64]:
    """Return (M, 2) points (x, y) in metres of the map frame: the path's corners and its end.

    A cell p_i is kept where the angle at it between p_(i−1) − p_i and p_(i+1) − p_i, π on a
    straight line, is below `max_vertex_angle_rad`, which is less than π. The end of the path is
    always a waypoint.
    """
    steps = np.diff(path.cells, axis=0)
    bends = np.flatnonzero(np.diff(3 * steps[:, 0] + steps[:, 1]))
    before, after = -steps[bends], steps[bends + 1]
    lengths = np.hypot(*before.T) * np.hypot(*after.T)
    angles = np.arccos(np.clip((before * after).sum(axis=1) / lengths, -1.0, 1.0))
    corners = path.cells[bends[angles < max_vertex_angle_rad] + 1]
    return spec.centres(np.vstack([corners, path.cells[-1:]]))
