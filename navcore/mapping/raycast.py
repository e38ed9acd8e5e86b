"""Which space the camera has looked into: along every line of sight up to what it ended at, and
nothing behind it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.grid.bitplane import ONE, PAD, BitPlane
from navcore.grid.grid import GridSpec
from navcore.mapping.voxels import BIN_M, HEIGHT_BINS, LOWEST_M
from navcore.robot.frame import Frame

BLOCK = 4
"""The volume is counted in blocks of so many cells a side, and 5 cm of height."""
STRIDE_PX = 4
"""One ray for so many columns of the picture …"""
SPARSE = 3
"""… and for the volume, whose blocks are larger, one of so many of these in columns and rows."""


def look(
    frame: Frame,
    spec: GridSpec,
    *,
    max_range_m: float,
    ceiling_m: float,
    looked: BitPlane,
    volume: BitPlane,
) -> None:
    """Note what lies between the camera and what it measured.

    `looked`: plane of (rows, cols) cells over which a line of sight passed, below the ceiling.
    `volume`: uint64 of (⌈rows / 4⌉, ⌈cols / 4⌉) blocks, a bit for each height bin that a line of
    sight passed through.
    """
    lens = frame.intrinsics
    place = np.array([spec.origin_x_m, spec.origin_y_m, spec.resolution_m, max_range_m, ceiling_m])
    _look(
        frame.depth_m,
        frame.T_map_camera,
        np.array([lens.fx, lens.fy, lens.cx, lens.cy]),
        place,
        spec.rows,
        spec.cols,
        looked,
        volume,
    )


@compiled
def _look(
    depth_m: npt.NDArray[np.float32],
    t: npt.NDArray[np.float64],
    lens: npt.NDArray[np.float64],
    place: npt.NDArray[np.float64],
    rows: int,
    cols: int,
    looked: BitPlane,
    volume: BitPlane,
) -> None:
    height, width = depth_m.shape
    for j in range(STRIDE_PX // 2, width, STRIDE_PX):
        a = (j - lens[2]) / lens[0]
        furthest, furthest_row = 0.0, 0
        for i in range(STRIDE_PX // 2, height, STRIDE_PX):
            depth = min(float(depth_m[i, j]), place[3])
            if depth <= 0.0:
                continue
            b = (i - lens[3]) / lens[1]
            rise = t[2, 0] * a + t[2, 1] * b + t[2, 2]
            if rise * depth + t[2, 3] > place[4]:
                if t[2, 3] > place[4]:
                    continue  # from a camera above the ceiling cut to something above it
                depth = (place[4] - t[2, 3]) / rise
            if depth > furthest:
                furthest, furthest_row = depth, i
            if i // STRIDE_PX % SPARSE == 0 and j // STRIDE_PX % SPARSE == 0:
                _pass_through(t, a, b, depth, place, volume)
        if furthest > 0.0:
            _sweep(t, a, (furthest_row - lens[3]) / lens[1], furthest, place, rows, cols, looked)


@compiled
def _pass_through(
    t: npt.NDArray[np.float64],
    a: float,
    b: float,
    depth: float,
    place: npt.NDArray[np.float64],
    volume: BitPlane,
) -> None:
    """Set the blocks along one ray, in steps of a block."""
    dx, dy = t[0, 0] * a + t[0, 1] * b + t[0, 2], t[1, 0] * a + t[1, 1] * b + t[1, 2]
    dz = t[2, 0] * a + t[2, 1] * b + t[2, 2]
    step = BLOCK * place[2] / math.sqrt(dx * dx + dy * dy + dz * dz)
    side = 1.0 / (BLOCK * place[2])
    for k in range(int(depth / step) + 1):
        along = min(k * step, depth)
        row = math.floor((t[1, 3] + along * dy - place[1]) * side)
        col = math.floor((t[0, 3] + along * dx - place[0]) * side)
        level = math.floor((t[2, 3] + along * dz - LOWEST_M) * (1.0 / BIN_M))
        if 0 <= row < volume.shape[0] and 0 <= col < volume.shape[1] and 0 <= level < HEIGHT_BINS:
            volume[row, col] |= ONE << np.uint64(level)


@compiled
def _sweep(
    t: npt.NDArray[np.float64],
    a: float,
    b: float,
    depth: float,
    place: npt.NDArray[np.float64],
    rows: int,
    cols: int,
    looked: BitPlane,
) -> None:
    """Set the cells under one ray, in steps of half a cell."""
    dx, dy = t[0, 0] * a + t[0, 1] * b + t[0, 2], t[1, 0] * a + t[1, 1] * b + t[1, 2]
    step = 0.5 * place[2] / max(math.sqrt(dx * dx + dy * dy), 1e-9)
    per_metre = 1.0 / place[2]
    for k in range(int(depth / step) + 1):
        along = k * step
        row = math.floor((t[1, 3] + along * dy - place[1]) * per_metre)
        col = math.floor((t[0, 3] + along * dx - place[0]) * per_metre)
        if 0 <= row < rows and 0 <= col < cols:
            looked[row + PAD, (col + PAD) >> 6] |= ONE << np.uint64(col & 63)
