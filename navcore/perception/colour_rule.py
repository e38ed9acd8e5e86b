"""Colour rule from a clicked pixel: the connected region of nearly its colour, and the range of
hue, saturation and value that contains it."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import DEFAULT_PERCEPTION, ColourPickingConfig
from navcore.errors import Refused
from navcore.geometry.arrays import Bools, FloatImage, Floats
from navcore.mission.beware_list import FLAT_M, ColourRule
from navcore.perception.region_growing import grown

_DEFAULT = DEFAULT_PERCEPTION.colour_picking


def rule_at(
    row: int,
    col: int,
    *,
    rgb: npt.NDArray[np.uint8],
    heights_m: FloatImage,
    config: ColourPickingConfig = _DEFAULT,
) -> ColourRule:
    """Return the rule of the region around a pixel of an (H, W, 3) image; `heights_m` is (H, W)
    above the floor, not finite where nothing was measured. It counts alone, whatever a network says
    of what the operator has pointed at.

    Raises `Refused` for a pixel that is too grey or too dark to have a hue.
    """
    hue, saturation, value = _hsv(rgb)
    height, width = hue.shape
    around = (
        slice(max(row - 1, 0), min(row + 2, height)),
        slice(max(col - 1, 0), min(col + 2, width)),
    )
    # The median of hue is that of the differences to the clicked pixel: hue is an angle.
    seed = float(hue[row, col] + np.median(_turn(hue[around], float(hue[row, col]))))
    sure, bright = float(np.median(saturation[around])), float(np.median(value[around]))
    if bright < config.min_value:
        raise Refused("what was clicked is too dark to have a colour; click something brighter")
    if sure < config.min_saturation:
        raise Refused("what was clicked is too grey to have a colour; click something coloured")
    near = (
        (np.abs(_turn(hue, seed)) <= config.hue_deg)
        & (np.abs(saturation - sure) <= config.saturation)
        & (np.abs(value - bright) <= config.value)
    )
    near[row, col] = True
    region = grown(row, col, _closed(near)) & near
    turns = _turn(hue[region], seed)
    share = (100 * config.outside_share, 100 * (1 - config.outside_share))
    low, high = np.percentile(turns, share)
    first, last = low - config.slack_deg, high + config.slack_deg
    least = [
        max(float(np.percentile(channel[region], share[0])) - config.slack, 0.0)
        for channel in (saturation, value)
    ]
    return ColourRule(
        hue_deg=(round((seed + first) % 360), round((seed + last) % 360)),
        min_saturation=round(least[0], 2),
        min_value=round(least[1], 2),
        max_height_m=_largest_height_m(heights_m[region], config),
        alone=True,
    )


def _hsv(rgb: npt.NDArray[np.uint8]) -> tuple[Floats, Floats, Floats]:
    """Return the hue in degrees, saturation and value, 0 to 1, of an image."""
    hsv = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV).astype(np.float64)
    return 2 * hsv[..., 0], hsv[..., 1] / 255, hsv[..., 2] / 255


def _turn(hue: Floats, from_deg: float) -> Floats:
    """Return the differences of hues in degrees, -180 to 180."""
    return (hue - from_deg + 180) % 360 - 180


def _closed(mask: Bools) -> Bools:
    """Return a mask with gaps of one pixel closed, because images are compressed and noisy."""
    kernel = np.ones((3, 3), dtype=np.uint8)
    return np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, kernel) > 0)


def _largest_height_m(heights_m: FloatImage, config: ColourPickingConfig) -> float:
    """Return the limit of height for a region: that of a marking where it is flat, else a little
    above its top."""
    known = heights_m[np.isfinite(heights_m)]
    top_m = float(np.percentile(known, 95)) if len(known) else 0.0
    return FLAT_M if top_m <= FLAT_M else round(min(top_m + config.above_m, 3.0), 2)
