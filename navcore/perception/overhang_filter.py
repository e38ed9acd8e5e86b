"""Low regions that are the base of a taller object: the foot of an office chair is no landmine.

A network recognises an object by its appearance, and the feet of many objects resemble one on the
list. Where much of a region has a measurement above it that is higher than any object of its class,
the region is rejected: what rises above it is an obstacle by itself. Where the depth error is too
large to tell above from behind, the region is undecided until it is seen from nearer. The same
holds for colour rules: the lowest part of a red cupboard is no red floor.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.config.perception.perception import DEFAULT_PERCEPTION, OverhangConfig
from navcore.geometry.arrays import Bools, FloatImage, Floats
from navcore.geometry.camera import Pinhole, column_slope, ray_direction, row_slope
from navcore.mission.beware_list import BewareList
from navcore.robot.frame import Frame
from navcore.robot.profile import DepthSensor

_DEFAULT = DEFAULT_PERCEPTION.overhang
ColumnImage = npt.NDArray[np.int32]


def overhung_regions(
    class_ids: npt.NDArray[np.uint8],
    frame: Frame,
    heights_m: FloatImage,
    beware: BewareList,
    sensor: DepthSensor,
    config: OverhangConfig = _DEFAULT,
) -> tuple[Bools, Bools]:
    """Return the (H, W) pixels of regions of a class with a `max_height_m` that lie under a taller
    object, and those of regions where the depth error leaves that undecided.

    `heights_m` is that of `heights_above_floor`.
    """
    certain, undecided = (np.zeros(class_ids.shape, dtype=np.bool_) for _ in range(2))
    low = [
        entry
        for entry in beware.classes
        if entry.max_height_m is not None and (class_ids == entry.class_id).any()
    ]
    if not low:
        return certain, undecided
    columns = _columns_of(frame, config)
    for entry in low:
        assert entry.max_height_m is not None
        mask = class_ids == entry.class_id
        tops = _column_tops(columns, heights_m, mask, config.grid_cells, config.ceiling_m)
        count, regions, boxes, _ = cv2.connectedComponentsWithStats(
            mask.view(np.uint8), connectivity=8
        )
        for region in range(1, count):
            left, top, width, height = boxes[region, :4]
            window = np.s_[top : top + height, left : left + width]
            inside = (
                (regions[window] == region)
                & np.isfinite(heights_m[window])
                & (columns[window] >= 0)
            )
            if int(inside.sum()) < config.min_pixels:
                continue
            depth_m = float(np.median(frame.depth_m[window][inside]))
            error_m = sensor.depth_error_m(depth_m, frame.intrinsics.fx)
            is_certain = error_m <= config.max_depth_error_m
            # The pixels of a surface seen at a small angle lie far apart: a column counts with its
            # neighbours, as far as the depth error.
            reach = 1 if is_certain else math.ceil(error_m / config.cell_m)
            wide = np.asarray(
                cv2.dilate(tops, np.ones((2 * reach + 1, 2 * reach + 1), dtype=np.uint8))
            )
            base_m = max(float(np.percentile(heights_m[window][inside], 10)), 0.0)
            limit_m = base_m + entry.max_height_m + config.clearly_above_m
            covered = wide.ravel()[columns[window][inside]] > limit_m
            if float(covered.mean()) > config.covered_share:
                (certain if is_certain else undecided)[window] |= regions[window] == region
    return certain, undecided


def base_regions(low: Bools, tall: Bools, frame: Frame, config: OverhangConfig = _DEFAULT) -> Bools:
    """Return the (H, W) pixels of the regions of `low` that lie wholly at the base of `tall`.

    For the pixels of a colour rule: the base of a red cupboard is no red floor. A marking that
    leads farther away is kept whole, and what is taken for a base is nearer to an obstacle than the
    robot comes.
    """
    columns = _columns_of(frame, config)
    seen = columns >= 0
    occupied = np.zeros((config.grid_cells, config.grid_cells), dtype=np.uint8)
    occupied.ravel()[columns[tall & seen]] = 1
    side = 2 * round(config.base_reach_m / config.cell_m) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    near = np.asarray(cv2.dilate(occupied, disc)).ravel()[columns] > 0
    count, regions = cv2.connectedComponents(low.view(np.uint8), connectivity=8)
    sizes = np.bincount(regions[low & seen], minlength=count)
    near_sizes = np.bincount(regions[low & seen & near], minlength=count)
    # Depth scatters single pixels of a base to where there is none; a marking that leads away has
    # more of them, however small their share.
    _, parts, boxes, _ = cv2.connectedComponentsWithStats(
        (low & seen & ~near).view(np.uint8), connectivity=8
    )
    leads_away = (parts > 0) & (boxes[parts, cv2.CC_STAT_AREA] >= config.min_pixels)
    is_base = (sizes > 0) & (near_sizes >= config.base_share * sizes)
    is_base[regions[leads_away]] = False
    base: Bools = is_base[regions] & low
    return base


def _columns_of(frame: Frame, config: OverhangConfig) -> ColumnImage:
    return np.asarray(
        _pixel_columns(
            frame.depth_m,
            frame.T_map_camera,
            frame.intrinsics.pinhole,
            config.cell_m,
            config.grid_cells,
        )
    )


@compiled
def _pixel_columns(
    depth_m: FloatImage, t: Floats, lens: Pinhole, cell_m: float, grid_cells: int
) -> ColumnImage:
    """Return the (H, W) column of space that each pixel lies in, row · `grid_cells` + column; −1
    for none."""
    height, width = depth_m.shape
    found = np.full((height, width), np.int32(-1))
    for i in range(height):
        b = row_slope(i, lens)
        for j in range(width):
            depth = depth_m[i, j]
            if depth > 0:
                dx, dy, _ = ray_direction(t, column_slope(j, lens), b)
                x = dx * depth / cell_m + grid_cells / 2
                y = dy * depth / cell_m + grid_cells / 2
                if 0 <= x < grid_cells and 0 <= y < grid_cells:
                    found[i, j] = int(y) * grid_cells + int(x)
    return found


@compiled
def _column_tops(
    columns: ColumnImage, heights_m: FloatImage, mask: Bools, grid_cells: int, ceiling_m: float
) -> FloatImage:
    """Return the (grid_cells, grid_cells) greatest height measured in each column outside the mask,
    up to the ceiling; 0 where there is none."""
    tops = np.zeros((grid_cells, grid_cells), dtype=np.float32)
    flat = tops.ravel()
    for i in range(columns.shape[0]):
        for j in range(columns.shape[1]):
            if columns[i, j] >= 0 and not mask[i, j] and heights_m[i, j] <= ceiling_m:
                flat[columns[i, j]] = max(flat[columns[i, j]], heights_m[i, j])
    return tops
