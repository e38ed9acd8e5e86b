"""Everything that a camera can see, and the images of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix
from sim.rendering.light import DAYLIGHT, Light
from sim.rendering.rasteriser import NOTHING, rasterise, shade
from sim.rendering.triangles import Triangles, pack
from sim.rendering.visual import Visual

NEAR_M, FAR_M = 0.1, 30.0
"""Near and far clipping planes."""
SKY = (178.0, 178.0, 204.0)
"""Colour where there is no object."""
NO_OBJECT = -1
"""Object of a pixel that shows none."""
ORIGIN: Matrix = np.eye(4)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Image:
    """An image without camera errors."""

    rgb: npt.NDArray[np.uint8]
    """(H, W, 3) colours."""
    depth_m: npt.NDArray[np.float32]
    """(H, W) depth, that of the far plane where there is no object."""
    shown: npt.NDArray[np.int32]
    """(H, W) triangle, `NOTHING` where there is none."""
    object_of: npt.NDArray[np.int32]
    """(N + 1,) number of the object of each triangle, and `NO_OBJECT` after them."""

    @property
    def objects(self) -> npt.NDArray[np.int32]:
        """(H, W) number of the object, `NO_OBJECT` where there is none."""
        return np.asarray(self.object_of[self.shown])  # NOTHING is the index of the last one


class VisibleWorld:
    """The objects of a world, numbered in the order in which they were added."""

    def __init__(self) -> None:
        self._objects: list[tuple[Visual, ...]] = []
        self._poses: list[Matrix] = []
        self._triangles: Triangles | None = None
        self.changes = 0
        """Number of times that an object was added or moved."""

    def add(self, visuals: Iterable[Visual], T_map_object: Matrix = ORIGIN) -> int:
        """Add an object and return its number."""
        self._objects.append(tuple(visuals))
        self._poses.append(np.array(T_map_object))
        self._triangles = None
        self.changes += 1
        return len(self._objects) - 1

    def place(self, number: int, T_map_object: Matrix) -> None:
        """Move an object."""
        if np.array_equal(self._poses[number], T_map_object):
            return
        self._poses[number] = np.array(T_map_object)
        self.changes += 1
        if self._triangles is not None:
            self._triangles.place(number, T_map_object)

    def image(self, T_map_camera: Matrix, lens: Intrinsics, light: Light = DAYLIGHT) -> Image:
        """Return what a camera sees; its optical frame has z forward and y down."""
        world, shape = self._packed(), (lens.height, lens.width)
        nearest = np.full(shape, 1.0 / FAR_M, dtype=np.float32)
        shown = np.full(shape, NOTHING, dtype=np.int32)
        rasterise(
            world.corners,
            world.groups,
            world.spheres,
            np.linalg.inv(T_map_camera).astype(np.float64),
            np.array([lens.fx, lens.fy, lens.cx, lens.cy], dtype=np.float64),
            (NEAR_M, FAR_M),
            world.planes,
            nearest,
            shown,
        )
        rgb, depth_m = np.empty((*shape, 3), dtype=np.uint8), np.empty(shape, dtype=np.float32)
        toward = np.array(light.from_m) / np.linalg.norm(light.from_m)
        shade(
            shown,
            nearest,
            world.planes,
            world.normals,
            world.flat,
            world.colours,
            world.texture_of,
            world.coordinates,
            world.levels,
            world.texels,
            np.array([*toward, light.ambient, light.diffuse]),
            np.array(SKY),
            rgb,
            depth_m,
        )
        object_of = np.append(world.objects, np.int32(NO_OBJECT))
        return Image(rgb=rgb, depth_m=depth_m, shown=shown, object_of=object_of)

    def _packed(self) -> Triangles:
        if self._triangles is None:
            self._triangles = pack(self._objects)
            for number, pose in enumerate(self._poses):
                self._triangles.place(number, pose)
        return self._triangles
