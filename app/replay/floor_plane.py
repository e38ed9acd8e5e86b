"""Where the floor is in a recording whose world frame is not level: the lowest large plane beneath
the camera.

A robot's map has its floor at z = 0. A camera carried by hand knows none; the way up is first
guessed from the pictures' own (nobody films standing on his head), then found as the direction in
which most small pieces of surface face, and at last measured at the lowest plane of these, for a
table is as level as the floor and often larger.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.replay.recording import Recording
from navcore.errors import BadConfiguration
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix, invert, transform_points

Array = npt.NDArray[np.float64]
FRAMES = 20
"""So many are looked at."""
STEPS_ACROSS = 80
"""A picture is looked at in so many steps."""
LONGEST_STEP_M = 0.10
"""Neighbouring measurements further apart lie on different things."""
WIDEST_RAD = np.radians(50.0)
"""The way up is within this of the pictures' mean one."""
NARROW_RAD = np.radians(8.0)
"""So far the normals of one plane scatter."""
LAYER_M = 0.05
"""And so far its points."""
LEAST_SHARE = 0.02
"""A floor has at least this share of the pieces of surface that look up."""
LEAST_PIECES = 100
FURTHEST_M = 4.0


def find_floor(recording: Recording) -> Matrix:
    """(4, 4) T_map_world: z up, floor at 0, x where the camera first looks, origin beneath where it
    first was.

    Raises `BadConfiguration` when no frame shows a floor.
    """
    points, normals = _surface(recording)
    up = -recording.T_world_camera[:, :3, 1].mean(axis=0)
    up = _facing(normals, up / np.linalg.norm(up))
    level = np.flatnonzero(normals @ up > np.cos(NARROW_RAD))
    heights = points[level] @ up
    counts, edges = np.histogram(
        heights,
        bins=np.arange(heights.min(initial=0.0), heights.max(initial=0.0) + 2 * LAYER_M, LAYER_M),
    )
    large = np.flatnonzero(counts >= max(LEAST_SHARE * len(level), LEAST_PIECES))
    if len(large) == 0:
        raise BadConfiguration(
            f"{recording.folder}: no floor is seen; film it, or say that the poses are level (--level)"
        )
    lowest = edges[large[0]] + LAYER_M / 2
    plane = points[level[np.abs(heights - lowest) < LAYER_M]]
    for _ in range(5):
        centre = plane.mean(axis=0)
        normal = np.linalg.svd(plane - centre, full_matrices=False)[2][2]
        up = normal * np.sign(normal @ up)
        off = np.abs((plane - centre) @ up)
        plane = plane[off <= max(2 * float(off.std()), 0.01)]
    return _standing_on(up, float(centre @ up), recording.T_world_camera[0])


def _standing_on(up: Array, floor: float, T_world_camera: Matrix) -> Matrix:
    ahead, above = (
        axis - up * (axis @ up) for axis in (T_world_camera[:3, 2], -T_world_camera[:3, 1])
    )
    if np.linalg.norm(ahead) < 1e-6:  # it looks straight down: along the picture's upper edge then
        ahead = above
    ahead = ahead / np.linalg.norm(ahead)
    below = T_world_camera[:3, 3] + up * (floor - T_world_camera[:3, 3] @ up)
    T_world_map = np.eye(4)
    T_world_map[:3] = np.column_stack([ahead, np.cross(up, ahead), up, below])
    return invert(T_world_map)


def _facing(normals: Array, guess: Array) -> Array:
    """The direction near a guess in which most pieces of surface face."""
    near = normals[normals @ guess > np.cos(WIDEST_RAD)]
    if len(near) == 0:
        return guess
    tried = near[:: max(len(near) // 500, 1)]
    best: Array = tried[np.argmax((tried @ near.T > np.cos(NARROW_RAD)).sum(axis=1))]
    for _ in range(5):
        best = near[near @ best > np.cos(NARROW_RAD)].mean(axis=0)
        best /= np.linalg.norm(best)
    return best


def _surface(recording: Recording) -> tuple[Array, Array]:
    """(N, 3) points of the world on what some frames show, and (N, 3) normals there, towards the
    camera."""
    points, normals = [], []
    for index in np.unique(np.linspace(0, len(recording) - 1, FRAMES).astype(int)):
        pose = recording.T_world_camera[index]
        here, facing = _pieces(recording.depth_m(int(index)), recording.intrinsics)
        points.append(transform_points(pose, here))
        normals.append(facing @ pose[:3, :3].T)
    return np.concatenate(points), np.concatenate(normals)


def _pieces(depth_m: npt.NDArray[np.float32], lens: Intrinsics) -> tuple[Array, Array]:
    """(N, 3) points and normals in the camera's frame."""
    step = max(lens.width // STEPS_ACROSS, 1)
    i, j = (np.arange(0, side, step) for side in depth_m.shape)
    z = depth_m[::step, ::step].astype(np.float64)
    z[z > FURTHEST_M] = 0
    grid = np.dstack(
        [(j[None, :] - lens.cx) * z / lens.fx, (i[:, None] - lens.cy) * z / lens.fy, z]
    )
    here, right, down = (
        grid[:-1, :-1],
        grid[:-1, 1:] - grid[:-1, :-1],
        grid[1:, :-1] - grid[:-1, :-1],
    )
    measured = (z[:-1, :-1] > 0) & (z[:-1, 1:] > 0) & (z[1:, :-1] > 0)
    whole = (
        measured
        & (np.linalg.norm(right, axis=2) < LONGEST_STEP_M)
        & (np.linalg.norm(down, axis=2) < LONGEST_STEP_M)
    )
    normals = np.cross(down[whole], right[whole])
    lengths = np.linalg.norm(normals, axis=1)
    solid = lengths > 0
    return here[whole][solid], normals[solid] / lengths[solid, None]
