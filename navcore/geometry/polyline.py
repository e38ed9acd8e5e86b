"""Polylines, such as a path or a track: their length, points along them, their corners."""

from __future__ import annotations

import math

import numpy as np

from navcore.compiled import compiled
from navcore.geometry.arrays import Floats, Indices, Points
from navcore.geometry.transform import Pose2

Corners = tuple[tuple[float, float], ...]
"""Corners (x, y) in metres of a polygon or a polyline, in order."""


def length_m(line: Points) -> float:
    """Return the length of a polyline of (N, 2) points, in metres."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def metres_along(line: Points) -> Floats:
    """Return the (N,) arc lengths at the (N, 2) points of a polyline; 0 for the first."""
    return _metres_along(np.ascontiguousarray(line))


def points_at(line: Points, metres: Floats, stations: Floats) -> Points:
    """Return the (K, 2) points at (K,) rising arc lengths `stations` of a polyline.

    `metres`: (N,) of `metres_along`. Stations before the line give its first point, stations beyond
    it its last.
    """
    return _points_at(np.ascontiguousarray(line), metres, np.ascontiguousarray(stations))


def resample(line: Points, spacing_m: float) -> Points:
    """Return (K, 2) points along a polyline, at most `spacing_m` apart, both ends among them."""
    metres = metres_along(line)
    return points_at(
        line, metres, np.linspace(0.0, metres[-1], max(2, math.ceil(metres[-1] / spacing_m) + 1))
    )


def subdivided(line: Points, spacing_m: float) -> tuple[Points, Indices]:
    """Return (K, 2) points along a polyline of (N, 2) points, evenly on each of its segments and at
    most `spacing_m` apart, and the (N,) indices at which its own points are among them."""
    pieces = np.maximum(np.ceil(np.hypot(*np.diff(line, axis=0).T) / spacing_m), 1)
    corners = np.concatenate([[0], np.cumsum(pieces)]).astype(np.int64)
    numbers = np.arange(corners[-1] + 1)
    return np.column_stack([np.interp(numbers, corners, axis) for axis in line.T]), corners


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
    """Return the (N, 2) rest of a path from its point nearest to the robot on, in the base
    frame."""
    nearest = int(np.argmin(np.hypot(path_map[:, 0] - pose.x_m, path_map[:, 1] - pose.y_m)))
    return pose.from_parent(path_map[nearest:])
