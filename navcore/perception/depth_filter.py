"""Labels that depth refutes: a print of a cup on the floor is no cup.

A network may take an image of an object for the object. Where a class has a least height, a region
of it that lies flat in the floor around it is rejected, but only where depth is measured and
accurate enough to decide; undecided regions stay. Nor is a surface the object that is longer than
any of its class, or what a label covers beyond the outline of the object, far behind it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.config.perception.perception import DEFAULT_PERCEPTION, DepthFilterConfig
from navcore.geometry.arrays import Bools, FloatImage
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.robot.frame import Frame
from navcore.robot.profile import DepthSensor

_DEFAULT = DEFAULT_PERCEPTION.depth
_FAR_M = 1000.0
"""Marker farther than any depth, in metres."""
_MIN_CAMERA_HEIGHT_M = 0.1
"""Least camera height in metres that a recession of the floor is divided by."""


def heights_above_floor(frame: Frame) -> FloatImage:
    """Return the (H, W) z in metres of the map frame; NaN where no depth was measured."""
    lens, up = frame.intrinsics, frame.T_map_camera[2]
    across = ((up[0] / lens.fx) * (np.arange(lens.width) - lens.cx)).astype(np.float32)
    down = ((up[1] / lens.fy) * (np.arange(lens.height) - lens.cy) + up[2]).astype(np.float32)
    return np.asarray(_heights_on_rays(frame.depth_m, across, down, np.float32(up[3])))


@compiled
def _heights_on_rays(
    depth_m: FloatImage, across: FloatImage, down: FloatImage, camera_m: np.float32
) -> FloatImage:
    """Return the height of each pixel; `across` and `down` are what a column and a row add to the
    rise of its line of sight, `camera_m` is the height of the camera."""
    heights = np.empty_like(depth_m)
    for i in range(depth_m.shape[0]):
        for j in range(depth_m.shape[1]):
            depth = depth_m[i, j]
            heights[i, j] = (
                depth * (down[i] + across[j]) + camera_m if depth > 0 else np.float32(np.nan)
            )
    return heights


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Region:
    """A connected region of one class, in a window of the image that is wider than its box."""

    box: tuple[int, int, int, int]
    """Column, row, width and height of its bounding box in pixels of the image."""
    inside: Bools
    """(h, w) pixels of the region."""
    unlabelled: Bools
    """(h, w) pixels without a class."""
    depth_m: FloatImage
    """(h, w) depth in metres."""
    heights_m: FloatImage
    """(h, w) height above the floor in metres."""


def reject_flat_regions(
    class_ids: npt.NDArray[np.uint8],
    frame: Frame,
    heights_m: FloatImage,
    beware: BewareList,
    sensor: DepthSensor,
    config: DepthFilterConfig = _DEFAULT,
) -> Bools:
    """Return the (H, W) pixels that keep their class: all but flat prints, small regions, surfaces
    that are too long, and the floor at the foot of tall objects.

    Regions are connected pixels of one class that has a `min_height_m`, a `min_size_m` or a
    `max_size_m`; `heights_m` is that of `heights_above_floor`.
    """
    keep = np.ones(class_ids.shape, dtype=np.bool_)
    ring_px = frame.intrinsics.length_px(config.ring_px)
    for entry in beware.classes:
        if entry.min_height_m is entry.min_size_m is entry.max_size_m is None:
            continue
        mask = class_ids == entry.class_id
        if not mask.any():
            continue
        if entry.min_size_m is not None:
            whole, mask = mask, remove_small_regions(mask, frame, entry.min_size_m)
            keep &= ~whole | mask
        if entry.min_height_m is entry.max_size_m is None:
            continue
        count, names, boxes, _ = cv2.connectedComponentsWithStats(
            mask.view(np.uint8), connectivity=8
        )
        for name in range(1, count):
            left, top, width, height, area = (int(value) for value in boxes[name])
            window = _window((left, top, width, height), class_ids.shape, ring_px)
            region = _Region(
                box=(left, top, width, height),
                inside=names[window] == name,
                unlabelled=class_ids[window] == NOTHING,
                depth_m=frame.depth_m[window],
                heights_m=heights_m[window],
            )
            if entry.max_size_m is not None:
                keep[window] &= ~_long_surfaces(region, frame, entry.max_size_m, config)
            if entry.min_height_m is None or area < config.min_pixels:
                continue
            threshold_m = min(config.relief_share * entry.min_height_m, config.max_flat_m)
            if _is_flat(region, frame, threshold_m, config, sensor):
                keep[window] &= ~region.inside
            elif entry.min_height_m >= config.tall_m:
                keep[window] &= ~_floor_at_foot(region, config)
    return keep


def trim_label_bleed(
    class_ids: npt.NDArray[np.uint8], frame: Frame, config: DepthFilterConfig = _DEFAULT
) -> Bools:
    """Return the (H, W) pixels that keep their class: all but those near the rim of a label that
    lie far behind its object.

    A network rounds the outline of an object; the floor behind it would be an object of its own on
    the map.
    """
    keep = np.ones(class_ids.shape, dtype=np.bool_)
    reach = max(1, round(config.bleed_rad * frame.intrinsics.fx))
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), dtype=np.uint8)
    recession = _recession(frame, reach, config)
    for class_id in np.flatnonzero(np.bincount(class_ids.ravel())).tolist():
        if class_id == NOTHING:
            continue
        whole = class_ids == class_id
        left, top, width, height = cv2.boundingRect(whole.view(np.uint8))
        window = _window((left, top, width, height), whole.shape, reach)
        inside, depth_m = whole[window], frame.depth_m[window]
        measured = np.where(inside & (depth_m > 0), depth_m, np.float32(_FAR_M))
        nearest = cv2.erode(measured, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=_FAR_M)
        # The border of the image is no rim.
        rim = cv2.erode(np.ascontiguousarray(inside).view(np.uint8), kernel) == 0
        behind = depth_m > nearest + np.maximum(config.bleed_jump_m, recession * nearest**2)
        keep[window] &= ~(inside & rim & behind)
    return keep


def remove_small_regions(mask: Bools, frame: Frame, min_size_m: float) -> Bools:
    """Return the (H, W) mask without its regions that are shorter than the least size in metres:
    all at once, for a floor may have many of them.

    Their length is that across the line of sight or, of what lies on the floor and leads away from
    the camera, that along it. Pixels that touch one another, at a corner too, or have up to two
    pixels between them, are a region: far off, a cable is thinner than a pixel and its label a row
    of pieces. Regions at the border of the image and without a measured pixel stay.
    """
    close = cv2.dilate(mask.view(np.uint8), np.ones((3, 3), dtype=np.uint8))
    count, names, boxes, _ = cv2.connectedComponentsWithStats(close, connectivity=8)
    left, top, width, height = boxes[:, :4].T
    # Each region was dilated by a pixel on every side.
    at_border = (
        (left <= 1)
        | (top <= 1)
        | (left + width >= mask.shape[1] - 1)
        | (top + height >= mask.shape[0] - 1)
    )
    measured = mask & (frame.depth_m > 0)
    name, depths = names[measured], frame.depth_m[measured]
    order = np.lexsort((depths, name))
    name, depths = name[order], depths[order]
    sizes = np.bincount(name, minlength=count)
    first = np.cumsum(sizes) - sizes
    some = np.flatnonzero(sizes)
    near, middle, far = (
        depths[first[some] + (sizes[some] * share).astype(np.int64)] for share in (0.1, 0.5, 0.9)
    )
    long_px = np.maximum(width, height)[some] - 2
    is_small = np.zeros(count, dtype=np.bool_)
    is_small[some] = ~at_border[some] & (
        np.maximum(long_px * middle / frame.intrinsics.fx, far - near) < min_size_m
    )
    return np.asarray(mask & ~is_small[names])


def _recession(frame: Frame, reach_px: int, config: DepthFilterConfig) -> float:
    """Return the factor of z² by which depth z may grow within some pixels of one surface.

    Along the floor it grows by z² / (focal length · camera height) from one row of pixels to the
    next.
    """
    camera_m = max(float(frame.T_map_camera[2, 3]), _MIN_CAMERA_HEIGHT_M)
    return config.bleed_factor * reach_px / (frame.intrinsics.fy * camera_m)


def _long_surfaces(
    region: _Region, frame: Frame, max_size_m: float, config: DepthFilterConfig
) -> Bools:
    """Return the (h, w) pixels of a region on surfaces that are longer than the greatest size of
    its class, across the line of sight or along it.

    A surface ends where depth jumps: an object before another is not longer by that one.
    """
    depth_m, kernel = region.depth_m, np.ones((3, 3), dtype=np.uint8)
    measured = region.inside & (depth_m > 0)
    farthest = cv2.dilate(np.where(measured, depth_m, np.float32(0)), kernel)
    nearest = cv2.erode(np.where(measured, depth_m, np.float32(_FAR_M)), kernel)
    jump_m = np.maximum(config.bleed_jump_m, _recession(frame, 1, config) * depth_m**2)
    surface = measured & (farthest - nearest < jump_m)
    count, names, boxes, _ = cv2.connectedComponentsWithStats(
        surface.view(np.uint8), connectivity=8
    )
    is_long = np.zeros(count, dtype=np.bool_)
    for name in range(1, count):
        width_px, area = boxes[name, cv2.CC_STAT_WIDTH], boxes[name, cv2.CC_STAT_AREA]
        if area >= config.min_pixels:
            near, middle, far = np.percentile(depth_m[names == name], (10, 50, 90))
            is_long[name] = max(width_px * middle / frame.intrinsics.fx, far - near) > max_size_m
    long = is_long[names]
    rim = (cv2.dilate(long.view(np.uint8), kernel) > 0) & region.inside & ~surface
    return np.asarray(long | rim)


def _is_flat(
    region: _Region,
    frame: Frame,
    threshold_m: float,
    config: DepthFilterConfig,
    sensor: DepthSensor,
) -> bool:
    """Return whether a region certainly rises less than the threshold above its surroundings."""
    measured = region.inside & (region.depth_m > 0)
    size = int(measured.sum())
    if size < config.min_pixels or size < config.min_measured * int(region.inside.sum()):
        return False
    error_m = _height_error_m(float(np.median(region.depth_m[measured])), frame, sensor)
    if config.min_standard_errors * error_m > threshold_m:
        return False
    side = 2 * frame.intrinsics.length_px(config.ring_px) + 1
    wide = cv2.dilate(region.inside.view(np.uint8), np.ones((side, side), dtype=np.uint8)) > 0
    ring = wide & ~region.inside & region.unlabelled & (region.depth_m > 0)
    if int(ring.sum()) < config.min_pixels:
        return False
    heights_m = region.heights_m
    relief_m = np.percentile(heights_m[measured], 90) - np.percentile(heights_m[ring], 25)
    return bool(relief_m < threshold_m)


def _floor_at_foot(region: _Region, config: DepthFilterConfig) -> Bools:
    """Return the (h, w) pixels of a region on the ground, where most of it is well above: the floor
    that its label covers.

    On the map a flat point of the list stays; a person who walks by must not leave a trail of them.
    """
    measured = region.heights_m[region.inside & np.isfinite(region.heights_m)]
    if len(measured) < config.min_pixels or np.median(measured) < 2 * config.ground_m:
        return np.zeros_like(region.inside)
    return region.inside & (region.heights_m < config.ground_m)


def _height_error_m(depth_m: float, frame: Frame, sensor: DepthSensor) -> float:
    """Return the standard error in metres of the height of a point on the floor: the vertical part
    of the depth error."""
    depth_error_m = sensor.depth_error_m(depth_m, frame.intrinsics.fx)
    return depth_error_m * abs(float(frame.T_map_camera[2, 3])) / depth_m


def _window(
    box: tuple[int, int, int, int], shape: tuple[int, ...], margin_px: int
) -> tuple[slice, slice]:
    """Return the rows and columns of a bounding box with a margin, clipped to the image."""
    left, top, width, height = box
    rows = slice(max(top - margin_px, 0), min(top + height + margin_px, shape[0]))
    return rows, slice(max(left - margin_px, 0), min(left + width + margin_px, shape[1]))
