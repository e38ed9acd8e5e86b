"""Pinhole camera model: intrinsics, back-projection (the paper's equations 1 to 3) and
projection."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import inlined
from navcore.geometry.arrays import Floats

Real = float | np.floating[Any]
Pose = npt.NDArray[np.floating[Any]]
REFERENCE_FOCAL_PX = 220.0
"""Focal length in pixels of a D455 at 424 × 240, in whose pixels thresholds are stated."""
NEAREST_M = 1e-6
"""Least depth in metres that a projection divides by."""


class Pinhole(NamedTuple):
    """Focal lengths and principal point of a camera in pixels, as compiled kernels take them."""

    fx: float
    """Focal length along the columns in pixels."""
    fy: float
    """Focal length along the rows in pixels."""
    cx: float
    """Column of the optical axis in pixels."""
    cy: float
    """Row of the optical axis in pixels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """Pinhole camera in pixels; column j and row i as in the paper's equations 1 to 3."""

    width: int
    """Number of columns."""
    height: int
    """Number of rows."""
    fx: float
    """Focal length along the columns in pixels."""
    fy: float
    """Focal length along the rows in pixels."""
    cx: float
    """Column of the optical axis in pixels."""
    cy: float
    """Row of the optical axis in pixels."""

    @property
    def pinhole(self) -> Pinhole:
        """Focal lengths and principal point for compiled kernels."""
        return Pinhole(float(self.fx), float(self.fy), float(self.cx), float(self.cy))

    def length_px(self, reference_px: int) -> int:
        """Return the length in pixels of this camera under the angle that `reference_px` pixels of
        a D455 at 424 × 240 cover; never less than these, for what so few pixels show is noise."""
        return max(reference_px, round(reference_px * self._finer))

    def area_px(self, reference_px: int) -> int:
        """Return the number of pixels of this camera in the solid angle of `reference_px` pixels of
        a D455 at 424 × 240; never less than these."""
        return max(reference_px, round(reference_px * self._finer**2))

    @property
    def _finer(self) -> float:
        return math.sqrt(self.fx * self.fy) / REFERENCE_FOCAL_PX


def back_project(depth_m: npt.NDArray[np.floating], intrinsics: Intrinsics) -> Floats:
    """Return the (N, 3) points of all measured pixels, row by row, in the optical frame (the
    paper's equations 1 to 3).

    X = (j − cx)·Z/fx, Y = (i − cy)·Z/fy, Z = depth of row i, column j in metres. Pixels without a
    finite positive depth are left out.
    """
    rows, cols = np.nonzero(np.isfinite(depth_m) & (depth_m > 0))
    return back_project_pixels(rows, cols, depth_m[rows, cols], intrinsics)


def back_project_pixels(
    rows: npt.NDArray[np.integer],
    cols: npt.NDArray[np.integer],
    depth_m: npt.NDArray[np.floating],
    intrinsics: Intrinsics,
) -> Floats:
    """Return the (..., 3) points of given pixels with a depth in metres, in the optical frame.

    The three arrays broadcast against one another. The equations are those of `back_project`.
    """
    z = np.asarray(depth_m, dtype=np.float64)
    x = (cols - intrinsics.cx) * z / intrinsics.fx
    y = (rows - intrinsics.cy) * z / intrinsics.fy
    return np.stack([x, y, np.broadcast_to(z, x.shape)], axis=-1)


def pixel_rays(
    rows: npt.NDArray[np.number], cols: npt.NDArray[np.number], intrinsics: Intrinsics
) -> Floats:
    """Return the (..., 3) points at depth 1 on the lines of sight of pixels, in the optical frame;
    the two arrays broadcast against each other."""
    x, y = np.broadcast_arrays(
        (cols - intrinsics.cx) / intrinsics.fx, (rows - intrinsics.cy) / intrinsics.fy
    )
    return np.stack([x, y, np.ones(x.shape)], axis=-1)


def project(points_camera: Floats, intrinsics: Intrinsics) -> Floats:
    """Return the (N, 2) columns and rows of (N, 3) points in metres of the optical frame.

    NaN for points that are not ahead of the camera; the pixels may lie outside the image.
    """
    x, y, z = points_camera.T
    depth = np.where(z > 0, np.maximum(z, NEAREST_M), np.nan)
    return np.column_stack(
        [
            intrinsics.fx * x / depth + intrinsics.cx,
            intrinsics.fy * y / depth + intrinsics.cy,
        ]
    )


# For one pixel of a compiled kernel: its line of sight goes through (a, b, 1) in the optical frame.


@inlined
def column_slope(column: int, lens: Pinhole) -> float:
    """Return a = X/Z of a column."""
    return (column - lens.cx) / lens.fx


@inlined
def row_slope(row: int, lens: Pinhole) -> float:
    """Return b = Y/Z of a row."""
    return (row - lens.cy) / lens.fy


@inlined
def ray_direction(t: Pose, a: Real, b: Real) -> tuple[float, float, float]:
    """Return the direction of a line of sight in the frame of `t`, a (4, 4) camera pose, per metre
    of depth."""
    return (
        t[0, 0] * a + t[0, 1] * b + t[0, 2],
        t[1, 0] * a + t[1, 1] * b + t[1, 2],
        t[2, 0] * a + t[2, 1] * b + t[2, 2],
    )


@inlined
def point_on_ray(t: Pose, a: Real, b: Real, depth: Real) -> tuple[float, float, float]:
    """Return the point in metres at a depth on a line of sight, in the frame of `t`, a (4, 4)
    camera pose."""
    dx, dy, dz = ray_direction(t, a, b)
    return dx * depth + t[0, 3], dy * depth + t[1, 3], dz * depth + t[2, 3]
