"""Region around a clicked pixel of a stored frame, by colour and depth."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from app.teaching.rules import RegionRules
from navcore.errors import BadConfiguration, Refused

DEFAULT = RegionRules()
SEED_PX = 1
"""Pixels on each side of the clicked one whose mean colour is grown from."""


def grown_region(
    rgb: npt.NDArray[np.uint8],
    depth_mm: npt.NDArray[np.uint16],
    row: int,
    col: int,
    tolerance: float,
    rules: RegionRules = DEFAULT,
) -> npt.NDArray[np.bool_]:
    """Return the (H, W) pixels that are connected with (row, col), within `tolerance` of its colour
    in CIELAB, and without a step of depth between neighbours.

    Where the clicked pixel has no depth, colour alone decides. Raises `BadConfiguration` for a
    pixel outside the image, `Refused` for a region that takes half of it.
    """
    height, width = depth_mm.shape
    if not (0 <= row < height and 0 <= col < width):
        raise BadConfiguration(f"pixel ({row}, {col}) lies outside the image of {height} × {width}")
    lab = cv2.cvtColor(rgb.astype(np.float32) / np.float32(255), cv2.COLOR_RGB2LAB)
    around = lab[
        max(row - SEED_PX, 0) : row + SEED_PX + 1, max(col - SEED_PX, 0) : col + SEED_PX + 1
    ]
    fits = np.linalg.norm(lab - around.reshape(-1, 3).mean(axis=0), axis=2) <= tolerance
    fits[row, col] = True
    region = _connected(fits, depth_mm, row, col, rules)
    if region.mean() > rules.max_share:
        raise Refused(
            f"the region takes {region.mean():.0%} of the image; take a smaller tolerance, "
            "or use the brush"
        )
    return region


def _connected(
    fits: npt.NDArray[np.bool_],
    depth_mm: npt.NDArray[np.uint16],
    row: int,
    col: int,
    rules: RegionRules,
) -> npt.NDArray[np.bool_]:
    """Return the part of a mask that is connected with a pixel, over no step of depth.

    The flood runs over the logarithm of the depth, so that a step grows with the distance.
    """
    outside = np.pad(~fits, 1, constant_values=True).astype(np.uint8)
    if depth_mm[row, col]:
        near = np.log(np.maximum(depth_mm, 1).astype(np.float32) / np.float32(1000))
        step = float(np.log1p(rules.depth_step_m))
    else:
        near, step = np.zeros(depth_mm.shape, dtype=np.float32), 1.0
    flags = 4 | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
    cv2.floodFill(near, outside, (col, row), 0.0, step, step, flags)
    return np.asarray(outside[1:-1, 1:-1] == 2)
