"""Meshes and lines of the scene."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Polygon

Floats = npt.NDArray[np.float64]
Faces = npt.NDArray[np.uint32]
DECIMALS = 9
"""Decimals of a metre that the corners of a polygon are rounded to."""


def triangulate(corners: Floats, z: float) -> tuple[Floats, Faces]:
    """Return vertices (3 M, 3) and faces (M, 3) of a simple polygon (N, 2) at a height."""
    # GEOS fails for corners that differ by less than its arithmetic resolves.
    triangles = shapely.constrained_delaunay_triangles(Polygon(corners.round(DECIMALS)))
    # Each triangle is a ring of four points, the last of which repeats the first.
    points = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    faces = np.arange(len(points), dtype=np.uint32).reshape(-1, 3)
    return np.column_stack([points, np.full(len(points), z)]), faces


def closed_ring(corners: Floats) -> Floats:
    """Return a ring (N, 2) with its first corner repeated at the end."""
    return np.vstack([corners, corners[:1]])


def polyline_segments(points: Floats, z: float) -> npt.NDArray[np.float32]:
    """Return the segments (N − 1, 2, 3) of a polyline (N, 2) at a height."""
    lifted = np.column_stack([points, np.full(len(points), z)]).astype(np.float32)
    return np.stack([lifted[:-1], lifted[1:]], axis=1)


@cache
def flag_mesh() -> tuple[Floats, Faces]:
    """Return vertices and faces of a flag: a pole of 1 m at the origin, with pennant and foot."""
    pole = [(-0.02, 0.0, 0.0), (0.02, 0.0, 0.0), (0.02, 0.0, 1.0), (-0.02, 0.0, 1.0)]
    cross = [(0.0, -0.02, 0.0), (0.0, 0.02, 0.0), (0.0, 0.02, 1.0), (0.0, -0.02, 1.0)]
    pennant = [(0.02, 0.0, 1.0), (0.02, 0.0, 0.66), (0.5, 0.0, 0.83)]
    foot = [
        (0.22 * np.cos(a), 0.22 * np.sin(a), 0.06)
        for a in np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ]
    vertices = np.array([*pole, *cross, *pennant, *foot])
    disc = [(11, 11 + i, 12 + i) for i in range(1, 11)]
    faces = [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7), (8, 9, 10), *disc]
    return vertices, np.array(faces, dtype=np.uint32)


@cache
def handle_mesh() -> tuple[Floats, Faces]:
    """Return vertices and faces of an octahedron, the handle of a corner."""
    vertices = np.array(
        [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float64
    )
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    return vertices, np.array(faces, dtype=np.uint32)
