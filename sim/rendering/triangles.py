"""All triangles of a world in the arrays that the kernels take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Matrix
from sim.models.textures import Texture
from sim.rendering.rasteriser import NOTHING
from sim.rendering.texture_atlas import pack_textures
from sim.rendering.visual import Visual

CELL_M = 4.0
"""Side of the cells of the floor whose triangles form a group: out of view, a group costs no more
than one triangle."""
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Triangles:
    """Triangles of all objects: those of one object in a row, in groups of neighbours. N triangles,
    G groups; lengths in metres."""

    local_corners: Floats
    """(N, 3, 3) corners in the frame of their object."""
    local_normals: Floats
    """(N, 3, 3) unit normals of the corners in the frame of their object."""
    corners: Floats
    """(N, 3, 3) corners in the map."""
    normals: npt.NDArray[np.float32]
    """(N, 3, 3) unit normals in the map."""
    flat: npt.NDArray[np.bool_]
    """(N,) whether the normals of all three corners are the same."""
    colours: npt.NDArray[np.float32]
    """(N, 3) red, green and blue, 0 to 255."""
    texture_of: npt.NDArray[np.int32]
    """(N,) number of the texture, `NOTHING` for none."""
    coordinates: npt.NDArray[np.float32]
    """(N, 3, 2) texture coordinates of the corners."""
    objects: npt.NDArray[np.int32]
    """(N,) number of the object, ascending."""
    groups: npt.NDArray[np.int32]
    """(G, 2) first triangle and the one after the last."""
    spheres: Floats
    """(G, 4) centre and radius around each group, in the map."""
    levels: npt.NDArray[np.int32]
    """(textures, levels, 3) first texel, width and height of each level of the textures."""
    texels: npt.NDArray[np.uint8]
    """(texels, 3) colours of all textures."""
    planes: Floats
    """(N, 3, 3) scratch of the kernels."""

    def place(self, number: int, T_map_object: Matrix) -> None:
        """Put an object at a pose."""
        mine = slice(*np.searchsorted(self.objects, [number, number + 1]))
        turn, shift = T_map_object[:3, :3].T, T_map_object[:3, 3]
        self.corners[mine] = self.local_corners[mine] @ turn + shift
        self.normals[mine] = self.local_normals[mine] @ turn
        for g in np.flatnonzero(
            (self.groups[:, 0] >= mine.start) & (self.groups[:, 0] < mine.stop)
        ):
            points = self.corners[slice(*self.groups[g])].reshape(-1, 3)
            centre = (points.min(axis=0) + points.max(axis=0)) / 2
            self.spheres[g, :3] = centre
            self.spheres[g, 3] = np.linalg.norm(points - centre, axis=1).max()


def pack(objects: Sequence[Sequence[Visual]]) -> Triangles:
    """Return the triangles of objects, which are not placed yet."""
    visuals = [visual for parts in objects for visual in parts]
    counts = [len(visual.mesh.corners) // 3 for visual in visuals]
    corners = _stacked([visual.mesh.corners for visual in visuals])
    number = np.repeat(
        np.arange(len(objects), dtype=np.int32),
        [sum(len(visual.mesh.corners) // 3 for visual in parts) for parts in objects],
    )
    cells = np.floor(corners.mean(axis=1)[:, :2] / CELL_M).astype(np.int64)
    order = np.lexsort((cells[:, 1], cells[:, 0], number))
    groups = _runs(np.column_stack([number, cells])[order])
    normals = _stacked([visual.mesh.normals for visual in visuals])[order]
    textures, texture_of = _distinct(visuals)
    levels, texels = pack_textures(textures)
    return Triangles(
        local_corners=corners[order],
        local_normals=normals,
        corners=np.empty_like(corners),
        normals=np.empty(corners.shape, dtype=np.float32),
        flat=(normals == normals[:, :1]).all(axis=(1, 2)),
        colours=np.repeat(
            np.array([visual.colour for visual in visuals], dtype=np.float32), counts, axis=0
        )[order],
        texture_of=np.repeat(np.array(texture_of, dtype=np.int32), counts)[order],
        coordinates=np.concatenate([_coordinates(visual) for visual in visuals])[order],
        objects=number[order],
        groups=groups,
        spheres=np.empty((len(groups), 4)),
        levels=levels,
        texels=texels,
        planes=np.empty_like(corners),
    )


def _stacked(rows: Sequence[Floats]) -> Floats:
    return np.concatenate(rows).reshape(-1, 3, 3)


def _runs(keys: npt.NDArray[np.int64]) -> npt.NDArray[np.int32]:
    """Return (G, 2) start and end of the runs of equal rows."""
    changes = np.flatnonzero((keys[1:] != keys[:-1]).any(axis=1)) + 1
    bounds = np.concatenate([[0], changes, [len(keys)]])
    return np.column_stack([bounds[:-1], bounds[1:]]).astype(np.int32)


def _distinct(visuals: Sequence[Visual]) -> tuple[list[Texture], list[int]]:
    """Return the textures, each once, and which of them each visual has, `NOTHING` for none."""
    textures = {id(visual.texture): visual.texture for visual in visuals}
    textures.pop(id(None), None)
    number_of = {key: i for i, key in enumerate(textures)}
    return (
        [texture for texture in textures.values() if texture is not None],
        [number_of.get(id(visual.texture), NOTHING) for visual in visuals],
    )


def _coordinates(visual: Visual) -> npt.NDArray[np.float32]:
    """Return (N, 3, 2) texture coordinates, 0 without a texture."""
    if visual.coordinates is None:
        return np.zeros((len(visual.mesh.corners) // 3, 3, 2), dtype=np.float32)
    return visual.coordinates.reshape(-1, 3, 2).astype(np.float32)
