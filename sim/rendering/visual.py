"""What an object looks like: triangles with normals, colours and textures, in the frame of the
object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from sim.models.mesh import Mesh, merge_solids
from sim.models.solids import Colour, Solid
from sim.models.textures import Texture

Floats = npt.NDArray[np.float64]
WHITE: Colour = (255, 255, 255)
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Visual:
    """Triangles of one colour, counter-clockwise as seen from the front."""

    mesh: Mesh
    """Corners and normals in the frame of the object."""
    colour: Colour
    """Colour, which multiplies that of the texture."""
    texture: Texture | None = None
    """Texture, which repeats; None for none."""
    coordinates: Floats | None = None
    """(3 N, 2) texture coordinates of the corners, (0, 0) at the lower left of the texture."""


def solid_visuals(solids: Sequence[Solid], *, lower_m: float = 0.0) -> tuple[Visual, ...]:
    """Return plain solids, `lower_m` below their position in the frame of their object."""
    return tuple(
        Visual(
            mesh=merge_solids([solid for solid in solids if solid.colour == colour]).lowered(
                lower_m
            ),
            colour=colour,
        )
        for colour in dict.fromkeys(solid.colour for solid in solids)
    )


def patterned(mesh: Mesh, colour: Colour, texture: Texture | None, period_m: float) -> Visual:
    """Return a mesh with a texture that repeats after `period_m`, projected along the nearest
    axis."""
    return Visual(
        mesh=mesh,
        colour=colour,
        texture=texture,
        coordinates=None if texture is None else mesh.texture_coordinates(period_m),
    )


def flat_polygon(
    polygon: Sequence[Sequence[float]] | BaseGeometry,
    colour: Colour,
    texture: Texture | None = None,
    *,
    side_m: float = 1.0,
) -> Visual:
    """Return a flat polygon, or an area of several, seen from above; a texture on it repeats after
    `side_m`."""
    area = polygon if isinstance(polygon, BaseGeometry) else shapely.Polygon(polygon)
    triangles = shapely.constrained_delaunay_triangles(area).geoms
    corners = np.concatenate(
        [shapely.get_coordinates(shapely.orient_polygons(piece))[:3] for piece in triangles]
    )
    return _flat(corners, colour, texture, corners / side_m)


def rectangle(size_m: tuple[float, float], texture: Texture) -> Visual:
    """Return a flat rectangle about the origin, seen from above; the texture fills it once, its
    upper edge along +y."""
    unit = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)], dtype=np.float64)
    return _flat((unit - 0.5) * size_m, WHITE, texture, unit)


def cut_out(size_m: tuple[float, float], texture: Texture, inside: npt.NDArray[np.bool_]) -> Visual:
    """Return the part of such a rectangle where the texture's (H, W) pixels are inside: a strip for
    each run of them in a row. There has to be one."""
    height, width = inside.shape
    change = np.diff(np.pad(inside.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    (rows, begins), (_, ends) = np.nonzero(change == 1), np.nonzero(change == -1)
    left, right = begins / width, ends / width
    low, high = 1 - (rows + 1) / height, 1 - rows / height
    corners = [(left, low), (right, low), (right, high), (left, low), (right, high), (left, high)]
    unit = np.array(corners).transpose(2, 0, 1).reshape(-1, 2)
    return _flat((unit - 0.5) * size_m, WHITE, texture, unit)


def _flat(corners: Floats, colour: Colour, texture: Texture | None, coordinates: Floats) -> Visual:
    mesh = Mesh(
        corners=np.column_stack([corners, np.zeros(len(corners))]),
        normals=np.tile(UP, (len(corners), 1)),
    )
    return Visual(
        mesh=mesh,
        colour=colour,
        texture=texture,
        coordinates=None if texture is None else coordinates,
    )
