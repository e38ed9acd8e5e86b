"""Perceptual comparison of screenshots: the mean colours of tiles, so that live text and another
rendering of a font make no difference, and a panel or a button that is gone does."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]

SCALE = 2
"""Pixels of the screen for one of a stored screenshot, along either side."""
TILE_PX = 12
"""Side of a tile in stored pixels."""
CHANGED = 16.0
"""Least difference of a tile's mean colour, 0 to 255 in the channel that differs most, that an eye
notices."""
MAX_CHANGED = 0.005
"""Largest share of the tiles that may differ: the button STOP alone is 0.8 % of the largest
screen."""


def changed_tiles(reference: Image, current: Image) -> npt.NDArray[np.bool_]:
    """Return (rows, cols) which tiles differ; all for images of different sizes.

    `reference`, `current`: (H, W, 3) colours as they are stored.
    """
    before = _tile_colours(reference)
    if reference.shape != current.shape:
        return np.ones(before.shape[:2], dtype=np.bool_)
    differs: npt.NDArray[np.bool_] = np.abs(before - _tile_colours(current)).max(axis=2) >= CHANGED
    return differs


def looks_alike(changed: npt.NDArray[np.bool_]) -> bool:
    """Return whether so few tiles have changed that the screen is the same to an eye."""
    return bool(changed.mean() <= MAX_CHANGED)


def marked(current: Image, changed: npt.NDArray[np.bool_]) -> Image:
    """Return the screenshot with what has not changed faded."""
    height, width = current.shape[:2]
    whole = cv2.resize(changed.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
    faded = (current // 3 + 90).astype(np.uint8)
    return np.where(whole[..., None] > 0, current, faded)


def _tile_colours(image: Image) -> npt.NDArray[np.float32]:
    rows, cols = (max(round(side / TILE_PX), 1) for side in image.shape[:2])
    tiles = cv2.resize(image.astype(np.float32), (cols, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(tiles, dtype=np.float32)
