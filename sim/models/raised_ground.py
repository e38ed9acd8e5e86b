"""Raised parts of a flat floor: ramps, platforms, kerbs, stairs, beds of gravel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Pose2
from navcore.toml_config import ranged
from sim.models.mesh import Mesh
from sim.models.solids import FARTHEST_M, Polygon, rectangle

Floats = npt.NDArray[np.float64]
BUMP_M = 0.1
"""Distance between two nodes of bumpy ground."""
BUMP_NODES = 64
"""Number of nodes after which the bumps repeat."""
FOUNDATION_M = 0.05
"""Depth below the floor to which the sides reach."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RaisedGround:
    """A rectangle of raised ground with upright sides: a ramp, a platform, a kerb, a step of a
    stair, a bed of gravel."""

    at: tuple[float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Position of the middle, x and y in metres."""
    size_m: tuple[float, float] = ranged(0.05, 100.0)
    """Length, along which it may rise, and width."""
    height_m: tuple[float, float] = ranged(0.0, 5.0)
    """Height above the floor at its beginning and at its end."""
    yaw_deg: float = ranged(-360.0, 360.0, default=0.0)
    """Direction from its beginning to its end, counter-clockwise from x of the map."""
    bumps_m: float = ranged(0.0, 0.2, default=0.0)
    """Height of the highest bump, of which there is one every 10 cm; 0 for a smooth surface."""
    colour: tuple[int, int, int] = ranged(0, 255, default=(150, 148, 142))
    """Colour: red, green, blue."""

    @property
    def pose(self) -> Pose2:
        """T_map_part of the middle."""
        return Pose2(x_m=self.at[0], y_m=self.at[1], yaw_rad=math.radians(self.yaw_deg))

    def outline(self) -> Polygon:
        """Return the (4, 2) corners in metres of the map frame, counter-clockwise."""
        return self.pose.to_parent(rectangle(*self.size_m))

    def covers(self, points: Floats) -> npt.NDArray[np.bool_]:
        """Return (N,) whether (N, 2) points in metres of its own frame are on it."""
        return np.asarray((np.abs(points) <= np.array(self.size_m) / 2).all(axis=1))

    def heights(self, points: Floats) -> Floats:
        """Return (N,) heights in metres above the floor at (N, 2) points of its own frame."""
        along = np.clip(points[:, 0] / self.size_m[0] + 0.5, 0.0, 1.0)
        smooth: Floats = (1 - along) * self.height_m[0] + along * self.height_m[1]
        return smooth + self.bumps_m * _bump_shares(points) if self.bumps_m else smooth

    def mesh(self) -> Mesh:
        """Return the top and the four sides in the map frame."""
        x, y = (self._nodes(side) for side in self.size_m)
        at = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        heights = self.heights(at.reshape(-1, 2)).reshape(*at.shape[:2], 1)
        top = np.concatenate([at, heights], axis=2)
        surfaces = [top]
        for edge in (top[::-1, 0], top[-1, ::-1], top[:, -1], top[0]):
            foot = np.column_stack([edge[:, :2], np.full(len(edge), -FOUNDATION_M)])
            surfaces.append(np.stack([edge, foot], axis=1))
        corners = np.concatenate([_triangles(surface) for surface in surfaces])
        corners[:, :2] = self.pose.to_parent(corners[:, :2])
        a, b, c = corners.reshape(-1, 3, 3).transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return Mesh(corners=corners, normals=np.repeat(normals, 3, axis=0))

    def _nodes(self, side_m: float) -> Floats:
        if not self.bumps_m:
            return np.array([-side_m / 2, side_m / 2])
        last = math.floor(side_m / 2 / BUMP_M)
        return np.unique([-side_m / 2, *(BUMP_M * np.arange(-last, last + 1)), side_m / 2])


def _triangles(nodes: Floats) -> Floats:
    """Return the (3 N, 3) corners of the two triangles in each mesh of (rows, cols, 3) nodes."""
    a, b, c, d = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3)


def _bump_shares(points: Floats) -> Floats:
    """Return (N,) heights from 0 to 1 of a random surface of triangles over nodes every `BUMP_M`,
    at (N, 2) points."""
    nodes = np.random.default_rng(0).random((BUMP_NODES, BUMP_NODES))
    low = np.floor(points / BUMP_M).astype(np.int64)
    u, v = (points / BUMP_M - low).T
    rows, cols = low.T % BUMP_NODES
    after_row, after_col = (rows + 1) % BUMP_NODES, (cols + 1) % BUMP_NODES
    here, across = nodes[rows, cols], nodes[after_row, after_col]
    # The diagonal of a cell leads from its lowest corner to its highest, as in the mesh.
    beside = np.where(u >= v, nodes[after_row, cols], nodes[rows, after_col])
    more, less = np.maximum(u, v), np.minimum(u, v)
    return np.asarray(here + more * (beside - here) + less * (across - beside))
