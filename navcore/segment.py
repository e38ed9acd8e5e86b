"""Label pixels: which of them show something on the beware list (the paper's equation for the mask M_c)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from navcore.beware import NOTHING, BewareList, ColourRule
from navcore.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Labels:
    """What each pixel of a frame shows."""

    class_ids: npt.NDArray[np.uint8]
    """(H, W) class id of the beware list, `NOTHING` for everything else."""
    confidence: npt.NDArray[np.float32]
    """(H, W) how sure the segmenter is, 0 to 1."""


class Segmenter(Protocol):
    """Anything that labels the pixels of a frame. Enabled or not: every class of the list is labelled."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Labels of the same height and width as the frame."""


class ColourSegmenter:
    """Labels by the colour rules of the beware list; where rules overlap, the first of the list wins."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Exact: a pixel fits a rule or it does not, so its confidence is 1."""
        hsv = np.asarray(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2HSV), dtype=np.uint8)
        class_ids = np.full(hsv.shape[:2], NOTHING, dtype=np.uint8)
        for entry in reversed(beware.classes):
            if entry.colour is not None:
                class_ids[_matches(hsv, entry.colour)] = entry.class_id
        return Labels(class_ids=class_ids, confidence=np.ones(class_ids.shape, dtype=np.float32))


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
