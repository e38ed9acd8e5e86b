"""The colour lens of the RealSense D455, which stands beside the depth imager and sees more, and
the registration of its images to depth."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, nested
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix
from sim.sensors.stereo_noise import Depth, Rgb

OFFSET_M = 0.059
"""Distance of the colour lens from the left imager, whose depth it is, towards the right one."""
ACROSS_DEG, NARROW_ACROSS_DEG = 90.0, 79.6
"""Horizontal field of view in images of 16:9, and in those of 4:3, which have fewer columns of the
sensor; pixels are square."""
PARALLAX_PX = 1.0
"""Difference of the parallax of two surfaces, in pixels, from which the nearer one can hide the
farther one."""
UNMEASURED_M = 6.0
"""Distance at which what has no depth is coloured: most of it is beyond the range of the depth."""
T_DEPTH_COLOUR: Matrix = np.array(
    [[1.0, 0.0, 0.0, OFFSET_M], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""Pose of the colour lens in the optical frame of depth."""
F64 = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]
Bools = npt.NDArray[np.bool_]


def colour_intrinsics(size: tuple[int, int], *, narrow: bool) -> Intrinsics:
    """Return the intrinsics of the colour lens at an image size (columns, rows); `narrow` in images
    of 4:3."""
    width, height = size
    across_deg = NARROW_ACROSS_DEG if narrow else ACROSS_DEG
    focal = width / 2 / math.tan(math.radians(across_deg) / 2)
    return Intrinsics(
        width=width, height=height, fx=focal, fy=focal, cx=(width - 1) / 2, cy=(height - 1) / 2
    )


def register_colour(
    colour: Rgb, colour_lens: Intrinsics, depth_m: Depth, lens: Intrinsics
) -> tuple[Rgb, Bools]:
    """Return (H, W, 3) colours for the pixels of a depth image, and (H, W) whether the colour lens
    does not see what a pixel shows, where the colour is black: because it lies beside its image, or
    something nearer hides it."""
    rgb = np.zeros((*depth_m.shape, 3), dtype=np.uint8)
    unseen = np.zeros(depth_m.shape, dtype=np.bool_)
    _register(colour, _numbers(colour_lens), depth_m, _numbers(lens), rgb, unseen)
    return rgb, unseen


def _numbers(lens: Intrinsics) -> F64:
    return np.array([lens.fx, lens.fy, lens.cx, lens.cy], dtype=np.float64)


@compiled
def _register(
    colour: Rgb, colour_lens: F64, depth_m: F32, lens: F64, rgb: Rgb, unseen: Bools
) -> None:
    """Write colours and what is unseen. A depth pixel covers the two by two colour pixels around
    it, so that no gap is left between neighbours."""
    height, width = depth_m.shape
    rows, columns = colour.shape[0], colour.shape[1]
    nearest = np.zeros((rows, columns), dtype=np.float32)  # 1 / z
    for v in range(height):
        for u in range(width):
            z = depth_m[v, u]
            if z > 0.0:
                x, y = _in_colour(u, v, float(z), lens, colour_lens)
                i0, j0 = math.floor(y), math.floor(x)
                for i in range(max(i0, 0), min(i0 + 2, rows)):
                    for j in range(max(j0, 0), min(j0 + 2, columns)):
                        nearest[i, j] = max(nearest[i, j], np.float32(1.0) / z)
    for v in range(height):
        for u in range(width):
            measured = depth_m[v, u] > 0.0
            z = float(depth_m[v, u]) if measured else UNMEASURED_M
            x, y = _in_colour(u, v, z, lens, colour_lens)
            if x < -0.5 or y < -0.5 or x >= columns - 0.5 or y >= rows - 0.5:
                unseen[v, u] = True
                continue
            nearer = nearest[math.floor(y + 0.5), math.floor(x + 0.5)] - 1.0 / z
            if colour_lens[0] * OFFSET_M * nearer > PARALLAX_PX:
                unseen[v, u] = True
                continue
            j, i = max(min(x, columns - 1.0), 0.0), max(min(y, rows - 1.0), 0.0)
            j0, i0 = min(int(j), columns - 2), min(int(i), rows - 2)
            right, lower = j - j0, i - i0
            for k in range(3):
                upper_level = (1.0 - right) * colour[i0, j0, k] + right * colour[i0, j0 + 1, k]
                lower_level = (1.0 - right) * colour[i0 + 1, j0, k] + right * colour[
                    i0 + 1, j0 + 1, k
                ]
                level = (1.0 - lower) * upper_level + lower * lower_level
                rgb[v, u, k] = np.uint8(level + 0.5)


@nested
def _in_colour(u: int, v: int, z: float, lens: F64, colour_lens: F64) -> tuple[float, float]:
    """Return column and row in the colour image of a depth pixel at a depth."""
    x = (u - lens[2]) / lens[0] - OFFSET_M / z
    y = (v - lens[3]) / lens[1]
    return colour_lens[0] * x + colour_lens[2], colour_lens[1] * y + colour_lens[3]
