"""What lies right under something higher is a part of that: the foot of an office chair is no
landmine.

A network knows a thing by its look, and much that stands on the floor has a foot that looks like
one. Where much of a region of a class has something above it that no thing of the class is as high
as, the region is dismissed: what rises above it is an obstacle by itself. From where depth errs too
much to tell what is above from what is behind, it is in doubt until it is seen from nearer. So it
is with colours: the lowest of a red cupboard is no red floor.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.mission.beware_list import BewareList
from navcore.perception.depth_filter import MIN_PIXELS, Heights, Mask, depth_error_m
from navcore.robot.frame import Frame

CELL_M, SIDE = 0.05, 340
"""Columns that heights are compared in: cells of the map frame, so many to a side about the camera.
"""
CEILING_M = 1.5
"""What hangs higher is above the robot, too."""
SHARE = 0.34
"""Of a region that has something above it, for the whole to be a part of that."""
UNSURE_M = 0.07
"""Where depth errs by more than this one cannot tell what is above from what is behind."""
FOOT_M, MOSTLY = 0.1, 0.5
"""So near to something tall, and so much of it, lies a region that is its foot."""
CLEARLY_M = 0.08
"""Higher than a thing of the class can be by as much: depth scatters."""


def overhung(
    class_ids: npt.NDArray[np.uint8], frame: Frame, heights_m: Heights, beware: BewareList
) -> tuple[Mask, Mask]:
    """(H, W) pixels of regions of a class with a `max_height_m` that lie under something higher,
    and of those that may do so.

    `heights_m` is of `heights_above_floor`.
    """
    surely, maybe = (
        np.zeros(class_ids.shape, dtype=np.bool_),
        np.zeros(class_ids.shape, dtype=np.bool_),
    )
    low = [
        entry
        for entry in beware.classes
        if entry.max_height_m is not None and (class_ids == entry.class_id).any()
    ]
    if not low:
        return surely, maybe
    columns = _columns(frame.depth_m, frame.T_map_camera, _lens(frame))
    for entry in low:
        assert entry.max_height_m is not None
        mask = class_ids == entry.class_id
        tops = _tops(columns, heights_m, mask)
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
            if int(inside.sum()) < MIN_PIXELS:
                continue
            errs_m = depth_error_m(float(np.median(frame.depth_m[window][inside])), frame)
            sure = errs_m <= UNSURE_M
            # The pixels of what is seen flatly lie far apart: a cell counts with those beside it,
            # as far as depth errs.
            reach = 1 if sure else math.ceil(errs_m / CELL_M)
            wide = np.asarray(
                cv2.dilate(tops, np.ones((2 * reach + 1, 2 * reach + 1), dtype=np.uint8))
            )
            foot_m = max(float(np.percentile(heights_m[window][inside], 10)), 0.0)
            above = wide.ravel()[columns[window][inside]] > foot_m + entry.max_height_m + CLEARLY_M
            if float(above.mean()) > SHARE:
                (surely if sure else maybe)[window] |= regions[window] == region
    return surely, maybe


def base_regions(low: Mask, tall: Mask, frame: Frame) -> Mask:
    """(H, W) pixels of the regions of `low` that lie wholly at the foot of what is `tall`.

    For colour rules, of what fits one: the foot of a red cupboard is no red floor. A marking that
    leads farther away is kept whole, and what is taken for a foot is nearer to an obstacle than the
    robot comes.
    """
    columns = _columns(frame.depth_m, frame.T_map_camera, _lens(frame))
    seen = columns >= 0
    holding = np.zeros((SIDE, SIDE), dtype=np.uint8)
    holding.ravel()[columns[tall & seen]] = 1
    side = 2 * round(FOOT_M / CELL_M) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    near = np.asarray(cv2.dilate(holding, disc)).ravel()[columns] > 0
    count, regions = cv2.connectedComponents(low.view(np.uint8), connectivity=8)
    of_all = np.bincount(regions[low & seen], minlength=count)
    of_feet = np.bincount(regions[low & seen & near], minlength=count)
    # Depth scatters single pixels of a foot to where there is none; what leads away is more than
    # that, however little of all.
    _, parts, boxes, _ = cv2.connectedComponentsWithStats(
        (low & seen & ~near).view(np.uint8), connectivity=8
    )
    leads_away = (parts > 0) & (boxes[parts, cv2.CC_STAT_AREA] >= MIN_PIXELS)
    is_foot = (of_all > 0) & (of_feet >= MOSTLY * of_all)
    is_foot[regions[leads_away]] = False
    foot: Mask = is_foot[regions] & low
    return foot


def _lens(frame: Frame) -> npt.NDArray[np.float64]:
    lens = frame.intrinsics
    return np.array([lens.fx, lens.fy, lens.cx, lens.cy])


@compiled
def _columns(
    depth_m: Heights, t: npt.NDArray[np.float64], lens: npt.NDArray[np.float64]
) -> npt.NDArray[np.int32]:
    """(H, W) the column that each pixel lies in, row · `SIDE` + column; −1 for none."""
    height, width = depth_m.shape
    found = np.full((height, width), np.int32(-1))
    for i in range(height):
        b = (i - lens[3]) / lens[1]
        for j in range(width):
            depth = depth_m[i, j]
            if depth > 0:
                a = (j - lens[2]) / lens[0]
                x = (t[0, 0] * a + t[0, 1] * b + t[0, 2]) * depth / CELL_M + SIDE / 2
                y = (t[1, 0] * a + t[1, 1] * b + t[1, 2]) * depth / CELL_M + SIDE / 2
                if 0 <= x < SIDE and 0 <= y < SIDE:
                    found[i, j] = int(y) * SIDE + int(x)
    return found


@compiled
def _tops(columns: npt.NDArray[np.int32], heights_m: Heights, mask: Mask) -> Heights:
    """(SIDE, SIDE) the highest that is seen in each column of what is not of the class, up to the
    ceiling; 0 for nothing."""
    tops = np.zeros((SIDE, SIDE), dtype=np.float32)
    flat = tops.ravel()
    for i in range(columns.shape[0]):
        for j in range(columns.shape[1]):
            if columns[i, j] >= 0 and not mask[i, j] and heights_m[i, j] <= CEILING_M:
                flat[columns[i, j]] = max(flat[columns[i, j]], heights_m[i, j])
    return tops
