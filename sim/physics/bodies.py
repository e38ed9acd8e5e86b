"""Collision shapes and bodies in a physics client."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from navcore.geometry.transform import Matrix
from sim.bullet import pybullet
from sim.models.mesh import Mesh

NO_SHAPE = -1
"""Handle of an absent collision or visual shape."""


def mesh_collision(client: int, mesh: Mesh) -> int:
    """Return a collision shape of a static mesh, concave parts included."""
    with tempfile.TemporaryDirectory() as folder:
        # A new name each time avoids the mesh cache.
        path = Path(folder) / "mesh.obj"
        path.write_text(mesh.text(), encoding="ascii")
        return int(
            pybullet.createCollisionShape(
                pybullet.GEOM_MESH,
                fileName=str(path),
                flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
                physicsClientId=client,
            )
        )


def pose_matrix(position: list[float], turn: list[float]) -> Matrix:
    """Return T_map_body of a position and a quaternion x, y, z, w."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.array(pybullet.getMatrixFromQuaternion(turn)).reshape(3, 3)
    matrix[:3, 3] = position
    return matrix


def body_pose(client: int, body: int) -> Matrix:
    """Return T_map_body now."""
    return pose_matrix(*pybullet.getBasePositionAndOrientation(body, physicsClientId=client))
