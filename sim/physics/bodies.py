"""Visual and collision shapes of solids, flat polygons and textures in a physics client, for both
renderers."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import shapely

from sim.bullet import pybullet
from sim.models.mesh import MESHES, Mesh, merge_solids
from sim.models.solids import Colour, Solid, quaternion
from sim.models.textures import Texture

MAX_PARTS = 16
"""Largest number of solids that the engine takes for one body."""
NO_SHAPE = -1
"""Handle of an absent collision or visual shape."""
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


def solids_visual(client: int, solids: Sequence[Solid], *, lower_m: float = 0.0) -> int:
    """Return a visual shape of solids, `lower_m` below their position in the frame of their object.

    The meshes have their own normals: those that the EGL renderer generates for boxes are wrong,
    and so is their shading. More solids than one body takes are merged into one mesh for each
    colour.
    """
    if len(solids) > MAX_PARTS:
        return _merged_visual(client, solids, lower_m)
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


def polygon_visual(
    client: int, polygon: Sequence[Sequence[float]], colour: Colour, *, side_m: float = 1.0
) -> int:
    """Return a visual shape of a flat polygon, seen from above; a texture on it repeats after
    `side_m`."""
    return _load_obj(
        _polygon_obj(polygon, side_m),
        lambda path: pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            fileName=path,
            rgbaColor=rgba(colour),
            specularColor=[0, 0, 0],
            physicsClientId=client,
        ),
    )


def square_visual(client: int, size_m: tuple[float, float]) -> int:
    """Return a visual shape of a flat rectangle about the origin; a texture fills it once, its
    upper edge along +y.

    Each call makes a new mesh, because EGL gives all bodies of one mesh the same texture.
    """
    return _load_obj(
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


def mesh_visual(client: int, mesh: Mesh, colour: Colour, *, period_m: float = 0.0) -> int:
    """Return a visual shape of a mesh; a texture on it repeats after `period_m`, 0 for none."""
    return _load_obj(
        mesh.text(period_m),
        lambda path: pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            fileName=path,
            rgbaColor=rgba(colour),
            specularColor=[0, 0, 0],
            physicsClientId=client,
        ),
    )


def mesh_collision(client: int, mesh: Mesh) -> int:
    """Return a collision shape of a static mesh, concave parts included."""
    return _load_obj(
        mesh.text(),
        lambda path: pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            fileName=path,
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=client,
        ),
    )


def load_texture(client: int, texture: Texture) -> int:
    """Return the handle of a texture, which the renderer keeps until the client ends."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "texture.png"
        cv2.imwrite(str(path), cv2.cvtColor(texture, cv2.COLOR_RGB2BGR))
        return int(pybullet.loadTexture(str(path), physicsClientId=client))


def apply_texture(client: int, body: int, texture: int) -> None:
    """Apply a texture to a body of one shape; it is multiplied by the colour of the body."""
    pybullet.changeVisualShape(body, -1, textureUniqueId=texture, physicsClientId=client)


def newest_bodies(client: int, count: int) -> list[int]:
    """Return the last `count` bodies in order of creation."""
    made = pybullet.getNumBodies(physicsClientId=client)
    return [pybullet.getBodyUniqueId(i, physicsClientId=client) for i in range(made - count, made)]


def rgba(colour: Colour) -> list[float]:
    """Return red, green, blue and alpha, 0 to 1."""
    return [level / 255 for level in colour] + [1.0]


def _merged_visual(client: int, solids: Sequence[Solid], lower_m: float) -> int:
    colours = list(dict.fromkeys(solid.colour for solid in solids))
    if len(colours) > MAX_PARTS:
        raise ValueError(
            f"{len(solids)} solids of {len(colours)} colours in one body, "
            f"expected at most {MAX_PARTS} colours"
        )
    with tempfile.TemporaryDirectory() as folder:
        # New names each time avoid the mesh cache.
        paths = [Path(folder) / f"{i}.obj" for i in range(len(colours))]
        for path, colour in zip(paths, colours, strict=True):
            path.write_text(
                merge_solids([solid for solid in solids if solid.colour == colour]).text(),
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


def _load_obj(mesh: str, create: Callable[[str], int]) -> int:
    """Write a mesh to a temporary file and create a shape from it: the EGL renderer takes no mesh
    from memory, and the new name avoids the mesh cache."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.obj"
        path.write_text(mesh, encoding="ascii")
        return int(create(str(path)))


def _polygon_obj(polygon: Sequence[Sequence[float]], side_m: float) -> str:
    """Return a polygon as a flat mesh in OBJ format."""
    triangles = shapely.constrained_delaunay_triangles(shapely.Polygon(polygon)).geoms
    corners = [
        xy
        for triangle in triangles
        for xy in shapely.get_coordinates(shapely.orient_polygons(triangle))[:3]
    ]
    vertices = [f"v {x:.6f} {y:.6f} 0" for x, y in corners]
    texture_rows = [f"vt {x / side_m:.6f} {y / side_m:.6f}" for x, y in corners]
    faces = [f"f {i}/{i}/1 {i + 1}/{i + 1}/1 {i + 2}/{i + 2}/1" for i in range(1, len(corners), 3)]
    return "\n".join([*vertices, *texture_rows, "vn 0 0 1", *faces, ""])
