"""From depth to points: what stands in the way, what is to beware of, and what of the world has been seen at all."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.beware import LARGEST_CLASS_ID, NOTHING, BewareList
from navcore.errors import BadConfiguration
from navcore.frame import Frame, Intrinsics
from navcore.grid import GridSpec
from navcore.search.bits import ONE, compiled, lowest, ones
from navcore.segment import Labels
from navcore.settings import between
from navcore.terrain import Image, flat

HEIGHT_BINS = 64
BIN_M = 0.05
Box = tuple[int, int, int, int]
"""First row and column of some cells of the grid, and those after the last."""
LOWEST_M = -0.425
"""Heights are binned from here up, 64 bins of 5 cm, to 2.775 m. The floor is the middle of a bin, not the border of two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointRules:
    """Which measurements count."""

    obstacle_height_m: float = between(0.02, 1.0, default=0.10)
    """Anything higher is an obstacle (the paper's 10 cm)."""
    ceiling_m: float = between(0.2, 2.8, default=1.5)
    """Anything higher than this is above the robot and none of its business."""
    drop_m: float = between(0.05, 2.0, default=0.15)
    """Floor that lies deeper than this is no floor to drive on: a stair down, a kerb, a pit."""
    max_slope: float = between(0.0, 0.5, default=0.2)
    """What rises or falls by no more than this per metre is ground; with 0 only the plane on which the robot stands is."""
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


def observe(
    frame: Frame, labels: Labels, beware: BewareList, spec: GridSpec, rules: PointRules, ground_m: Image | None = None
) -> Observation:
    """The frame's points on the map: geometric ones by height, beware ones by label at any height their rule allows.

    Heights are those above the ground, `ground_m` (H, W) as `terrain.ground_heights` makes it, by default the plane on which
    the robot stands; what goes onto the map keeps its place in space. A point of a beware class that is also higher than the
    obstacle height counts twice, as both: it stays an obstacle when its class is switched off.
    """
    if labels.class_ids.shape != frame.depth_m.shape:
        raise ValueError(f"labels must be {frame.depth_m.shape} class ids, got {labels.class_ids.shape}")
    if not np.isfinite(labels.confidence.sum()):
        raise ValueError("the labels' confidence is not finite, expected 0 to 1 in every pixel")
    camera, intrinsics = frame.T_map_camera, frame.intrinsics
    box = frustum_box(frame, spec, rules.max_range_m)
    voxels = locate(frame, spec, box, rules, ground_m)
    geometric, seen = tall_voxels(voxels, box, rules)
    found = [geometric, *_labelled(labels.class_ids, voxels, beware, box, rules.min_support)]
    pixels = np.concatenate(found).astype(np.int64)
    class_ids = labels.class_ids.reshape(-1)[pixels]
    class_ids[: len(geometric)] = NOTHING
    rows, cols = np.divmod(pixels, intrinsics.width)
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
        voxels_seen=_on_the_grid(seen, spec, box),
    )


def _labelled(
    class_ids: npt.NDArray[np.uint8], voxels: Voxels, beware: BewareList, box: Box, min_support: int
) -> list[npt.NDArray[np.int32]]:
    """For each class in the picture one pixel of each of its voxels."""
    flat, heights, counts = class_ids.reshape(-1), _max_heights(beware), _counts(box)
    named = np.flatnonzero(flat != NOTHING)
    kinds = flat[named]
    if len(kinds) and kinds.max() > LARGEST_CLASS_ID:
        raise ValueError(f"labels must be class ids of 0 to {LARGEST_CLASS_ID}, got {kinds.max()}")
    return [
        _tally_some(voxels.keys, voxels.z_m, named[kinds == kind], heights[kind], counts, min_support)
        for kind in np.flatnonzero(np.bincount(kinds, minlength=64))
    ]


def _on_the_grid(keys: npt.NDArray[np.int32], spec: GridSpec, box: Box) -> npt.NDArray[np.int64]:
    """Voxels of the box as voxels of the grid."""
    cells, levels = keys // HEIGHT_BINS, keys % HEIGHT_BINS  # a power of two: shifts, where divmod would divide
    rows, cols = np.divmod(cells, np.int32(max(box[3] - box[1], 1)))
    whole = (rows.astype(np.int64) + box[0]) * spec.cols + (cols + box[1])
    return np.asarray(whole * HEIGHT_BINS + levels)


def frustum_box(frame: Frame, spec: GridSpec, max_range_m: float) -> Box:
    """(top, left, bottom, right) cells of the grid within which everything lies that the camera can measure; may be empty."""
    lens = frame.intrinsics
    a = np.array([-lens.cx, lens.width - 1 - lens.cx]) / lens.fx
    b = np.array([-lens.cy, lens.height - 1 - lens.cy]) / lens.fy
    corners = max_range_m * np.array([[0, 0, 0], *([x, y, 1] for x in a for y in b)])
    points = corners @ frame.T_map_camera[:3, :3].T + frame.T_map_camera[:3, 3]
    (top, left), (bottom, right) = (spec.cell(*points[:, :2].min(axis=0)), spec.cell(*points[:, :2].max(axis=0)))
    return max(top, 0), max(left, 0), min(bottom + 1, spec.rows), min(right + 1, spec.cols)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Voxels:
    """Where each pixel's point lies."""

    keys: npt.NDArray[np.int32]
    """(H · W,) voxel within the box, cell · 64 + height bin; −1 where nothing usable was measured."""
    z_m: npt.NDArray[np.float32]
    """(H · W,) height above the ground."""


class _Scratch(threading.local):
    """A counter for every voxel of a box, all 0 between two uses: clearing what was touched beats asking for new memory."""

    def __init__(self) -> None:
        self.counts: npt.NDArray[np.uint8] = np.zeros(0, dtype=np.uint8)

    def room(self, size: int) -> npt.NDArray[np.uint8]:
        if len(self.counts) < size:
            self.counts = np.zeros(size, dtype=np.uint8)
        return self.counts[:size]


_scratch = _Scratch()


def locate(frame: Frame, spec: GridSpec, box: Box, rules: PointRules, ground_m: Image | None = None) -> Voxels:
    """Each pixel's voxel within a box of the grid (`frustum_box`), by its height above the ground."""
    lens, t = frame.intrinsics, frame.T_map_camera
    cells = 1.0 / spec.resolution_m
    # From optical coordinates to cells of the box and bins of height, in one affine map.
    scale = np.array([[cells], [cells], [1.0]])
    offset = np.array([spec.origin_x_m + box[1] * spec.resolution_m, spec.origin_y_m + box[0] * spec.resolution_m, 0.0])
    affine = (np.column_stack([t[:3, :3], t[:3, 3] - offset]) * scale).astype(np.float32)
    across = ((np.arange(lens.width) - lens.cx) / lens.fx).astype(np.float32)
    keys, z_m = np.empty(frame.depth_m.shape, dtype=np.int32), np.empty(frame.depth_m.shape, dtype=np.float32)
    shape = (box[2] - box[0], box[3] - box[1])
    if min(shape) <= 0:
        keys[:] = -1
    else:
        ground_m = flat(frame.depth_m.shape) if ground_m is None else ground_m
        _project(frame.depth_m, ground_m, affine, across, lens.cy, lens.fy, *shape, np.float32(rules.max_range_m), keys, z_m)
    return Voxels(keys=keys.reshape(-1), z_m=z_m.reshape(-1))


def tall_voxels(voxels: Voxels, box: Box, rules: PointRules) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """One pixel of each voxel where something stands or the floor drops, and every voxel of the box that was measured."""
    limits = (rules.obstacle_height_m, rules.ceiling_m, -rules.drop_m)
    return _tally(voxels.keys, voxels.z_m, limits, _counts(box), rules.min_support)


def _counts(box: Box) -> npt.NDArray[np.uint8]:
    return _scratch.room(HEIGHT_BINS * max(box[2] - box[0], 0) * max(box[3] - box[1], 0))


@compiled
def _project(
    depth_m: npt.NDArray[np.float32],
    ground_m: npt.NDArray[np.float32],
    t: npt.NDArray[np.float32],
    across: npt.NDArray[np.float32],
    cy: float,
    fy: float,
    rows: int,
    cols: int,
    max_range_m: np.float32,
    keys: npt.NDArray[np.int32],
    z_m: npt.NDArray[np.float32],
) -> None:
    """Without a branch and without doubles, so that the compiler makes vectors of it."""
    height, width = depth_m.shape
    zero, bins, lowest = np.float32(0), np.float32(1.0 / BIN_M), np.float32(LOWEST_M)
    for i in range(height):
        b = np.float32((i - cy) / fy)
        x1, y1, z1 = t[0, 1] * b + t[0, 2], t[1, 1] * b + t[1, 2], t[2, 1] * b + t[2, 2]
        x0, y0, z0 = t[0, 0], t[1, 0], t[2, 0]
        x3, y3, z3 = t[0, 3], t[1, 3], t[2, 3]
        for j in range(width):
            depth, a = depth_m[i, j], across[j]
            x, y, z = (x0 * a + x1) * depth + x3, (y0 * a + y1) * depth + y3, (z0 * a + z1) * depth + z3
            z -= ground_m[i, j]
            level = (z - lowest) * bins
            # Truncation is the floor of what is not negative; what is, is outside. No `and`: it would be a branch.
            inside = (depth > zero) & (depth <= max_range_m) & (x >= zero) & (y >= zero) & (level >= zero)
            row, col, bin_ = np.int32(y), np.int32(x), np.int32(level)
            inside &= (row < rows) & (col < cols) & (bin_ < HEIGHT_BINS)
            keys[i, j] = (row * np.int32(cols) + col) * np.int32(HEIGHT_BINS) + bin_ if inside else np.int32(-1)
            z_m[i, j] = z


@compiled
def _tally(
    keys: npt.NDArray[np.int32],
    z_m: npt.NDArray[np.float32],
    limits_m: tuple[float, float, float],
    counts: npt.NDArray[np.uint8],
    min_support: int,
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """One pixel of each voxel with enough between the first two heights or below the third, and every voxel measured."""
    touched, pixels = np.empty(len(keys), dtype=np.int32), np.empty(len(keys), dtype=np.int32)
    low, high, deep, count = np.float32(limits_m[0]), np.float32(limits_m[1]), np.float32(limits_m[2]), 0
    # What is measured anywhere is one bit a voxel: a word a cell stays in the cache where a counter a voxel would not.
    seen = np.zeros(len(counts) // HEIGHT_BINS + 1, dtype=np.uint64)
    outside = np.uint32(len(seen) - 1)
    # Four places of the picture in turn: neighbours mostly share a voxel, and a word just written is slow to read again.
    quarter = (len(keys) + 3) // 4
    for first in range(quarter):
        for part in range(4):
            pixel = part * quarter + first
            if pixel >= len(keys):
                continue
            key = keys[pixel]
            cell = np.uint32(key >> 6) if key >= 0 else outside
            seen[cell] |= ONE << np.uint64(key & 63)
            z = z_m[pixel]
            if key >= 0 and (low < z < high or z < deep):
                slot = np.uint32(key)
                before = counts[slot]
                if before == 0:
                    touched[count], pixels[count] = key, pixel
                    count += 1
                counts[slot] = before + np.uint8(before < 255)
    found = 0
    for index in range(count):
        if counts[touched[index]] >= min_support:
            pixels[found] = pixels[index]
            found += 1
        counts[touched[index]] = 0
    return pixels[:found], _listed(seen[:-1])


@compiled
def _listed(words: npt.NDArray[np.uint64]) -> npt.NDArray[np.int32]:
    """The numbers of all set bits."""
    count = 0
    for word in words:
        count += ones(word)
    listed = np.empty(count, dtype=np.int32)
    at = 0
    for number in range(len(words)):
        left = words[number]
        while left != 0:
            listed[at] = number * 64 + lowest(left)
            at += 1
            left &= left - ONE
    return listed


@compiled
def _tally_some(
    keys: npt.NDArray[np.int32],
    z_m: npt.NDArray[np.float32],
    some: npt.NDArray[np.int64],
    high_m: float,
    counts: npt.NDArray[np.uint8],
    min_support: int,
) -> npt.NDArray[np.int32]:
    """One pixel of each voxel in which enough of `some` pixels lie, not higher than `high_m`."""
    touched, pixels = np.empty(len(some), dtype=np.int32), np.empty(len(some), dtype=np.int32)
    count = 0
    for pixel in some:
        key = keys[pixel]
        if key < 0 or z_m[pixel] > high_m:
            continue
        if counts[key] == 0:
            touched[count], pixels[count] = key, pixel
            count += 1
        counts[key] += np.uint8(counts[key] < 255)
    found = 0
    for index in range(count):
        if counts[touched[index]] >= min_support:
            pixels[found] = pixels[index]
            found += 1
        counts[touched[index]] = 0
    return pixels[:found]


def _max_heights(beware: BewareList) -> npt.NDArray[np.float64]:
    """(64,) up to which height each class counts; those that a network may find at every height."""
    heights = np.full(64, np.inf)
    for entry in beware.classes:
        if entry.colour is not None and not entry.colour.fallback:
            heights[entry.class_id] = entry.colour.max_height_m
    return heights
