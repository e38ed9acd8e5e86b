"""What a colour camera makes of the light: exposure, white balance and motion blur of images whose
levels are those of sRGB, about the power 1 / 2.2 of the amount of light."""

from __future__ import annotations

import math

import cv2
import numpy as np

from navcore.geometry.arrays import Floats
from navcore.learning.data.images import RgbArray

NEUTRAL_K = 5500.0
"""Colour temperature in kelvin of the light that is white to the camera."""
GAMMA = 2.2
"""Power of the level that the amount of light grows with."""
WAVELENGTHS_M = np.array([610e-9, 550e-9, 465e-9])
"""Wavelengths at which red, green and blue are most sensitive."""
KERNEL_SIDE = 5
"""Side of the random kernels in pixels."""
_HC_BY_K = 1.438777e-2
"""Second radiation constant, metre kelvin."""


def exposed(rgb: RgbArray, light: float, white_k: float = NEUTRAL_K) -> RgbArray:
    """Return (H, W, 3) colours at `light` times the amount of light of a good exposure, in light of
    a colour temperature in kelvin; what is too bright is clipped."""
    factors = (light * channel_light(white_k)) ** (1 / GAMMA)
    levels = np.rint(np.clip(np.arange(256)[:, None] * factors, 0, 255)).astype(np.uint8)
    return np.asarray(levels[rgb, np.arange(3)])


def channel_light(white_k: float) -> Floats:
    """Return (3,) the light of a black body in red, green and blue, relative to that of neutral
    daylight, green as 1 (Planck's law)."""
    relative = _planck(white_k) / _planck(NEUTRAL_K)
    return np.asarray(relative / relative[1])


def motion_blurred(rgb: RgbArray, across_px: float) -> RgbArray:
    """Return (H, W, 3) colours of an image that moved across the columns by so many pixels while it
    was exposed, as when the camera turns."""
    length = abs(across_px)
    if length < 1e-3:
        return rgb
    half = math.ceil(length / 2 + 0.5)
    # The share of each column is the overlap of its pixel with the way.
    edges = np.arange(-half, half + 2) - 0.5
    shares = np.clip(np.minimum(edges[1:], length / 2) - np.maximum(edges[:-1], -length / 2), 0, 1)
    kernel = (shares / shares.sum()).astype(np.float32)[None]
    return np.asarray(
        cv2.filter2D(rgb, -1, kernel, borderType=cv2.BORDER_REPLICATE), dtype=np.uint8
    )


def random_kernel(strength: float, normal: Floats) -> Floats:
    """Return a (n, n) kernel of sum 1: that which changes nothing at `strength` 0, one of random
    weights at 1. `normal`: (n, n) standard normal numbers."""
    side = len(normal)
    kernel = strength * normal / side
    kernel[side // 2, side // 2] += 1 - strength
    return np.asarray(kernel + (1 - kernel.sum()) / side**2)


def filtered(rgb: RgbArray, kernel: Floats) -> RgbArray:
    """Return (H, W, 3) colours that are correlated with a kernel of sum 1, the same for all
    channels: areas keep their colours, edges and textures look otherwise (a mild form of Xu et al.,
    Robust and Generalizable Visual Representation Learning via Random Convolutions, 2021)."""
    levels = cv2.filter2D(
        rgb.astype(np.float32), -1, kernel.astype(np.float32), borderType=cv2.BORDER_REPLICATE
    )
    return np.asarray(np.rint(np.clip(levels, 0, 255)), dtype=np.uint8)


def _planck(kelvin: float) -> Floats:
    return np.asarray(1 / (WAVELENGTHS_M**5 * np.expm1(_HC_BY_K / (WAVELENGTHS_M * kelvin))))
