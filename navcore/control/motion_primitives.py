"""The motion primitives, arcs of constant curvature, and how their poses lie to a path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from navcore.compiled import compiled
from navcore.config.control import CONTROL_CONFIG, ArcConfig
from navcore.geometry.arrays import Floats, Indices, Points
from navcore.geometry.polyline import metres_along, points_at

STATIONS = 32
"""Number of points of the path that poses are compared with."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Primitives:
    """Motions that start at the robot, base frame."""

    curvatures_1pm: Floats
    """(A,) curvature of each in 1/m, positive to the left."""
    distances_m: Floats
    """(S,) distance of each pose along its primitive, in metres."""
    poses: Floats
    """(A, S, 3) x, y and heading at these distances."""


@cache
def arcs(config: ArcConfig = CONTROL_CONFIG.arcs) -> Primitives:
    """Return the arcs; their poses are closer together at first, where an obstacle may be close."""
    spread = np.linspace(-1.0, 1.0, config.count)
    curvatures = config.max_curvature_1pm * spread * np.abs(spread)
    distances = np.concatenate([config.first_m, np.arange(1, config.poses + 1) * config.spacing_m])
    heading = curvatures[:, None] * distances[None, :]
    divisor = np.where(curvatures == 0, 1.0, curvatures)[:, None]
    x = np.where(curvatures[:, None] == 0, distances[None, :], np.sin(heading) / divisor)
    y = np.where(curvatures[:, None] == 0, 0.0, (1 - np.cos(heading)) / divisor)
    poses = np.stack([x, y, heading], axis=2)
    return Primitives(curvatures_1pm=curvatures, distances_m=distances, poses=poses)


def errors_to_path(
    path: Points, poses: Floats, *, horizon_m: float, tangent_m: float
) -> tuple[Floats, Floats, Floats]:
    """Return progress in metres, lateral error in metres and heading error in radians, (A, S) each.

    `path` is (N, 2) and `poses` is (A, S, 3), both in the base frame. Poses are compared with the
    first `horizon_m` of the path, whose direction is measured over `tangent_m`.
    """
    metres = metres_along(path)
    stations = np.linspace(0.0, min(metres[-1], horizon_m), STATIONS)
    marks = points_at(path, metres, stations)
    ahead = points_at(path, metres, stations + tangent_m) - marks
    # At the path's end there is nothing ahead: the last direction goes on.
    headings = np.arctan2(ahead[:, 1], ahead[:, 0])
    headings[~ahead.any(axis=1)] = headings[ahead.any(axis=1)][-1] if ahead.any() else 0.0
    nearest, lateral, heading = _nearest_marks(marks, headings, poses)
    return stations[nearest], lateral, heading


@compiled
def _nearest_marks(
    marks: Points, headings: Floats, poses: Floats
) -> tuple[Indices, Floats, Floats]:
    """For each of (A, S, 3) poses the nearest of (M, 2) marks, the distance to it and the angle to
    its heading."""
    count, steps = poses.shape[0], poses.shape[1]
    nearest = np.empty((count, steps), np.int64)
    lateral, heading = np.empty((count, steps)), np.empty((count, steps))
    for a in range(count):
        for s in range(steps):
            least, at = np.inf, 0
            for m in range(len(marks)):
                squared = (poses[a, s, 0] - marks[m, 0]) ** 2 + (poses[a, s, 1] - marks[m, 1]) ** 2
                if squared < least:
                    least, at = squared, m
            nearest[a, s], lateral[a, s] = at, math.sqrt(least)
            heading[a, s] = abs((poses[a, s, 2] - headings[at] + math.pi) % (2 * math.pi) - math.pi)
    return nearest, lateral, heading
