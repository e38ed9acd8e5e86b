"""Distance of the oriented footprint to points along motions, compiled."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, finite
from navcore.geometry.arrays import Floats, Points


def footprint_distances(
    obstacles: Points, poses: Floats, half_length: float, half_width: float
) -> Floats:
    """Return (A, S) the least distance in metres from the footprint to any of (N, 2) points on the
    motion up to each of (A, S, 3) poses, at most `FAR_M`."""
    lanes = _lanes(obstacles, poses, math.hypot(half_length, half_width) + FAR_M)
    return _sweep(lanes[0], lanes[1], poses, np.float32(half_length), np.float32(half_width))


FAR_M = 0.5
"""Distance in metres beyond which obstacles make no difference to any motion."""
LANES = 32
"""Number of points that are processed together, as vectors of the processor."""
Lanes = npt.NDArray[np.float32]
"""(B, LANES) one coordinate of the points."""


@compiled
def _lanes(obstacles: Points, poses: Floats, reach: float) -> Lanes:
    """(2, B, LANES) x and y of the points, without those that no pose comes near; single precision
    is good to a micrometre."""
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for a in range(poses.shape[0]):
        for s in range(poses.shape[1]):
            low_x, high_x = min(low_x, poses[a, s, 0]), max(high_x, poses[a, s, 0])
            low_y, high_y = min(low_y, poses[a, s, 1]), max(high_y, poses[a, s, 1])
    lanes, count = np.full((2, -(-len(obstacles) // LANES), LANES), np.float32(1e6)), 0
    for n in range(len(obstacles)):
        x, y = obstacles[n, 0], obstacles[n, 1]
        if low_x - reach <= x <= high_x + reach and low_y - reach <= y <= high_y + reach:
            lanes[0, count // LANES, count % LANES], lanes[1, count // LANES, count % LANES] = x, y
            count += 1
    return lanes[:, : -(-count // LANES)]


@compiled
def _sweep(
    x: Lanes,
    y: Lanes,
    poses: Floats,
    half_length: np.float32,
    half_width: np.float32,
) -> Floats:
    count, steps = poses.shape[0], poses.shape[1]
    distances, nearest = np.empty((count, steps)), np.empty(LANES, dtype=np.float32)
    for a in range(count):
        least = np.float32(FAR_M) ** 2
        for s in range(steps):
            _nearest(x, y, poses[a, s], half_length, half_width, nearest)
            for lane in range(LANES):
                least = min(least, nearest[lane])
            distances[a, s] = math.sqrt(least)
    return distances


@compiled
def contact_slack(
    contacts: Points, kept_m: Floats, poses: Floats, half_length: float, half_width: float
) -> tuple[Floats, Floats]:
    """Return, (A, S) each, by how much in metres the footprint stays farther away than `kept_m`,
    (N,), from (N, 2) points on the motion up to each of (A, S, 3) poses, the least of all, and the
    least distance itself; distances are negative under the footprint."""
    count, steps = poses.shape[0], poses.shape[1]
    slack, distances = np.empty((count, steps)), np.empty((count, steps))
    for a in range(count):
        least_slack, least = math.inf, math.inf
        for s in range(steps):
            cos, sin = math.cos(poses[a, s, 2]), math.sin(poses[a, s, 2])
            for n in range(len(contacts)):
                dx, dy = contacts[n, 0] - poses[a, s, 0], contacts[n, 1] - poses[a, s, 1]
                out_x = abs(cos * dx + sin * dy) - half_length
                out_y = abs(cos * dy - sin * dx) - half_width
                distance = max(out_x, out_y)
                if distance > 0.0:
                    out_x, out_y = max(out_x, 0.0), max(out_y, 0.0)
                    distance = math.sqrt(out_x * out_x + out_y * out_y)
                least = min(least, distance)
                least_slack = min(least_slack, distance - kept_m[n])
            slack[a, s], distances[a, s] = least_slack, least
    return slack, distances


@finite
def _nearest(
    x: Lanes,
    y: Lanes,
    pose: Floats,
    half_length: np.float32,
    half_width: np.float32,
    nearest: Lanes,
) -> None:
    """(LANES,) squared distance from the footprint at a pose to the nearest point of each lane."""
    at_x, at_y, zero = np.float32(pose[0]), np.float32(pose[1]), np.float32(0)
    cos, sin = np.float32(math.cos(pose[2])), np.float32(math.sin(pose[2]))
    for lane in range(LANES):
        nearest[lane] = np.float32(1e9)
    for block in range(x.shape[0]):
        for lane in range(LANES):
            dx, dy = x[block, lane] - at_x, y[block, lane] - at_y
            out_x, out_y = (
                abs(cos * dx + sin * dy) - half_length,
                abs(cos * dy - sin * dx) - half_width,
            )
            out_x = out_x if out_x > zero else zero
            out_y = out_y if out_y > zero else zero
            squared = out_x * out_x + out_y * out_y
            nearest[lane] = squared if squared < nearest[lane] else nearest[lane]
