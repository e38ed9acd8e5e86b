"""Ray casting: the space along every line of sight up to the measured surface, and nothing behind
it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from navcore.compiled import compiled, nested
from navcore.config.mapping import RaycastConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.arrays import FloatImage, Words
from navcore.geometry.camera import Pinhole, column_slope, ray_direction, row_slope
from navcore.geometry.transform import Matrix
from navcore.grid.bitplane import ONE
from navcore.grid.grid import Cell, GridSpec
from navcore.mapping.views.voxels import BIN_M, HEIGHT_BINS, LOWEST_M
from navcore.robot.frame import Frame

BLOCK = 4
"""Cells on each side of a block, in which the explored volume is counted; its height is one bin of
5 cm."""


class _Limits(NamedTuple):
    """Grid and limits of the rays, as compiled kernels take them."""

    origin_x_m: float
    origin_y_m: float
    resolution_m: float
    max_range_m: float
    ceiling_m: float
    stride_px: int
    volume_stride: int


def cast_rays(
    frame: Frame,
    spec: GridSpec,
    rules: ObservationConfig,
    density: RaycastConfig,
    *,
    corner: Cell,
    visible: Words,
    volume: Words,
) -> None:
    """Mark what lies between the camera and the surfaces that it measured, in a part of the grid
    with the first cell `corner`; the part contains all that the camera can measure.

    `visible`: (rows, words) cells over which a line of sight passed, below the ceiling; no padding.
    `volume`: uint64 of (rows / 4, 16 · words) blocks, one bit for each height bin that a line of
    sight passed through.
    """
    limits = _Limits(
        origin_x_m=spec.origin_x_m,
        origin_y_m=spec.origin_y_m,
        resolution_m=spec.resolution_m,
        max_range_m=rules.max_range_m,
        ceiling_m=rules.ceiling_m,
        stride_px=frame.intrinsics.length_px(density.stride_px),
        volume_stride=density.volume_stride,
    )
    t, lens = frame.T_map_camera, frame.intrinsics.pinhole
    _cast_rays(frame.depth_m, t, lens, limits, spec.rows, spec.cols, corner, visible, volume)


@compiled
def _cast_rays(
    depth_m: FloatImage,
    t: Matrix,
    lens: Pinhole,
    limits: _Limits,
    rows: int,
    cols: int,
    corner: Cell,
    visible: Words,
    volume: Words,
) -> None:
    height, width = depth_m.shape
    stride, sparse, ceiling_m = limits.stride_px, limits.volume_stride, limits.ceiling_m
    for j in range(stride // 2, width, stride):
        a = column_slope(j, lens)
        furthest, furthest_row = 0.0, 0
        for i in range(stride // 2, height, stride):
            depth = min(float(depth_m[i, j]), limits.max_range_m)
            if depth <= 0.0:
                continue
            b = row_slope(i, lens)
            rise = t[2, 0] * a + t[2, 1] * b + t[2, 2]
            if rise * depth + t[2, 3] > ceiling_m:
                if t[2, 3] > ceiling_m:
                    continue  # from a camera above the ceiling to a surface above it
                depth = (ceiling_m - t[2, 3]) / rise
            if depth > furthest:
                furthest, furthest_row = depth, i
            if i // stride % sparse == 0 and j // stride % sparse == 0:
                _mark_volume(t, a, b, depth, limits, corner, volume)
        if furthest > 0.0:
            b = row_slope(furthest_row, lens)
            _mark_cells(t, a, b, furthest, limits, rows, cols, corner, visible)


@nested
def _mark_volume(
    t: Matrix, a: float, b: float, depth: float, limits: _Limits, corner: Cell, volume: Words
) -> None:
    """Set the blocks along one ray, in steps of a block."""
    dx, dy, dz = ray_direction(t, a, b)
    step = BLOCK * limits.resolution_m / math.sqrt(dx * dx + dy * dy + dz * dz)
    side = 1.0 / (BLOCK * limits.resolution_m)
    for k in range(int(depth / step) + 1):
        along = min(k * step, depth)
        row = math.floor((t[1, 3] + along * dy - limits.origin_y_m) * side) - corner[0] // BLOCK
        col = math.floor((t[0, 3] + along * dx - limits.origin_x_m) * side) - corner[1] // BLOCK
        level = math.floor((t[2, 3] + along * dz - LOWEST_M) * (1.0 / BIN_M))
        if 0 <= row < volume.shape[0] and 0 <= col < volume.shape[1] and 0 <= level < HEIGHT_BINS:
            volume[row, col] |= ONE << np.uint64(level)


@nested
def _mark_cells(
    t: Matrix,
    a: float,
    b: float,
    depth: float,
    limits: _Limits,
    rows: int,
    cols: int,
    corner: Cell,
    visible: Words,
) -> None:
    """Set the cells under one ray, in steps of half a cell."""
    dx, dy, _ = ray_direction(t, a, b)
    step = 0.5 * limits.resolution_m / max(math.sqrt(dx * dx + dy * dy), 1e-9)
    per_metre = 1.0 / limits.resolution_m
    for k in range(int(depth / step) + 1):
        along = k * step
        row = math.floor((t[1, 3] + along * dy - limits.origin_y_m) * per_metre)
        col = math.floor((t[0, 3] + along * dx - limits.origin_x_m) * per_metre)
        if 0 <= row < rows and 0 <= col < cols:
            visible[row - corner[0], (col - corner[1]) >> 6] |= ONE << np.uint64(col & 63)
