"""Meshes of uneven ground and of markings on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from sim.models.ground import Ground
from sim.models.mesh import Mesh

CELL_M = 2.0
"""Spacing of the nodes of the ground mesh; between them it is off by millimetres, because its waves
are long."""
Floats = npt.NDArray[np.float64]


def terrain_mesh(ground: Ground, size_m: tuple[float, float]) -> Mesh:
    """Return the ground within ± half of `size_m`, rounded up to whole cells."""
    x, y = (_nodes(side) for side in size_m)
    at = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    return _on_ground(np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 2), ground)


def drape(
    ground: Ground, polygon: Sequence[Sequence[float]] | BaseGeometry, above_m: float
) -> Mesh:
    """Return a polygon, or an area of several, `above_m` above the ground mesh, cut along its
    triangles."""
    area = polygon if isinstance(polygon, BaseGeometry) else shapely.Polygon(polygon)
    x0, y0, x1, y1 = (int(np.floor(side / CELL_M)) for side in area.bounds)
    cells = [(i * CELL_M, j * CELL_M) for i in range(x0, x1 + 1) for j in range(y0, y1 + 1)]
    halves = [((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1))]
    corners, heights = [], []
    for x, y in cells:
        for half in halves:
            nodes = np.array([(x + i * CELL_M, y + j * CELL_M) for i, j in half])
            plane = np.linalg.solve(np.column_stack([nodes, np.ones(3)]), ground.heights(nodes))
            for piece in _triangles(area.intersection(shapely.Polygon(nodes))):
                corners.append(piece)
                heights.append(np.column_stack([piece, np.ones(3)]) @ plane + above_m)
    flat = np.concatenate(corners)
    return Mesh(
        corners=np.column_stack([flat, np.concatenate(heights)]), normals=_normals(flat, ground)
    )


def _triangles(area: BaseGeometry) -> list[Floats]:
    """Return (3, 2) triangles, counter-clockwise, of all parts with an area."""
    parts = [
        part for part in shapely.get_parts(area) if part.geom_type == "Polygon" and part.area > 1e-9
    ]
    pieces = [
        piece for part in parts for piece in shapely.constrained_delaunay_triangles(part).geoms
    ]
    return [
        shapely.get_coordinates(shapely.orient_polygons(piece)).astype(np.float64)[:3]
        for piece in pieces
    ]


def _on_ground(points: Floats, ground: Ground) -> Mesh:
    return Mesh(
        corners=np.column_stack([points, ground.heights(points)]), normals=_normals(points, ground)
    )


def _normals(points: Floats, ground: Ground) -> Floats:
    upright = np.column_stack([-ground.slopes(points), np.ones(len(points))])
    return np.asarray(upright / np.linalg.norm(upright, axis=1, keepdims=True))


def _nodes(side_m: float) -> Floats:
    count = int(np.ceil(side_m / 2 / CELL_M))
    return np.linspace(-count * CELL_M, count * CELL_M, 2 * count + 1)
