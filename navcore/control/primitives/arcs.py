"""The motion primitives, arcs of constant curvature, and how well each of their poses serves a
path."""

from __future__ import annotations

import math
from functools import cache

import numba
import numpy as np
import numpy.typing as npt

from navcore.geometry.polyline import metres_along, points_at

Points = npt.NDArray[np.float64]

ALONG_M = np.concatenate([[0.01, 0.02, 0.03], np.arange(1, 41) * 0.04])
"""Where along an arc the footprint is looked at: close together at first, because there it may be
close to something."""


@cache
def arcs() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """(A,) curvatures in 1/m and (A, S, 3) poses (x, y, heading) along them in the base frame, from
    one step on."""
    spread = np.linspace(-1.0, 1.0, 41)
    curvatures = 3.0 * spread * np.abs(spread)
    along = ALONG_M
    heading = curvatures[:, None] * along[None, :]
    safe = np.where(curvatures == 0, 1.0, curvatures)[:, None]
    x = np.where(curvatures[:, None] == 0, along[None, :], np.sin(heading) / safe)
    y = np.where(curvatures[:, None] == 0, 0.0, (1 - np.cos(heading)) / safe)
    return curvatures, np.stack([x, y, heading], axis=2)


def along(
    path: Points, poses: npt.NDArray[np.float64], lookahead_m: float
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """For each of (A, S, 3) poses: metres gained along the path, metres aside of it, radians askew
    to it; each (A, S)."""
    metres = metres_along(path)
    stations = np.linspace(0.0, min(metres[-1], 1.5 * lookahead_m), 32)
    marks = points_at(path, metres, stations)
    ahead = points_at(path, metres, stations + 0.3) - marks
    # At the path's end there is nothing ahead: the last direction goes on.
    headings = np.arctan2(ahead[:, 1], ahead[:, 0])
    headings[~ahead.any(axis=1)] = headings[ahead.any(axis=1)][-1] if ahead.any() else 0.0
    gained, aside, askew = _beside(marks, headings, poses)
    return stations[gained], aside, askew


@numba.njit(cache=True, nogil=True)
def _beside(
    marks: Points, headings: Points, poses: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """For each of (A, S, 3) poses the nearest of (M, 2) marks, the distance to it and the angle to
    its heading."""
    arcs, steps = poses.shape[0], poses.shape[1]
    nearest, aside, askew = (
        np.empty((arcs, steps), np.int64),
        np.empty((arcs, steps)),
        np.empty((arcs, steps)),
    )
    for a in range(arcs):
        for s in range(steps):
            least, at = np.inf, 0
            for m in range(len(marks)):
                squared = (poses[a, s, 0] - marks[m, 0]) ** 2 + (poses[a, s, 1] - marks[m, 1]) ** 2
                if squared < least:
                    least, at = squared, m
            nearest[a, s], aside[a, s] = at, math.sqrt(least)
            askew[a, s] = abs((poses[a, s, 2] - headings[at] + math.pi) % (2 * math.pi) - math.pi)
    return nearest, aside, askew
