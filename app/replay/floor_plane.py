"""Detection of the floor plane in a recording whose world frame is not level.

A robot's map has its floor at z = 0; a hand-held camera does not know the floor. The up direction
is first guessed from the upright images, then refined as the normal that most surface patches
share, and finally fitted to the lowest large plane of these patches, because a table is as level
as the floor and often larger.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.replay.recording import Recording
from navcore.errors import BadConfiguration
from navcore.geometry.camera import Intrinsics, back_project_pixels
from navcore.geometry.transform import Matrix, invert, transform_points

Array = npt.NDArray[np.float64]
FRAMES = 20
"""Number of frames that are sampled, spread over the recording."""
STEPS_ACROSS = 80
"""Number of sampled columns per image."""
LONGEST_STEP_M = 0.10
"""Neighbouring points further apart lie on different surfaces."""
WIDEST_RAD = np.radians(50.0)
"""Largest angle between the floor normal and the mean up direction of the images."""
NARROW_RAD = np.radians(8.0)
"""Scatter of the normals of one plane."""
LAYER_M = 0.05
"""Scatter of the points of one plane along its normal."""
LEAST_SHARE = 0.02
"""Smallest share of the upward patches that a floor has."""
LEAST_PATCHES = 100
"""Smallest number of patches that a floor has."""
FURTHEST_M = 4.0
"""Largest depth that is used."""
REFINEMENTS = 5
"""Number of iterations of each refinement."""


def find_floor(recording: Recording) -> Matrix:
    """Return T_map_world (4, 4): z up, floor at 0, x along the first view, origin below the first
    camera position.

    Raises `BadConfiguration` when no frame shows a floor.
    """
    points, normals = _surface(recording)
    up = -recording.T_world_camera[:, :3, 1].mean(axis=0)
    up = _dominant_normal(normals, up / np.linalg.norm(up))
    level = np.flatnonzero(normals @ up > np.cos(NARROW_RAD))
    heights = points[level] @ up
    counts, edges = np.histogram(
        heights,
        bins=np.arange(heights.min(initial=0.0), heights.max(initial=0.0) + 2 * LAYER_M, LAYER_M),
    )
    large = np.flatnonzero(counts >= max(LEAST_SHARE * len(level), LEAST_PATCHES))
    if len(large) == 0:
        raise BadConfiguration(
            f"{recording.folder}: no floor is seen; film it, or say that the poses are level "
            "(--level)"
        )
    lowest = edges[large[0]] + LAYER_M / 2
    plane = points[level[np.abs(heights - lowest) < LAYER_M]]
    for _ in range(REFINEMENTS):
        centre = plane.mean(axis=0)
        normal = np.linalg.svd(plane - centre, full_matrices=False)[2][2]
        up = normal * np.sign(normal @ up)
        off = np.abs((plane - centre) @ up)
        plane = plane[off <= max(2 * float(off.std()), 0.01)]
    return _map_transform(up, float(centre @ up), recording.T_world_camera[0])


def _map_transform(up: Array, floor: float, T_world_camera: Matrix) -> Matrix:
    """Return T_map_world (4, 4) for a floor at the height `floor` along `up`."""
    ahead, above = (
        axis - up * (axis @ up) for axis in (T_world_camera[:3, 2], -T_world_camera[:3, 1])
    )
    if np.linalg.norm(ahead) < 1e-6:  # the camera looks straight down: take the image's up axis
        ahead = above
    ahead = ahead / np.linalg.norm(ahead)
    below = T_world_camera[:3, 3] + up * (floor - T_world_camera[:3, 3] @ up)
    T_world_map = np.eye(4)
    T_world_map[:3] = np.column_stack([ahead, np.cross(up, ahead), up, below])
    return invert(T_world_map)


def _dominant_normal(normals: Array, guess: Array) -> Array:
    """Return the unit direction near a guess that most normals share."""
    near = normals[normals @ guess > np.cos(WIDEST_RAD)]
    if len(near) == 0:
        return guess
    tried = near[:: max(len(near) // 500, 1)]
    best: Array = tried[np.argmax((tried @ near.T > np.cos(NARROW_RAD)).sum(axis=1))]
    for _ in range(REFINEMENTS):
        best = near[near @ best > np.cos(NARROW_RAD)].mean(axis=0)
        best /= np.linalg.norm(best)
    return best


def _surface(recording: Recording) -> tuple[Array, Array]:
    """Return surface points (N, 3) of some frames, world frame, and their unit normals (N, 3),
    towards the camera."""
    points, normals = [], []
    for index in np.unique(np.linspace(0, len(recording) - 1, FRAMES).astype(int)):
        pose = recording.T_world_camera[index]
        patches, facing = _patches(recording.depth_m(int(index)), recording.intrinsics)
        points.append(transform_points(pose, patches))
        normals.append(facing @ pose[:3, :3].T)
    return np.concatenate(points), np.concatenate(normals)


def _patches(depth_m: npt.NDArray[np.float32], lens: Intrinsics) -> tuple[Array, Array]:
    """Return points and unit normals, both (N, 3), in the optical frame."""
    step = max(lens.width // STEPS_ACROSS, 1)
    i, j = (np.arange(0, side, step) for side in depth_m.shape)
    z = depth_m[::step, ::step].astype(np.float64)
    z[z > FURTHEST_M] = 0
    grid = back_project_pixels(i[:, None], j[None, :], z, lens)
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
