"""From depth to points: what stands in the way, what is to beware of, and what of the world has been seen at all."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from navcore.beware import LARGEST_CLASS_ID, NOTHING, BewareList
from navcore.errors import BadConfiguration
from navcore.frame import Frame, Intrinsics
from navcore.grid import GridSpec
from navcore.segment import Labels
from navcore.settings import between

HEIGHT_BINS = 64
BIN_M = 0.05
LOWEST_M = -0.425
"""Heights are binned from here up, 64 bins of 5 cm, to 2.775 m. The floor is the middle of a bin, not the border of two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointRules:
    """Which measurements count."""

    obstacle_height_m: float = between(0.02, 1.0, default=0.10)
    """Anything higher is an obstacle (the paper's 10 cm)."""
    ceiling_m: float = between(0.2, 2.8, default=1.5)
    """Anything higher than this is above the robot and none of its business."""
    max_range_m: float = between(0.5, 20.0, default=5.0)
    """Depth beyond this is too coarse to be put on the map."""
    min_support: int = between(1, 100, default=2)
    """Pixels that must agree on a voxel before it counts."""

    def __post_init__(self) -> None:
        if self.ceiling_m <= self.obstacle_height_m:
            raise BadConfiguration(
                f"points: ceiling_m {self.ceiling_m:g} must be above obstacle_height_m {self.obstacle_height_m:g}, "
                "or nothing would ever be an obstacle"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observation:
    """What one frame adds to the map: one point per voxel (a grid cell × 5 cm of height) and class."""

    points_map: npt.NDArray[np.float32]
    """(N, 3) metres of the map frame."""
    class_ids: npt.NDArray[np.uint8]
    """(N,) class of the beware list; `NOTHING` for geometric points."""
    confidence: npt.NDArray[np.float32]
    """(N,) of the segmenter; 1 for geometric points."""
    rgb: npt.NDArray[np.uint8]
    """(N, 3) colour."""
    range_m: npt.NDArray[np.float32]
    """(N,) depth at which it was measured; the nearer, the better."""
    max_range_m: float
    """Depth beyond this was not looked at."""
    voxels_seen: npt.NDArray[np.int64]
    """(K,) every voxel in which anything was measured, floor and ceiling too: cell index · 64 + height bin."""


def back_project(depth_m: npt.NDArray[np.floating], intrinsics: Intrinsics) -> npt.NDArray[np.float64]:
    """(N, 3) points of all measured pixels, row by row, in the optical frame (the paper's equations 1 to 3).

    X = (j − cx)·Z/fx, Y = (i − cy)·Z/fy, Z = depth of row i, column j. Pixels without a finite positive depth are left out.
    """
    rows, cols = np.nonzero(np.isfinite(depth_m) & (depth_m > 0))
    z = depth_m[rows, cols].astype(np.float64)
    return np.column_stack([(cols - intrinsics.cx) * z / intrinsics.fx, (rows - intrinsics.cy) * z / intrinsics.fy, z])


def observe(frame: Frame, labels: Labels, beware: BewareList, spec: GridSpec, rules: PointRules) -> Observation:
    """The frame's points on the map: geometric ones by height, beware ones by label at any height their rule allows.

    A point of a beware class that is also higher than the obstacle height counts twice, as both: it stays an obstacle when
    its class is switched off.
    """
    if labels.class_ids.shape != frame.depth_m.shape or int(labels.class_ids.max(initial=0)) > LARGEST_CLASS_ID:
        raise ValueError(f"labels must be {frame.depth_m.shape} class ids of 0 to {LARGEST_CLASS_ID}")
    camera, intrinsics = frame.T_map_camera, frame.intrinsics
    keys, pixels = _voxelise(
        frame.depth_m,
        labels.class_ids,
        _max_heights(beware),
        camera,
        np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy]),
        np.array([spec.origin_x_m, spec.origin_y_m, spec.resolution_m]),
        spec.rows,
        spec.cols,
        np.array([rules.obstacle_height_m, rules.ceiling_m, rules.max_range_m]),
        rules.min_support,
    )
    kinds = keys & 63
    chosen = kinds != _SEEN
    rows, cols = np.divmod(pixels[chosen], intrinsics.width)
    class_ids = kinds[chosen].astype(np.uint8)
    depth = frame.depth_m[rows, cols]
    optical = np.column_stack(
        [(cols - intrinsics.cx) * depth / intrinsics.fx, (rows - intrinsics.cy) * depth / intrinsics.fy, depth]
    )
    return Observation(
        points_map=(optical @ camera[:3, :3].T + camera[:3, 3]).astype(np.float32),
        class_ids=class_ids,
        confidence=np.where(class_ids == NOTHING, np.float32(1), labels.confidence[rows, cols]).astype(np.float32),
        rgb=frame.rgb[rows, cols],
        range_m=depth,
        max_range_m=rules.max_range_m,
        voxels_seen=keys[~chosen] >> 6,
    )


_SEEN = 63
"""Kind of a hash entry that says: something was measured here. All other kinds are class ids."""
assert LARGEST_CLASS_ID < _SEEN


def _max_heights(beware: BewareList) -> npt.NDArray[np.float64]:
    """(64,) up to which height each class counts; classes without a colour rule at every height."""
    heights = np.full(64, np.inf)
    for entry in beware.classes:
        if entry.colour is not None:
            heights[entry.class_id] = entry.colour.max_height_m
    return heights


@numba.njit(cache=True, nogil=True)
def _voxelise(
    depth_m: npt.NDArray[np.float32],
    class_ids: npt.NDArray[np.uint8],
    max_heights: npt.NDArray[np.float64],
    T_map_camera: npt.NDArray[np.float64],
    lens: npt.NDArray[np.float64],
    place: npt.NDArray[np.float64],
    rows: int,
    cols: int,
    limits: npt.NDArray[np.float64],
    min_support: int,
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Count pixels per (voxel, kind) in a hash table; returns the keys with enough support and one pixel of each."""
    height, width = depth_m.shape
    table, counts, pixels = _empty_table(1 << 15)
    entries = 0
    for i in range(height):
        # A pixel makes at most three entries; the table stays at most half full.
        while 2 * (entries + 3 * width) > len(table):
            table, counts, pixels = _doubled(table, counts, pixels)
        entries += _count_row(
            i, depth_m, class_ids, max_heights, T_map_camera, lens, place, rows, cols, limits, table, counts, pixels
        )
    slots = np.nonzero((counts >= min_support) | ((counts > 0) & ((table & 63) == _SEEN)))[0]
    return table[slots], pixels[slots].astype(np.int64)


@numba.njit(cache=True, nogil=True)
def _count_row(
    i: int,
    depth_m: npt.NDArray[np.float32],
    class_ids: npt.NDArray[np.uint8],
    max_heights: npt.NDArray[np.float64],
    T_map_camera: npt.NDArray[np.float64],
    lens: npt.NDArray[np.float64],
    place: npt.NDArray[np.float64],
    rows: int,
    cols: int,
    limits: npt.NDArray[np.float64],
    table: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int32],
    pixels: npt.NDArray[np.int32],
) -> int:
    """Count the pixels of one row; returns how many keys were new."""
    width, new = depth_m.shape[1], 0
    t, per_metre, b = T_map_camera, 1.0 / place[2], (i - lens[3]) / lens[1]
    for j in range(width):
        depth = depth_m[i, j]
        if depth <= 0.0 or depth > limits[2]:
            continue
        a = (j - lens[2]) / lens[0]
        x = (t[0, 0] * a + t[0, 1] * b + t[0, 2]) * depth + t[0, 3]
        y = (t[1, 0] * a + t[1, 1] * b + t[1, 2]) * depth + t[1, 3]
        z = (t[2, 0] * a + t[2, 1] * b + t[2, 2]) * depth + t[2, 3]
        row, col = math.floor((y - place[1]) * per_metre), math.floor((x - place[0]) * per_metre)
        level = math.floor((z - LOWEST_M) * (1.0 / BIN_M))
        if row < 0 or row >= rows or col < 0 or col >= cols or level < 0 or level >= HEIGHT_BINS:
            continue
        voxel = ((row * cols + col) * HEIGHT_BINS + level) << 6
        pixel = i * width + j
        new += _count(table, counts, pixels, voxel | _SEEN, pixel)
        if limits[0] < z < limits[1]:
            new += _count(table, counts, pixels, voxel | NOTHING, pixel)
        kind = class_ids[i, j]
        if kind != NOTHING and z <= max_heights[kind]:
            new += _count(table, counts, pixels, voxel | kind, pixel)
    return new


@numba.njit(cache=True, nogil=True)
def _empty_table(size: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Keys (−1 where empty), counts and one pixel of each key; `size` is a power of two."""
    return np.full(size, -1, dtype=np.int64), np.zeros(size, dtype=np.int32), np.zeros(size, dtype=np.int32)


@numba.njit(cache=True, nogil=True)
def _doubled(
    table: npt.NDArray[np.int64], counts: npt.NDArray[np.int32], pixels: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    larger, larger_counts, larger_pixels = _empty_table(2 * len(table))
    for slot in range(len(table)):
        if counts[slot] > 0:
            place = _slot(larger, table[slot])
            larger[place], larger_counts[place], larger_pixels[place] = table[slot], counts[slot], pixels[slot]
    return larger, larger_counts, larger_pixels


@numba.njit(cache=True, nogil=True)
def _slot(table: npt.NDArray[np.int64], key: int) -> int:
    """Where a key is in the table, or the empty place where it belongs."""
    mask = len(table) - 1
    slot = ((key * 0x2545F4914F6CDD1D) >> 20) & mask
    while table[slot] != key and table[slot] != -1:
        slot = (slot + 1) & mask
    return slot


@numba.njit(cache=True, nogil=True)
def _count(
    table: npt.NDArray[np.int64], counts: npt.NDArray[np.int32], pixels: npt.NDArray[np.int32], key: int, pixel: int
) -> int:
    """Count one more pixel of a key, the first of which stands for it; returns 1 if the key is new, else 0."""
    slot = _slot(table, key)
    counts[slot] += 1
    if counts[slot] > 1:
        return 0
    table[slot], pixels[slot] = key, pixel
    return 1
