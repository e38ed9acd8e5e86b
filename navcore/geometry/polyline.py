"""Lines of corners, such as a path or a track, measured along their length."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.geometry.transform import Pose2

Floats = npt.NDArray[np.float64]
Points = npt.NDArray[np.float64]


def metres_along(line: Points) -> Floats:
    """(N,) how far along the line each of its (N, 2) points is; 0 for the first."""
    return _metres_along(np.ascontiguousarray(line))


def points_at(line: Points, metres: Floats, stations: Floats) -> Points:
    """(K, 2) the points that are so far along the line, `stations` rising; before it its first
    point, beyond it its last.

    `metres`: (N,) of `metres_along`.
    """
    return _points_at(np.ascontiguousarray(line), metres, np.ascontiguousarray(stations))


def resample(line: Points, spacing_m: float) -> Points:
    """(K, 2) points along a line, so far apart or a little less; both its ends are among them."""
    metres = metres_along(line)
    return points_at(
        line, metres, np.linspace(0.0, metres[-1], max(2, math.ceil(metres[-1] / spacing_m) + 1))
    )


@compiled
def _metres_along(line: Points) -> Floats:
    metres = np.zeros(len(line))
    for index in range(1, len(line)):
        metres[index] = metres[index - 1] + math.hypot(
            line[index, 0] - line[index - 1, 0], line[index, 1] - line[index - 1, 1]
        )
    return metres


@compiled
def _points_at(line: Points, metres: Floats, stations: Floats) -> Points:
    points = np.empty((len(stations), 2))
    at = 0
    for index in range(len(stations)):
        while at < len(metres) - 1 and metres[at + 1] <= stations[index]:
            at += 1
        for axis in range(2):
            points[index, axis] = line[at, axis]
            if at < len(metres) - 1 and stations[index] > metres[at]:
                slope = (line[at + 1, axis] - line[at, axis]) / (metres[at + 1] - metres[at])
                points[index, axis] = slope * (stations[index] - metres[at]) + line[at, axis]
    return points


def path_from(path_map: Points, pose: Pose2) -> Points:
    """(N, 2) the path from its point nearest to the robot on, in the base frame."""
    nearest = int(np.argmin(np.hypot(path_map[:, 0] - pose.x_m, path_map[:, 1] - pose.y_m)))
    return pose.from_parent(path_map[nearest:])
