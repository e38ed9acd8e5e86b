"""Labels by the colour rules of the beware list."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from functools import cache, partial
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import DEFAULT_PERCEPTION, PerceptionConfig
from navcore.geometry.arrays import Bools, FloatImage
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList, ColourPattern, ColourRule
from navcore.perception.colour_pattern import FloorGrid, line_pixels, pattern_pixels
from navcore.perception.depth_filter import heights_above_floor, remove_small_regions
from navcore.perception.ground import ground_heights
from navcore.perception.labels import Labels, LabelSource, with_full_confidence
from navcore.perception.overhang_filter import base_regions
from navcore.robot.frame import Frame

ColourMask = tuple[BewareClass, Bools]
"""An entry of the list, and the (H, W) pixels that fit its colour rule."""


class ColourSegmenter:
    """Segmenter by colour rules; where rules overlap, the first enabled one wins."""

    def __init__(self, config: PerceptionConfig = DEFAULT_PERCEPTION) -> None:
        self._config = config

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return the labels of a frame, with confidence 1: a pixel fits a rule or it does not."""
        masks = colour_masks(frame, heights_above_floor(frame), beware.classes, self._config)
        shape = frame.depth_m.shape
        labels, hypotheses = topmost_label(masks, shape), disjoint_layers(masks, shape)
        return dataclasses.replace(
            with_full_confidence(labels), hypotheses=hypotheses if len(hypotheses) > 1 else ()
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return whether an entry has a colour rule."""
        return LabelSource.NOTHING if entry.colour is None else LabelSource.COLOUR


def topmost_label(masks: Sequence[ColourMask], shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
    """Return the (H, W) class id of the first enabled mask, else of the first."""
    class_ids = np.full(shape, NOTHING, dtype=np.uint8)
    enabled_first = sorted(masks, key=lambda mask: not mask[0].enabled)
    for entry, fits in enabled_first[::-1]:
        class_ids[fits] = entry.class_id
    return class_ids


def disjoint_layers(masks: Sequence[ColourMask], shape: tuple[int, ...]) -> tuple[Labels, ...]:
    """Return the masks as labels: masks that do not overlap share a layer."""
    layers: list[npt.NDArray[np.uint8]] = []
    for entry, fits in masks:
        layer = next((layer for layer in layers if not layer[fits].any()), None)
        if layer is None:
            layers.append(layer := np.full(shape, NOTHING, dtype=np.uint8))
        layer[fits] = entry.class_id
    return tuple(map(with_full_confidence, layers))


def colour_masks(
    frame: Frame,
    heights_m: FloatImage,
    entries: Iterable[BewareClass],
    config: PerceptionConfig = DEFAULT_PERCEPTION,
) -> list[ColourMask]:
    """Return the entries whose colour rule some pixel fits, in their order, with these pixels; none
    higher than the rule allows.

    Heights are those above the ground below the pixel, which may rise or fall before the robot; the
    base of an obstacle of the same colour does not count. `heights_m` is that of
    `heights_above_floor`.
    """
    hsv = _hsv_planes(frame.rgb)
    matches, lines = cache(partial(_matches, hsv)), dict[ColourRule, Bools]()
    ground = cache(partial(ground_heights, frame, config.colour.max_slope, config.ground))
    masks, grid = [], None
    for entry in entries:
        if entry.colour is None:
            continue
        fits, max_height_m = matches(_ranges(entry.colour)), entry.colour.max_height_m
        if not fits.any():
            continue
        above = heights_m
        if (fits & (above > max_height_m)).any():
            above = heights_m - ground()
        floor = above <= max_height_m
        line, pattern = entry.colour.line, entry.colour.pattern
        if line is not None or pattern is not None:
            if not (fits & floor).any():
                continue
            grid = grid or FloorGrid.of(frame, config.colour)
            if line is not None:
                # Markings of the same lines share them, whatever pattern they form.
                rule = dataclasses.replace(entry.colour, pattern=None)
                if rule not in lines:
                    lines[rule] = line_pixels(fits, hsv[2], floor, grid, line)
                fits = lines[rule]
            if pattern is not None:
                other = matches(_ranges(pattern)) & ~fits
                fits = pattern_pixels(fits, other, floor, grid, pattern)
        low = fits & ~(above > max_height_m)
        if entry.min_size_m is not None and low.any():
            low = remove_small_regions(low, frame, entry.min_size_m)
        tall = fits & (above > max_height_m + config.colour.obstacle_above_m)
        if tall.any():
            low = low & ~base_regions(low, tall, frame, config.overhang)
        if low.any():
            masks.append((entry, low))
    return masks


def matches_colour(rgb: npt.NDArray[np.uint8], rule: ColourRule) -> Bools:
    """Return the (H, W) pixels of an (H, W, 3) image whose colour fits, at any height; one of both
    colours of a pattern, whether they alternate or not."""
    hsv = _hsv_planes(rgb)
    fits = _matches(hsv, _ranges(rule))
    return fits if rule.pattern is None else fits | _matches(hsv, _ranges(rule.pattern))


def _hsv_planes(rgb: npt.NDArray[np.uint8]) -> list[npt.NDArray[np.uint8]]:
    """Return (H, W) hue in steps of 2°, saturation and value in 0…255 of an (H, W, 3) image: apart,
    they are compared in vectors."""
    hsv = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV)
    return [np.asarray(plane, dtype=np.uint8) for plane in cv2.split(hsv)]


class _Ranges(NamedTuple):
    """Ranges of a colour, which many rules share."""

    hue_deg: tuple[float, float]
    saturation: tuple[float, float]
    value: tuple[float, float]


def _ranges(rule: ColourRule | ColourPattern) -> _Ranges:
    return _Ranges(
        hue_deg=rule.hue_deg,
        saturation=(rule.min_saturation, rule.max_saturation),
        value=(rule.min_value, rule.max_value),
    )


def _matches(hsv: list[npt.NDArray[np.uint8]], ranges: _Ranges) -> Bools:
    """Return the (H, W) pixels that fit, by their `_hsv_planes`."""
    hue, saturation, value = hsv
    first, last = (round(degrees / 2) for degrees in ranges.hue_deg)
    # The rule tells whether the range wraps, not its rounding: 0.5° to 0° goes once around.
    wraps = ranges.hue_deg[0] > ranges.hue_deg[1]
    spans = [(first, 180), (0, last)] if wraps else [(first, last)]
    if last == 180:
        spans.append((0, 0))  # 360° is 0°
    mask = np.zeros(hue.shape, dtype=np.bool_)
    for low, high in spans:
        mask |= (hue >= low) & (hue <= high)
    for plane, (least, most) in ((saturation, ranges.saturation), (value, ranges.value)):
        mask &= (plane >= round(least * 255)) & (plane <= round(most * 255))
    return mask
