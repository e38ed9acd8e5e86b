"""Colour rule from a clicked pixel: the connected region of nearly its colour, and the range of
hue, saturation and value that contains it. White and grey have no hue, black no saturation either,
so their regions differ from what is around them in value alone."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import DEFAULT_PERCEPTION, ColourPickingConfig
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
    is_black = bright < config.min_value
    has_hue = not is_black and sure >= config.min_saturation
    if has_hue:
        near = (np.abs(_turn(hue, seed)) <= config.hue_deg) & (
            np.abs(saturation - sure) <= config.saturation
        )
    else:
        near = (saturation < config.min_saturation) | is_black
    near &= np.abs(value - bright) <= (config.value if has_hue else config.grey_value)
    near[row, col] = True
    region = grown(row, col, _closed(near)) & near

    def limits(channel: Floats, slack: float) -> tuple[float, float]:
        share = (100 * config.outside_share, 100 * (1 - config.outside_share))
        low, high = np.percentile(channel[region], share)
        return float(low) - slack, float(high) + slack

    first, last = limits(_turn(hue, seed), config.slack_deg)
    saturations, values = (
        [round(min(max(end, 0.0), 1.0), 2) for end in limits(channel, config.slack)]
        for channel in (saturation, value)
    )
    return ColourRule(
        hue_deg=(round((seed + first) % 360), round((seed + last) % 360))
        if has_hue
        else (0.0, 360.0),
        min_saturation=saturations[0] if has_hue else 0.0,
        max_saturation=1.0 if has_hue or is_black else saturations[1],
        min_value=0.0 if is_black else values[0],
        max_value=1.0 if has_hue else values[1],
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
