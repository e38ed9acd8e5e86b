"""Voxels that a depth image measures: a grid cell × 5 cm of height above the ground.

The image is processed row by row. The voxels of a row are computed in vectors; then only pixels
with another voxel than the pixel before them are visited, about every sixth. So most of the time
goes into arithmetic on data in the cache.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined, nested
from navcore.geometry.arrays import FloatImage, Points
from navcore.geometry.camera import Intrinsics
from navcore.grid.bitplane import ONE
from navcore.grid.grid import Box, GridSpec
from navcore.grid.runs import WORD, run_starts
from navcore.perception.ground import flat_ground
from navcore.robot.frame import Frame

HEIGHT_BINS = 64
"""Number of height bins, the bits of a word."""
BIN_M = 0.05
"""Height of a bin in metres."""
LOWEST_M = -0.425
"""Lower end of the bins in metres; the upper one is 2.775 m. The floor is in the middle of a bin,
not on the border of two."""
_FLOOR_BIN = 8
"""Height bin of the ground."""

Pixels = npt.NDArray[np.int32]
"""(N,) pixels, row · width + column."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DepthView:
    """Depth image with the part of the grid that it can measure."""

    depth_m: FloatImage
    """(H, W) measured depth in metres; 0 for none."""
    ground_m: FloatImage
    """(H, W), or (1, W) for all rows alike: height in metres of the ground below each pixel above
    the plane on which the robot stands."""
    affine: npt.NDArray[np.float32]
    """(3, 4) transform from the optical frame to columns and rows of the box and height in
    metres."""
    across: npt.NDArray[np.float32]
    """(W,) slope x/z of each column of the image."""
    down: npt.NDArray[np.float32]
    """(H,) slope y/z of each row of the image."""
    box: Box
    """Part of the grid that the camera can measure."""
    max_range_m: float
    """Largest depth in metres that counts."""

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns of the box; 0 for an empty one."""
        return max(self.box[2] - self.box[0], 0), max(self.box[3] - self.box[1], 0)


def frustum_box(frame: Frame, spec: GridSpec, max_range_m: float) -> Box:
    """Return the part of the grid that the camera can measure; it may be empty."""
    top, left, bottom, right = frustum_cells(frame, spec, max_range_m)
    return max(top, 0), max(left, 0), min(bottom, spec.rows), min(right, spec.cols)


def frustum_cells(frame: Frame, spec: GridSpec, max_range_m: float) -> Box:
    """Return the cells that the camera can measure, on the grid or not."""
    camera = frame.T_map_camera
    points = _frustum_corners(frame.intrinsics, max_range_m) @ camera[:3, :3].T + camera[:3, 3]
    (left_m, low_m), (right_m, high_m) = (
        points[:, :2].min(axis=0).tolist(),
        points[:, :2].max(axis=0).tolist(),
    )
    (top, left), (bottom, right) = spec.cell(left_m, low_m), spec.cell(right_m, high_m)
    return top, left, bottom + 1, right + 1


@lru_cache(maxsize=4)
def _frustum_corners(lens: Intrinsics, max_range_m: float) -> Points:
    """Return the (5, 3) camera, and the corners of the image at a depth, in the optical frame."""
    a = np.array([-lens.cx, lens.width - 1 - lens.cx]) / lens.fx
    b = np.array([-lens.cy, lens.height - 1 - lens.cy]) / lens.fy
    return max_range_m * np.array([[0, 0, 0], *([x, y, 1] for x in a for y in b)])


@lru_cache(maxsize=4)
def _slopes(lens: Intrinsics) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return the slopes x/z of the (W,) columns and y/z of the (H,) rows, read-only."""
    across = ((np.arange(lens.width) - lens.cx) / lens.fx).astype(np.float32)
    down = ((np.arange(lens.height) - lens.cy) / lens.fy).astype(np.float32)
    across.flags.writeable = down.flags.writeable = False
    return across, down


def depth_view(
    frame: Frame, spec: GridSpec, max_range_m: float, ground_m: FloatImage | None = None
) -> DepthView:
    """Return the frame's depth with its part of the grid; without `ground_m` the ground is the
    plane on which the robot stands."""
    lens, t, box = frame.intrinsics, frame.T_map_camera, frustum_box(frame, spec, max_range_m)
    cells = 1.0 / spec.resolution_m
    affine = t[:3].copy()
    affine[:2, 3] -= (
        spec.origin_x_m + box[1] * spec.resolution_m,
        spec.origin_y_m + box[0] * spec.resolution_m,
    )
    affine[:2] *= cells
    across, down = _slopes(lens)
    return DepthView(
        depth_m=frame.depth_m,
        ground_m=flat_ground(lens.width) if ground_m is None else ground_m,
        affine=affine.astype(np.float32),
        across=across,
        down=down,
        box=box,
        max_range_m=max_range_m,
    )


class _Scratch(threading.local):
    """Counters for the voxels of a box, all 0 between two uses: clearing the used ones is faster
    than allocating new memory."""

    def __init__(self) -> None:
        self.counts: npt.NDArray[np.uint8] = np.zeros(0, dtype=np.uint8)

    def counters(self, size: int) -> npt.NDArray[np.uint8]:
        if len(self.counts) < size:
            self.counts = np.zeros(size, dtype=np.uint8)
        return self.counts[:size]


_scratch = _Scratch()


def measured_voxels(
    view: DepthView,
    limits_m: tuple[float, float, float],
    min_support: int,
    lower_level: npt.NDArray[np.int32] | None = None,
) -> tuple[Pixels, npt.NDArray[np.uint64]]:
    """Return one pixel of each voxel of an obstacle or a drop, and the measured height bins.

    A voxel is an obstacle with at least `min_support` pixels between the first two of `limits_m`,
    in metres above the ground, and a drop with as many below the third. `lower_level`: (W,) row in
    each column of the image above which what is deep is no drop, −1 or None for none. The second
    array is (rows · columns of the box,) with one bit for each height bin.
    """
    rows, cols = view.shape
    seen = np.zeros(rows * cols + 1, dtype=np.uint64)  # the last one for unmeasured pixels
    if len(seen) == 1:
        return np.empty(0, dtype=np.int32), seen[:0]
    limits = np.array([*limits_m, view.max_range_m], dtype=np.float32)
    rays = (view.depth_m, view.ground_m, view.across, view.down, view.affine)
    if lower_level is None:
        lower_level = np.full(view.depth_m.shape[1], -1, dtype=np.int32)
    counters = _scratch.counters(rows * cols * HEIGHT_BINS)
    pixels = _measured(*rays, rows, cols, limits, seen, counters, min_support, lower_level)
    return pixels, seen[:-1]


def voxels_of(
    view: DepthView, pixels: npt.NDArray[np.int64], high_m: float, min_support: int
) -> Pixels:
    """Return one pixel of each voxel with at least `min_support` of (N,) ascending pixels, below
    `high_m` metres above the ground."""
    rows, cols = view.shape
    if not rows * cols:
        return np.empty(0, dtype=np.int32)
    limits = np.array([-np.inf, high_m, -np.inf, view.max_range_m], dtype=np.float32)
    rays = (view.depth_m, view.ground_m, view.across, view.down, view.affine)
    return _supported(
        *rays, rows, cols, limits, pixels, _scratch.counters(rows * cols * HEIGHT_BINS), min_support
    )


@inlined
def _row(
    depth_m: npt.NDArray[np.float32],
    ground_m: npt.NDArray[np.float32],
    across: npt.NDArray[np.float32],
    b: float,
    t: npt.NDArray[np.float32],
    rows: int,
    cols: int,
    limits: npt.NDArray[np.float32],
    codes: npt.NDArray[np.int32],
) -> None:
    """Write for each pixel of a row twice its voxel, cell · 64 + height bin, plus one if its height
    is within the limits; −1 for none.

    Free of branches and doubles, so that the compiler vectorises it. The first code is left for a
    sentinel.
    """
    zero, bins, lowest_m, levels = (
        np.float32(0),
        np.float32(1.0 / BIN_M),
        np.float32(LOWEST_M),
        np.float32(HEIGHT_BINS),
    )
    x0, y0, z0 = t[0, 0], t[1, 0], t[2, 0]
    x1, y1, z1 = t[0, 1] * b + t[0, 2], t[1, 1] * b + t[1, 2], t[2, 1] * b + t[2, 2]
    x3, y3, z3 = t[0, 3], t[1, 3], t[2, 3]
    low, high, deep, far = limits[0], limits[1], limits[2], limits[3]
    wide, long = np.float32(cols), np.float32(rows)
    for j in range(len(depth_m)):
        depth, a = depth_m[j], across[j]
        x, y, z = (x0 * a + x1) * depth + x3, (y0 * a + y1) * depth + y3, (z0 * a + z1) * depth + z3
        z -= ground_m[j]
        level = (z - lowest_m) * bins
        # A drop below the lowest bin counts in that bin.
        level = zero if (z < deep) & (level < zero) else level
        # Truncation is the floor of non-negative values; negative ones are outside. No `and`: it
        # would be a branch.
        inside = (depth > zero) & (depth <= far) & (x >= zero) & (y >= zero) & (level >= zero)
        inside &= (x < wide) & (y < long) & (level < levels)
        counts = ((low < z) & (z < high)) | (z < deep)
        voxel = (np.int32(y) * np.int32(cols) + np.int32(x)) * np.int32(HEIGHT_BINS) + np.int32(
            level
        )
        codes[j + 1] = voxel * np.int32(2) + np.int32(counts) if inside else np.int32(-1)


@compiled
def _measured(
    depth_m: FloatImage,
    ground_m: FloatImage,
    across: npt.NDArray[np.float32],
    down: npt.NDArray[np.float32],
    t: npt.NDArray[np.float32],
    rows: int,
    cols: int,
    limits: npt.NDArray[np.float32],
    seen: npt.NDArray[np.uint64],
    counts: npt.NDArray[np.uint8],
    min_support: int,
    lower_level: npt.NDArray[np.int32],
) -> Pixels:
    height, width = depth_m.shape
    codes = np.full(width + 1, -2, dtype=np.int32)
    changed = np.zeros((width + WORD - 1) // WORD * WORD, dtype=np.uint8)
    starts, tall = np.empty(width + 1, dtype=np.int32), np.empty(width + 1, dtype=np.int32)
    outside = np.uint32(rows * cols * HEIGHT_BINS)
    touched, pixels, count = (
        np.empty(height * width, dtype=np.int32),
        np.empty(height * width, dtype=np.int32),
        0,
    )
    for i in range(height):
        ground = ground_m[i if len(ground_m) > 1 else 0]
        _row(depth_m[i], ground, across, down[i], t, rows, cols, limits, codes)
        high = 0
        for run in range(run_starts(codes, changed, starts, width)):
            code = codes[starts[run] + 1]
            voxel = np.uint32(code >> 1) if code >= 0 else outside
            seen[voxel >> 6] |= ONE << np.uint64(voxel & 63)
            tall[high] = run
            counts_here = voxel & 63 >= _FLOOR_BIN
            if code >= 0 and code & 1 and not counts_here:
                for j in range(starts[run], starts[run + 1]):
                    counts_here |= i >= lower_level[j]
            high += (code >= 0) & (code & 1) & counts_here
        for index in range(high):
            run = tall[index]
            first = starts[run]
            voxel = np.uint32(codes[first + 1] >> 1)
            touched[count], pixels[count] = voxel, i * width + first
            count += counts[voxel] == 0
            counts[voxel] = min(counts[voxel] + starts[run + 1] - first, 255)
    return _with_support(touched[:count], pixels[:count], counts, min_support)


@compiled
def _supported(
    depth_m: FloatImage,
    ground_m: FloatImage,
    across: npt.NDArray[np.float32],
    down: npt.NDArray[np.float32],
    t: npt.NDArray[np.float32],
    rows: int,
    cols: int,
    limits: npt.NDArray[np.float32],
    some: npt.NDArray[np.int64],
    counts: npt.NDArray[np.uint8],
    min_support: int,
) -> Pixels:
    width = depth_m.shape[1]
    codes, row = np.full(width + 1, -2, dtype=np.int32), -1
    touched, pixels, count = (
        np.empty(len(some), dtype=np.int32),
        np.empty(len(some), dtype=np.int32),
        0,
    )
    for pixel in some:
        if pixel // width != row:
            row = pixel // width
            ground = ground_m[row if len(ground_m) > 1 else 0]
            _row(depth_m[row], ground, across, down[row], t, rows, cols, limits, codes)
        code = codes[pixel - row * width + 1]
        if code < 0 or not code & 1:
            continue
        voxel = code >> 1
        if counts[voxel] == 0:
            touched[count], pixels[count] = voxel, pixel
            count += 1
        counts[voxel] += np.uint8(counts[voxel] < 255)
    return _with_support(touched[:count], pixels[:count], counts, min_support)


@nested
def _with_support(
    touched: Pixels, pixels: Pixels, counts: npt.NDArray[np.uint8], min_support: int
) -> Pixels:
    """Return the pixels of the voxels with enough support, and reset the counters to 0."""
    found = 0
    for index in range(len(touched)):
        if counts[touched[index]] >= min_support:
            pixels[found] = pixels[index]
            found += 1
        counts[touched[index]] = 0
    return pixels[:found].copy()
