"""Triangle meshes: solids as one mesh, and the ground; in Wavefront's OBJ format for the physics
engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from sim.bullet import pybullet
from sim.models.solids import Solid, quaternion

Floats = npt.NDArray[np.float64]
MESHES = {
    kind: Path(__file__).parent / "meshes" / f"{mesh}.obj"
    for kind, mesh in (
        ("box", "cube"),
        ("cylinder", "cylinder"),
        ("cone", "cone"),
        ("ball", "ball"),
    )
}
"""Mesh files of side 1 about the origin, by kind of solid."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """Triangles that share no corners."""

    corners: Floats
    """(3 N, 3) corners in metres."""
    normals: Floats
    """(3 N, 3) unit normals of the corners."""

    def text(self) -> str:
        """Return the mesh in OBJ format, for the physics engine."""
        lines = [_rows("v %.4f %.4f %.4f", self.corners), _rows("vn %.4f %.4f %.4f", self.normals)]
        numbers = [f"{i}//{i}" for i in range(1, len(self.corners) + 1)]
        faces = zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True)
        return "\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in faces), ""])

    def lowered(self, by_m: float) -> Mesh:
        """Return the mesh, shifted downwards."""
        return replace(self, corners=self.corners - (0.0, 0.0, by_m)) if by_m else self

    def texture_coordinates(self, period_m: float) -> Floats:
        """Return (3 N, 2) texture coordinates of each corner for a texture that repeats after
        `period_m`, across the axis that its triangle faces most."""
        faces = np.abs(self.normals.reshape(-1, 3, 3).mean(axis=1)).argmax(axis=1)
        across = np.array([[1, 2], [0, 2], [0, 1]])[np.repeat(faces, 3)]
        return np.take_along_axis(self.corners, across, axis=1) / period_m


def merge_solids(solids: Sequence[Solid], *, coarse: bool = False) -> Mesh:
    """Return solids as one mesh in the frame of their object; `coarse` gives round solids fewer
    faces."""
    corners, normals = [], []
    for solid in solids:
        points, shading = _coarse_mesh(solid.kind) if coarse else _unit_mesh(solid.kind)
        turn = np.array(
            pybullet.getMatrixFromQuaternion(quaternion(solid.yaw_rad, solid.pitch_rad))
        ).reshape(3, 3)
        corners.append((points * solid.size_m) @ turn.T + solid.centre_m)
        shading = shading / np.maximum(solid.size_m, 1e-9)
        normals.append((shading / np.linalg.norm(shading, axis=1, keepdims=True)) @ turn.T)
    return Mesh(corners=np.concatenate(corners), normals=np.concatenate(normals))


@cache
def _unit_mesh(kind: str) -> tuple[Floats, Floats]:
    """Return the (3 N, 3) corners and normals of one of the files, its faces as triangles."""
    lines = [line.split() for line in MESHES[kind].read_text(encoding="ascii").splitlines()]
    vertices = np.array([line[1:] for line in lines if line[:1] == ["v"]], dtype=np.float64)
    normals = np.array([line[1:] for line in lines if line[:1] == ["vn"]], dtype=np.float64)
    faces = [[corner.split("/") for corner in line[1:]] for line in lines if line[:1] == ["f"]]
    fans = [(face[0], face[i], face[i + 1]) for face in faces for i in range(1, len(face) - 1)]
    return tuple(  # type: ignore[return-value]
        array[[int(corner[part]) - 1 for fan in fans for corner in fan]]
        for array, part in ((vertices, 0), (normals, -1))
    )


COARSE_SIDES = 7
"""Number of sides of a coarse cylinder or cone."""
CONE_TOP_SHARE = 0.4
"""Upper diameter of a cone as a share of its lower diameter."""


@cache
def _coarse_mesh(kind: str) -> tuple[Floats, Floats]:
    """Return corners and normals with few faces: open below, because solids stand on something."""
    if kind == "box":
        return _unit_mesh(kind)
    if kind == "ball":
        return _revolved([(0.0, -0.5), (0.43, -0.25), (0.43, 0.25), (0.0, 0.5)])
    top = 0.5 * (CONE_TOP_SHARE if kind == "cone" else 1.0)
    return _revolved([(0.5, -0.5), (top, 0.5), (0.0, 0.5)])


def _revolved(profile: Sequence[tuple[float, float]]) -> tuple[Floats, Floats]:
    """Return the surface of revolution of a polyline (radius, z) about z, shaded face by face."""
    angles = np.arange(COARSE_SIDES + 1) * 2 * np.pi / COARSE_SIDES
    round_, corners = np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)]), []
    for (r0, z0), (r1, z1) in pairwise(profile):
        low, high = r0 * round_ + (0, 0, z0), r1 * round_ + (0, 0, z1)
        for i in range(COARSE_SIDES):
            triangles = [(low[i], low[i + 1], high[i + 1]), (low[i], high[i + 1], high[i])]
            corners += [
                t for t in triangles if np.linalg.norm(np.cross(t[1] - t[0], t[2] - t[0])) > 1e-9
            ]
    points = np.array(corners)
    flat = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    flat = np.repeat(flat / np.linalg.norm(flat, axis=1, keepdims=True), 3, axis=0)
    return points.reshape(-1, 3), flat


def _rows(form: str, rows: Floats) -> str:
    return "\n".join([form] * len(rows)) % tuple(rows.ravel().tolist())
