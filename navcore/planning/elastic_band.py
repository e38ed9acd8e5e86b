"""The track as an elastic band: pushed off what stands near, until there is room enough for the
robot to turn, or no more room.

The path on the grid is the shortest for a disc as wide as the robot, and touches the corner of
every doorpost. A body longer than it is wide cannot turn so near to one. So each point of the track
gives way to what is nearer to it than the circle in which the robot turns, and the points hang
together: through a door the band goes by its middle, squarely (Quinlan and Khatib, "Elastic bands",
1993). It never leaves the cells that the path may use, and where there is no more room it stays as
it was.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from navcore.compiled import compiled
from navcore.geometry.arrays import FloatImage, Points
from navcore.geometry.polyline import metres_along
from navcore.grid.bitplane import BitPlane
from navcore.grid.cell_mask import window
from navcore.grid.grid import GridSpec

ROUNDS = 60
"""So often each point gives way."""
PUSH, PULL = 0.25, 0.5
"""Of what lacks in room, and of the way to the middle between its neighbours, so much a round."""


def relax(
    track: Points, free: BitPlane, spec: GridSpec, *, stretch_m: float, wanted_m: float
) -> Points:
    """(K, 2) the track, metres of the map frame, with more room over its first stretch; its ends
    stay.

    The track's points are evenly apart, by more than half a cell and no more than one. `free` is
    the plane of the cells that the robot's middle may be in, `wanted_m` a distance to all others
    that is room enough.
    """
    # Of points a cell or hardly less apart, the stretch is among the first; all of a long track
    # need not be measured.
    metres = metres_along(track[: 2 + 2 * math.ceil(stretch_m / spec.resolution_m)])
    count = int(np.searchsorted(metres, stretch_m))
    if count < 3 or wanted_m <= 0:  # a margin may be wider than the circle in which the robot turns
        return track
    wanted, origin = wanted_m / spec.resolution_m, np.array([spec.origin_x_m, spec.origin_y_m])
    cells = (track[: count + 1] - origin) / spec.resolution_m
    reach = int(np.ceil(wanted)) + 2
    left, top = np.maximum(np.floor(cells.min(axis=0)).astype(int) - reach, 0).tolist()
    right, bottom = np.minimum(
        np.ceil(cells.max(axis=0)).astype(int) + reach, (spec.cols, spec.rows)
    ).tolist()
    near = window(free, top, left, bottom, right).view(np.uint8)
    room: FloatImage = cv2.distanceTransform(near, cv2.DIST_L2, 5).astype(np.float32, copy=False)
    corner = np.array([left, top])
    moved = _eased(cells - corner, room, wanted) + corner
    return np.vstack([moved * spec.resolution_m + origin, track[count + 1 :]])


@compiled
def _eased(points: Points, room: FloatImage, wanted: float) -> Points:
    """In cells. Point by point, so that each already hangs on where the one before it is by now."""
    rows, cols = room.shape
    points = points.copy()
    for _ in range(ROUNDS):
        for index in range(1, len(points) - 1):
            x, y = points[index]
            col, row = int(x), int(y)
            if not (0 < row < rows - 1 and 0 < col < cols - 1):
                continue
            to_x = PULL * ((points[index - 1, 0] + points[index + 1, 0]) / 2 - x)
            to_y = PULL * ((points[index - 1, 1] + points[index + 1, 1]) / 2 - y)
            lacking = wanted - room[row, col]
            if lacking > 0:
                to_x += PUSH * lacking * (room[row, col + 1] - room[row, col - 1]) / 2
                to_y += PUSH * lacking * (room[row + 1, col] - room[row - 1, col]) / 2
            new_col, new_row = int(x + to_x), int(y + to_y)
            if (
                0 <= new_row < rows
                and 0 <= new_col < cols
                and room[new_row, new_col] >= min(room[row, col], 1.0)
            ):
                points[index, 0], points[index, 1] = x + to_x, y + to_y
    return points
