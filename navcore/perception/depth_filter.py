"""Depth and colour decide together what is real: a print of a cup on the floor is no cup.

The network may take a picture for the thing it shows. Where a class has a least height, a region of
it that lies flat in the floor around it is dismissed, but only where depth is there and sharp
enough to tell; everything undecided stays. What a label spills over a thing's edge onto what lies
far behind it is not the thing either.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.robot.frame import Frame

Heights = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

RELIEF_SHARE = 0.5
"""A region with less relief than this share of its class's least height is a picture …"""
MAX_FLAT_M = 0.025
"""… but nothing that rises higher than this is, however tall its class: a sign that has fallen over
is still a sign."""
SURE_ERRORS = 3.0
"""So many standard errors of the height must fit below the threshold, or the region is too far away
to decide."""
DISPARITY_ERROR_PX = 0.1
BASELINE_M = 0.095
"""Of the D455: depth at z errs by z² · disparity error / (focal length · baseline)."""
MIN_PIXELS = 12
MIN_MEASURED = 0.5
"""A region, and the floor around it, are decided on with at least so many pixels, so large a share
of them measured."""
RING_PX = 5
"""Width of the rim around a region in which the floor is looked for."""
TALL_M = 0.3
GROUND_M = 0.05
"""Of a class at least so tall, pixels lower than this are not the thing but the floor at its feet.
"""
SPILL_RAD = 0.018
"""So far over the edge of a thing a label may spill onto what is behind; six pixels of the D455's
at 640 × 480."""
JUMP_M, STEEPER = 0.1, 3.0
"""Behind it is what lies so much farther, and so many times as far as the floor recedes within that
angle: the tops of things, which are nearer to the eye's height, recede faster."""
FAR_M = 1000.0
"""Farther than any depth."""


def heights_above_floor(frame: Frame) -> Heights:
    """(H, W) z in the map frame, metres; NaN where no depth was measured."""
    lens, up = frame.intrinsics, frame.T_map_camera[2]
    across = ((up[0] / lens.fx) * (np.arange(lens.width) - lens.cx)).astype(np.float32)
    down = ((up[1] / lens.fy) * (np.arange(lens.height) - lens.cy) + up[2]).astype(np.float32)
    return np.asarray(_along(frame.depth_m, across, down, np.float32(up[3])))


@compiled
def _along(depth_m: Heights, across: Heights, down: Heights, eye_m: np.float32) -> Heights:
    """How high every ray is at its depth; `across` and `down` are what a column and a row add to
    its slope."""
    heights = np.empty_like(depth_m)
    for i in range(depth_m.shape[0]):
        for j in range(depth_m.shape[1]):
            depth = depth_m[i, j]
            heights[i, j] = (
                depth * (down[i] + across[j]) + eye_m if depth > 0 else np.float32(np.nan)
            )
    return heights


def reject_flat_regions(
    class_ids: npt.NDArray[np.uint8], frame: Frame, heights_m: Heights, beware: BewareList
) -> Mask:
    """(H, W) which pixels keep their class: all but flat pictures, specks, and the floor at the
    feet of tall things.

    Regions are connected pixels of one class that has a `min_height_m` or a `min_size_m`;
    `heights_m` is of `heights_above_floor`.
    """
    keep = np.ones(class_ids.shape, dtype=np.bool_)
    for entry in beware.classes:
        if entry.min_height_m is None and entry.min_size_m is None:
            continue
        mask = class_ids == entry.class_id
        if not mask.any():
            continue
        count, regions, boxes, _ = cv2.connectedComponentsWithStats(
            mask.view(np.uint8), connectivity=8
        )
        for region in range(1, count):
            window = _window(boxes[region], class_ids.shape)
            inside = regions[window] == region
            if entry.min_size_m is not None and is_speck(
                boxes[region], inside, frame, window, entry.min_size_m
            ):
                keep[window] &= ~inside
                continue
            if entry.min_height_m is None or boxes[region, cv2.CC_STAT_AREA] < MIN_PIXELS:
                continue
            threshold_m = min(RELIEF_SHARE * entry.min_height_m, MAX_FLAT_M)
            if is_flat(
                inside,
                class_ids[window] == NOTHING,
                frame.depth_m[window],
                heights_m[window],
                frame,
                threshold_m,
            ):
                keep[window] &= ~inside
            elif entry.min_height_m >= TALL_M:
                keep[window] &= ~at_its_feet(inside, heights_m[window])
    return keep


def trim_label_bleed(class_ids: npt.NDArray[np.uint8], frame: Frame) -> Mask:
    """(H, W) which pixels keep their class: all but those near a label's rim that lie far behind
    what it labels beside them.

    A network rounds the outline of a thing; the floor that looks out behind it would be on the map
    a thing of its own.
    """
    keep = np.ones(class_ids.shape, dtype=np.bool_)
    reach = max(1, round(SPILL_RAD * frame.intrinsics.fx))
    around = np.ones((2 * reach + 1, 2 * reach + 1), dtype=np.uint8)
    # Along the floor depth z grows by z² / (focal length · eye height) from one row of pixels to
    # the next.
    recedes = STEEPER * reach / (frame.intrinsics.fy * max(float(frame.T_map_camera[2, 3]), 0.1))
    for class_id in np.unique(class_ids[class_ids != NOTHING]):
        whole = class_ids == class_id
        left, top, width, height = cv2.boundingRect(whole.view(np.uint8))
        part = (
            slice(max(top - reach, 0), min(top + height + reach, whole.shape[0])),
            slice(max(left - reach, 0), min(left + width + reach, whole.shape[1])),
        )
        inside, depth_m = whole[part], frame.depth_m[part]
        measured = np.where(inside & (depth_m > 0), depth_m, np.float32(FAR_M))
        nearest = cv2.erode(measured, around, borderType=cv2.BORDER_CONSTANT, borderValue=FAR_M)
        rim = (
            cv2.erode(np.ascontiguousarray(inside).view(np.uint8), around) == 0
        )  # the picture's border is none
        keep[part] &= ~(
            inside & rim & (depth_m > nearest + np.maximum(JUMP_M, recedes * nearest**2))
        )
    return keep


def at_its_feet(inside: Mask, heights_m: Heights) -> Mask:
    """Pixels of a region on the ground, where most of it stands well above: the floor that a label
    spills over onto.

    On the map a flat point of the list stays for good; a person who walks by must not leave a trail
    of them.
    """
    measured = heights_m[inside & np.isfinite(heights_m)]
    if len(measured) < MIN_PIXELS or np.median(measured) < 2 * GROUND_M:
        return np.zeros_like(inside)
    return inside & (heights_m < GROUND_M)


def is_speck(
    box: npt.NDArray[np.int32],
    inside: Mask,
    frame: Frame,
    window: tuple[slice, slice],
    least_m: float,
) -> bool:
    """Whether a region, of which the picture's border hides nothing, is shorter than the least size
    of a thing of its class.

    Its length is that across the line of sight or, of what lies on the floor and leads away from
    the camera, that along it.
    """
    left, top, width, height = (int(value) for value in box[:4])
    if (
        left == 0
        or top == 0
        or left + width == frame.intrinsics.width
        or top + height == frame.intrinsics.height
    ):
        return False
    depths = frame.depth_m[window][inside]
    depths = depths[depths > 0]
    if len(depths) == 0:
        return False
    near, middle, far = np.percentile(depths, (10, 50, 90))
    return bool(max(max(width, height) * middle / frame.intrinsics.fx, far - near) < least_m)


def remove_small_regions(mask: Mask, frame: Frame, least_m: float) -> Mask:
    """The mask without the regions that `is_speck` says are some: all at once, for a floor may be
    full of them.

    Pixels that touch one another, at a corner too, or have one pixel between them, are a region.
    """
    close = cv2.dilate(mask.view(np.uint8), np.ones((3, 3), dtype=np.uint8))
    count, regions, boxes, _ = cv2.connectedComponentsWithStats(close, connectivity=8)
    left, top, width, height = boxes[:, :4].T
    # Each region is a pixel wider on every side than what it holds.
    at_border = (
        (left <= 1)
        | (top <= 1)
        | (left + width >= mask.shape[1] - 1)
        | (top + height >= mask.shape[0] - 1)
    )
    measured = mask & (frame.depth_m > 0)
    number, depths = regions[measured], frame.depth_m[measured]
    order = np.lexsort((depths, number))
    number, depths = number[order], depths[order]
    held = np.bincount(number, minlength=count)
    first = np.cumsum(held) - held
    some = np.flatnonzero(held)
    near, middle, far = (
        depths[first[some] + (held[some] * share).astype(np.int64)] for share in (0.1, 0.5, 0.9)
    )
    long_px = np.maximum(width, height)[some] - 2
    speck = np.zeros(count, dtype=np.bool_)
    speck[some] = ~at_border[some] & (
        np.maximum(long_px * middle / frame.intrinsics.fx, far - near) < least_m
    )
    return np.asarray(mask & ~speck[regions])


def is_flat(
    inside: Mask,
    unlabelled: Mask,
    depth_m: Heights,
    heights_m: Heights,
    frame: Frame,
    threshold_m: float,
) -> bool:
    """Whether a region (a mask of a window of the picture) certainly rises less than the threshold
    above its surroundings."""
    measured = inside & (depth_m > 0)
    size = int(measured.sum())
    if size < MIN_PIXELS or size < MIN_MEASURED * int(inside.sum()):
        return False
    if SURE_ERRORS * height_error_m(float(np.median(depth_m[measured])), frame) > threshold_m:
        return False
    wide = (
        cv2.dilate(
            inside.view(np.uint8), np.ones((2 * RING_PX + 1, 2 * RING_PX + 1), dtype=np.uint8)
        )
        > 0
    )
    ring = wide & ~inside & unlabelled & (depth_m > 0)
    if int(ring.sum()) < MIN_PIXELS:
        return False
    relief_m = np.percentile(heights_m[measured], 90) - np.percentile(heights_m[ring], 25)
    return bool(relief_m < threshold_m)


def depth_error_m(depth_m: float, frame: Frame) -> float:
    """Standard error of a depth."""
    return depth_m * depth_m * DISPARITY_ERROR_PX / (frame.intrinsics.fx * BASELINE_M)


def height_error_m(depth_m: float, frame: Frame) -> float:
    """Standard error of the height of a point on the floor: of the depth's error, the part along
    the vertical."""
    return depth_error_m(depth_m, frame) * abs(float(frame.T_map_camera[2, 3])) / depth_m


def _window(box: npt.NDArray[np.int32], shape: tuple[int, ...]) -> tuple[slice, slice]:
    left, top, width, height = (int(value) for value in box[:4])
    rows = slice(max(top - RING_PX, 0), min(top + height + RING_PX, shape[0]))
    return rows, slice(max(left - RING_PX, 0), min(left + width + RING_PX, shape[1]))
