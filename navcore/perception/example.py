"""Region of a thing from a click: grown by depth and colour."""

from __future__ import annotations

import cv2
import numpy as np

from navcore.config.perception import DEFAULT_PERCEPTION
from navcore.config.prototype import PrototypeConfig
from navcore.errors import Refused
from navcore.geometry.arrays import Bools
from navcore.perception.depth_filter import heights_above_floor
from navcore.perception.prototype import extent_m, lab_image
from navcore.robot.frame import Frame

_DEFAULT = DEFAULT_PERCEPTION.prototype
_FILL = 8 | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
"""Flags of a flood fill over eight neighbours that marks its pixels with 2."""


def grown(frame: Frame, row: int, col: int, config: PrototypeConfig = _DEFAULT) -> Bools:
    """Return the (H, W) pixels of the thing at a pixel: those above the floor that are connected
    with it without a step of depth, and among them without a step of colour, holes filled.

    Raises `Refused` with the reason where there is no thing of its own.
    """
    heights_m = heights_above_floor(frame)
    if frame.depth_m[row, col] <= 0:
        raise Refused(
            "the camera has measured no distance there; click nearer to the middle of the thing"
        )
    if frame.depth_m[row, col] > config.max_range_m:
        raise Refused(f"that is farther away than {config.max_range_m:g} m; drive nearer")
    if heights_m[row, col] < config.floor_m:
        raise Refused(
            "there is only floor there; click a thing that stands on it, or make a colour rule for "
            "a marking"
        )
    inside = _flooded(
        np.ascontiguousarray(frame.depth_m),
        heights_m >= config.floor_m,
        row,
        col,
        config.depth_step_m,
    )
    colour = cv2.bilateralFilter(lab_image(frame), 5, 2 * config.colour_step, 2)
    pixels = _without_holes(_flooded(colour, inside, row, col, config.colour_step)) & inside
    width_m = extent_m(pixels, frame)
    if width_m > config.max_extent_m:
        raise Refused(
            f"what was clicked is {width_m:.1f} m wide: furniture or a wall, which are obstacles "
            "anyway; click the middle of a smaller thing"
        )
    return pixels


def _flooded(image: np.ndarray, allowed: Bools, row: int, col: int, step: float) -> Bools:
    """Return the (H, W) allowed pixels that are connected with one without a larger step."""
    mask = np.pad(~allowed, 1, constant_values=True).astype(np.uint8)
    steps = (step,) * (image.shape[2] if image.ndim == 3 else 1)
    cv2.floodFill(image.copy(), mask, (col, row), 0.0, steps, steps, _FILL)
    return np.asarray(mask[1:-1, 1:-1] == 2)


def _without_holes(pixels: Bools) -> Bools:
    """Return pixels with the holes that they enclose, and narrow gaps, filled."""
    closed = cv2.morphologyEx(
        pixels.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8)
    )
    outlines, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(closed, outlines, -1, 1, cv2.FILLED) > 0)
