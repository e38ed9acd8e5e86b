"""The path as an elastic band: pushed away from obstacles until the robot can turn everywhere on
it, or there is no more clearance.

The path on the grid is the shortest for a disc as wide as the robot, and touches the corner of
every doorpost, where a body longer than wide cannot turn. So each point of the path is repelled by
obstacles nearer than the circle in which the robot turns, and pulled towards the middle between its
neighbours: the band passes a door at its middle, at a right angle (Quinlan and Khatib, "Elastic
bands", 1993). It never leaves the free cells, and stays as it was where there is no more clearance.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from navcore.compiled import compiled
from navcore.config.planning import PLANNING_CONFIG, ElasticBandConfig
from navcore.geometry.arrays import FloatImage, Points
from navcore.geometry.polyline import metres_along
from navcore.grid.bitplane import BitPlane
from navcore.grid.cell_mask import window
from navcore.grid.grid import GridSpec


def relax(
    track: Points,
    free: BitPlane,
    spec: GridSpec,
    *,
    wanted_m: float,
    config: ElasticBandConfig = PLANNING_CONFIG.elastic_band,
) -> Points:
    """Return the (K, 2) path, metres of the map frame, with more clearance over its first stretch;
    its ends stay.

    The points of `track` are evenly spaced, by more than half a cell and no more than one. `free`
    is the plane of the free cells, `wanted_m` the clearance to all others that is sufficient.
    """
    stretch_m = config.stretch_m
    # Points are a cell or hardly less apart, so the stretch is among the first of them; a long
    # path need not be measured whole.
    metres = metres_along(track[: 2 + 2 * math.ceil(stretch_m / spec.resolution_m)])
    count = int(np.searchsorted(metres, stretch_m))
    if count < 3 or wanted_m <= 0:  # the margin may exceed the turning circle
        return track
    wanted, origin = wanted_m / spec.resolution_m, np.array([spec.origin_x_m, spec.origin_y_m])
    cells = (track[: count + 1] - origin) / spec.resolution_m
    reach = int(np.ceil(wanted)) + 2
    left, top = np.maximum(np.floor(cells.min(axis=0)).astype(int) - reach, 0).tolist()
    right, bottom = np.minimum(
        np.ceil(cells.max(axis=0)).astype(int) + reach, (spec.cols, spec.rows)
    ).tolist()
    near = window(free, top, left, bottom, right).view(np.uint8)
    clearance: FloatImage = cv2.distanceTransform(near, cv2.DIST_L2, 5).astype(
        np.float32, copy=False
    )
    corner = np.array([left, top])
    forces = config.repulsion, config.contraction
    moved = _relaxed(cells - corner, clearance, wanted, *forces, config.iterations) + corner
    relaxed = track.copy()
    relaxed[1 : len(moved) - 1] = moved[1:-1] * spec.resolution_m + origin
    return relaxed


@compiled
def _relaxed(
    points: Points,
    clearance: FloatImage,
    wanted: float,
    repulsion: float,
    contraction: float,
    iterations: int,
) -> Points:
    """(K, 2) relaxed points, all in cells; one by one, so that each depends on the present position
    of the one before it."""
    rows, cols = clearance.shape
    points = points.copy()
    for _ in range(iterations):
        for index in range(1, len(points) - 1):
            x, y = points[index]
            col, row = int(x), int(y)
            if not (0 < row < rows - 1 and 0 < col < cols - 1):
                continue
            to_x = contraction * ((points[index - 1, 0] + points[index + 1, 0]) / 2 - x)
            to_y = contraction * ((points[index - 1, 1] + points[index + 1, 1]) / 2 - y)
            lacking = wanted - clearance[row, col]
            if lacking > 0:
                to_x += (
                    repulsion * lacking * (clearance[row, col + 1] - clearance[row, col - 1]) / 2
                )
                to_y += (
                    repulsion * lacking * (clearance[row + 1, col] - clearance[row - 1, col]) / 2
                )
            new_col, new_row = int(x + to_x), int(y + to_y)
            if (
                0 <= new_row < rows
                and 0 <= new_col < cols
                and clearance[new_row, new_col] >= min(clearance[row, col], 1.0)
            ):
                points[index, 0], points[index, 1] = x + to_x, y + to_y
    return points
