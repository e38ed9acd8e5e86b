"""Validation images: what the network finds in the frames that were held back."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from app.teaching.training.progress import LOOKS_NAME
from navcore.learning.data.images import LabelArray, RgbArray, write_rgb
from web.interface.teaching import NOTHING_NAME

AT_MOST = 6
"""Largest number of validation images."""
TINT = 0.55
"""Share of the tint in the pixels of a class."""


def write_validation_images(
    folder: Path,
    images: Sequence[RgbArray],
    found: Sequence[LabelArray],
    class_names: Sequence[str],
) -> int:
    """Write up to six images, their classes tinted, and return their number.

    `images` are (H, W, 3), `found` (h, w) classes 0 … C−1 of any size.
    """
    colours = _colours(class_names)
    (folder / LOOKS_NAME).mkdir(exist_ok=True)
    pairs = list(zip(images, found, strict=True))[:AT_MOST]
    for number, (rgb, classes) in enumerate(pairs):
        shape = (rgb.shape[1], rgb.shape[0])
        whole = cv2.resize(classes, shape, interpolation=cv2.INTER_NEAREST)
        tints = colours[whole]
        shown = (tints.sum(axis=2) > 0)[..., None]
        mixed = (1 - TINT) * rgb + TINT * tints
        tinted = np.where(shown, mixed, rgb).astype(np.uint8)
        write_rgb(folder / LOOKS_NAME / f"{number}.png", tinted)
    return len(pairs)


def _colours(class_names: Sequence[str]) -> npt.NDArray[np.float64]:
    """Return (256, 3) one colour per class; black for `background`."""
    hues = np.arange(256) * 137 % 180  # the golden angle keeps neighbours apart
    hsv = np.stack([hues, np.full(256, 230), np.full(256, 255)], axis=1).astype(np.uint8)
    rgb = cv2.cvtColor(hsv[None], cv2.COLOR_HSV2RGB)[0].astype(np.float64)
    for index, name in enumerate(class_names):
        if name == NOTHING_NAME:
            rgb[index] = 0
    return np.asarray(rgb)
