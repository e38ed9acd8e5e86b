"""Makes solids, flat patches and pictures visible in a physics client, for both renderers."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import pybullet
import shapely

from sim.models.mesh import MESHES, Mesh, merged
from sim.models.solids import Colour, Solid, quaternion
from sim.models.textures import Texture

PARTS = 16
"""The engine takes at most so many solids for one body."""
NO_SHAPE = -1
_SQUARE = """
v -0.5 -0.5 0
v 0.5 -0.5 0
v 0.5 0.5 0
v -0.5 0.5 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/1/1 3/3/1 4/4/1
"""


def show_solids(client: int, solids: Sequence[Solid], *, lower_m: float = 0.0) -> int:
    """A visual shape of solids, `lower_m` below where they are in the frame of their thing.

    As meshes with normals of their own: those that the EGL renderer makes up for boxes are wrong,
    and so is their light. More solids than one body takes become one mesh for each colour.
    """
    if len(solids) > PARTS:
        return _show_merged(client, solids, lower_m)
    return int(
        pybullet.createVisualShapeArray(
            shapeTypes=[pybullet.GEOM_MESH for _ in solids],
            fileNames=[str(MESHES[solid.kind]) for solid in solids],
            meshScales=[list(solid.size_m) for solid in solids],
            rgbaColors=[rgba(solid.colour) for solid in solids],
            visualFramePositions=[
                (x, y, z - lower_m) for x, y, z in (solid.centre_m for solid in solids)
            ],
            visualFrameOrientations=[
                quaternion(solid.yaw_rad, solid.pitch_rad) for solid in solids
            ],
            physicsClientId=client,
        )
    )


def show_patch(
    client: int, polygon: Sequence[Sequence[float]], colour: Colour, *, side_m: float = 1.0
) -> int:
    """A visual shape of a flat polygon, seen from above; a texture on it repeats after `side_m`."""
    return _from_text(
        _patch(polygon, side_m),
        lambda path: pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            fileName=path,
            rgbaColor=rgba(colour),
            specularColor=[0, 0, 0],
            physicsClientId=client,
        ),
    )


def show_square(client: int, size_m: tuple[float, float]) -> int:
    """A visual shape of a flat rectangle about the origin; a texture fills it once, the right way
    up along y.

    A mesh of its own each time, because EGL gives all bodies of one mesh the same texture.
    """
    return _from_text(
        _SQUARE,
        lambda path: pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            fileName=path,
            meshScale=[*size_m, 1.0],
            rgbaColor=[1, 1, 1, 1],
            specularColor=[0, 0, 0],
            physicsClientId=client,
        ),
    )


def show_mesh(client: int, mesh: Mesh, colour: Colour, *, repeats_m: float = 0.0) -> int:
    """A visual shape of a mesh; a texture on it repeats after `repeats_m`, 0 for none."""
    return _from_text(
        mesh.text(repeats_m),
        lambda path: pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            fileName=path,
            rgbaColor=rgba(colour),
            specularColor=[0, 0, 0],
            physicsClientId=client,
        ),
    )


def solid_mesh(client: int, mesh: Mesh) -> int:
    """A collision shape of a mesh that never moves, as it is, hollows and all."""
    return _from_text(
        mesh.text(),
        lambda path: pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            fileName=path,
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=client,
        ),
    )


def load_texture(client: int, texture: Texture) -> int:
    """A texture's handle. The renderer keeps it until the client ends."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "texture.png"
        cv2.imwrite(str(path), cv2.cvtColor(texture, cv2.COLOR_RGB2BGR))
        return int(pybullet.loadTexture(str(path), physicsClientId=client))


def put_texture(client: int, body: int, texture: int) -> None:
    """Give a body of one shape a texture, which is multiplied by its colour."""
    pybullet.changeVisualShape(body, -1, textureUniqueId=texture, physicsClientId=client)


def newest_bodies(client: int, count: int) -> list[int]:
    """The last so many that were made, in their order."""
    made = pybullet.getNumBodies(physicsClientId=client)
    return [pybullet.getBodyUniqueId(i, physicsClientId=client) for i in range(made - count, made)]


def rgba(colour: Colour) -> list[float]:
    """As the engine wants it."""
    return [level / 255 for level in colour] + [1.0]


def _show_merged(client: int, solids: Sequence[Solid], lower_m: float) -> int:
    colours = list(dict.fromkeys(solid.colour for solid in solids))
    if len(colours) > PARTS:
        raise ValueError(
            f"{len(solids)} solids of {len(colours)} colours in one body, expected at most {PARTS} colours"
        )
    with tempfile.TemporaryDirectory() as folder:
        # The names are new each time, because meshes are cached.
        paths = [Path(folder) / f"{i}.obj" for i in range(len(colours))]
        for path, colour in zip(paths, colours, strict=True):
            path.write_text(
                merged([solid for solid in solids if solid.colour == colour]).text(),
                encoding="ascii",
            )
        return int(
            pybullet.createVisualShapeArray(
                shapeTypes=[pybullet.GEOM_MESH for _ in colours],
                fileNames=[str(path) for path in paths],
                meshScales=[[1.0, 1.0, 1.0] for _ in colours],
                rgbaColors=[rgba(colour) for colour in colours],
                visualFramePositions=[(0.0, 0.0, -lower_m) for _ in colours],
                visualFrameOrientations=[[0.0, 0.0, 0.0, 1.0] for _ in colours],
                physicsClientId=client,
            )
        )


def _from_text(mesh: str, show: Callable[[str], int]) -> int:
    """As a file, because the EGL renderer takes no mesh from memory; its name is new each time,
    because meshes are cached."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.obj"
        path.write_text(mesh, encoding="ascii")
        return int(show(str(path)))


def _patch(polygon: Sequence[Sequence[float]], side_m: float) -> str:
    """A polygon as a flat mesh in Wavefront's OBJ format."""
    triangles = shapely.constrained_delaunay_triangles(shapely.Polygon(polygon)).geoms
    corners = [
        xy
        for triangle in triangles
        for xy in shapely.get_coordinates(shapely.orient_polygons(triangle))[:3]
    ]
    vertices = [f"v {x:.6f} {y:.6f} 0" for x, y in corners]
    spots = [f"vt {x / side_m:.6f} {y / side_m:.6f}" for x, y in corners]
    faces = [f"f {i}/{i}/1 {i + 1}/{i + 1}/1 {i + 2}/{i + 2}/1" for i in range(1, len(corners), 3)]
    return "\n".join([*vertices, *spots, "vn 0 0 1", *faces, ""])
