"""Label pixels: which of them show something on the beware list (the paper's equation for the mask
M_c)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
import numpy.typing as npt

from navcore.mission.beware_list import NOTHING, BewareClass, BewareList, ColourRule
from navcore.perception.depth_filter import Heights, heights_above_floor, remove_small_regions
from navcore.perception.ground import ground_heights
from navcore.perception.labels import Labels, LabelSource, with_full_confidence
from navcore.perception.overhang_filter import base_regions
from navcore.robot.frame import Frame

STEEPEST = 0.2
"""What rises or falls by no more than this per metre may be ground with something painted on it."""
TALL_M = 0.1
"""What rises by so much more than a marking can is an obstacle, however depth errs."""
PERSON_SURE = 0.5
"""So sure a network must be of a person for him to be followed, and for the colour of his shoes to
be no floor's."""
UNDECIDED = np.nextafter(np.float32(0.5), np.float32(0))
"""Confidence of what speaks neither for a thing nor against it: its log-odds are 0, and it binds
nobody who asks for a half."""


ColourMask = tuple[BewareClass, npt.NDArray[np.bool_]]
"""An entry of the list, and (H, W) the pixels that fit its colour rule."""


class ColourSegmenter:
    """Labels by the colour rules of the beware list; where rules overlap, the first that is enabled
    shows."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Exact: a pixel fits a rule or it does not, so its confidence is 1."""
        coats = colour_masks(frame, heights_above_floor(frame), beware.classes)
        shown, hypotheses = (
            topmost_label(coats, frame.depth_m.shape),
            by_colour(coats, frame.depth_m.shape),
        )
        return dataclasses.replace(
            with_full_confidence(shown), hypotheses=hypotheses if len(hypotheses) > 1 else ()
        )

    def finds(self, entry: BewareClass) -> LabelSource:
        """A rule, where the entry has one."""
        return LabelSource.NOTHING if entry.colour is None else LabelSource.COLOUR


def topmost_label(coats: Sequence[ColourMask], shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
    """(H, W) the class id of the first coat that is enabled, else of the first."""
    class_ids = np.full(shape, NOTHING, dtype=np.uint8)
    first_shows = sorted(coats, key=lambda coat: not coat[0].enabled)
    for entry, fits in first_shows[::-1]:
        class_ids[fits] = entry.class_id
    return class_ids


def by_colour(coats: Sequence[ColourMask], shape: tuple[int, ...]) -> tuple[Labels, ...]:
    """The coats as claims, as few as hold them all: those share one that lie beside each other."""
    layers: list[npt.NDArray[np.uint8]] = []
    for entry, fits in coats:
        layer = next((layer for layer in layers if not layer[fits].any()), None)
        if layer is None:
            layers.append(layer := np.full(shape, NOTHING, dtype=np.uint8))
        layer[fits] = entry.class_id
    return tuple(map(with_full_confidence, layers))


def colour_masks(
    frame: Frame, heights_m: Heights, entries: Iterable[BewareClass]
) -> list[ColourMask]:
    """Each entry whose colour rule some pixel fits, in their order, and (H, W) which pixels; none
    higher than the rule allows.

    Higher than the ground there, that is, which may rise or fall before the robot; nor the foot of
    something of that colour.
    """
    hsv = np.asarray(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2HSV), dtype=np.uint8)
    coats = []
    for entry in entries:
        if entry.colour is None:
            continue
        fits = _matches(hsv, entry.colour)
        low, above = fits, heights_m
        if (fits & (above > entry.colour.max_height_m)).any():
            above = heights_m - ground_heights(frame, STEEPEST)
            low = fits & ~(above > entry.colour.max_height_m)
        if entry.min_size_m is not None and low.any():
            low = remove_small_regions(low, frame, entry.min_size_m)
        tall = fits & (above > entry.colour.max_height_m + TALL_M)
        if tall.any():
            low &= ~base_regions(low, tall, frame)
        if low.any():
            coats.append((entry, low))
    return coats


def _matches(hsv: npt.NDArray[np.uint8], rule: ColourRule) -> npt.NDArray[np.bool_]:
    """(H, W) pixels that fit; OpenCV keeps hue in steps of 2°, saturation and value in 0…255."""
    first, last = (round(hue / 2) for hue in rule.hue_deg)
    floor = (round(rule.min_saturation * 255), round(rule.min_value * 255))
    # Whether the range wraps is told by the rule, not by its rounding: 0.5° to 0° goes once around.
    wraps = rule.hue_deg[0] > rule.hue_deg[1]
    spans = [(first, 180), (0, last)] if wraps else [(first, last)]
    if last == 180:
        spans.append((0, 0))  # 360° is 0°
    mask = np.zeros(hsv.shape[:2], dtype=np.bool_)
    for low, high in spans:
        mask |= cv2.inRange(hsv, np.array([low, *floor]), np.array([high, 255, 255])) > 0
    return mask
