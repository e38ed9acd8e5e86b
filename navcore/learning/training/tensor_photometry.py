"""The changes of colours in training (`augmentation`, `learning.data.photometry`), for a whole
batch on the device that trains. Each image has parameters of its own.

Colours are (B, 3, H, W) float32 levels from 0 to 255, rounded to whole ones at each step, as images
are.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from navcore.learning.data.photometry import GAMMA, channel_light
from navcore.learning.training.augmentation import HUE_CIRCLE


def tinted(rgb: Tensor, factors: Tensor) -> Tensor:
    """Multiply hue, saturation and value by the factors (B, 3) and clip; hue does not wrap
    around."""
    hue, saturation, value = _hsv(rgb / 255)
    by_hue, by_saturation, by_value = factors[:, :, None, None].unbind(1)
    colours = _rgb(
        (hue * by_hue).clamp(max=HUE_CIRCLE),
        (saturation * by_saturation).clamp(max=1),
        (value * by_value).clamp(max=1),
    )
    return torch.round(colours * 255)


def motion_blurred(rgb: Tensor, across_px: Tensor) -> Tensor:
    """Return images that moved across the columns by (B,) pixels while they were exposed."""
    half = int(torch.ceil(across_px.max() / 2 + 0.5))
    edges = torch.arange(-half, half + 2, device=rgb.device) - 0.5
    # The share of each column is the overlap of its pixel with the way, at least that of itself.
    reach = across_px.clamp(min=1e-3)[:, None] / 2
    shares = (torch.minimum(edges[1:], reach) - torch.maximum(edges[:-1], -reach)).clamp(min=0)
    shares = shares / shares.sum(1, keepdim=True)
    padded = functional.pad(rgb, (half, half, 0, 0), mode="replicate")
    blurred = torch.zeros_like(rgb)
    for column in range(2 * half + 1):
        share = shares[:, column, None, None, None]
        blurred += share * padded[..., column : column + rgb.shape[-1]]
    return torch.round(blurred)


def filtered(rgb: Tensor, strength: Tensor, normal: Tensor) -> Tensor:
    """Return images that are correlated with the kernels `photometry.random_kernel` of (B,)
    strengths and (B, n, n) standard normal numbers."""
    count, side = len(rgb), normal.shape[-1]
    kernels = strength[:, None, None] * normal / side
    kernels[:, side // 2, side // 2] += 1 - strength
    kernels += (1 - kernels.sum((1, 2), keepdim=True)) / side**2
    padded = functional.pad(rgb, (side // 2,) * 4, mode="replicate")
    levels = functional.conv2d(
        padded.transpose(0, 1).contiguous(), kernels[:, None], groups=count
    ).transpose(0, 1)
    return torch.round(levels.clamp(0, 255))


def exposed(rgb: Tensor, light: Tensor, white_k: Tensor) -> Tensor:
    """Return images at (B,) times the amount of light of a good exposure, in light of (B,) colour
    temperatures in kelvin; what is too bright is clipped."""
    channels = torch.tensor([channel_light(kelvin).tolist() for kelvin in white_k.tolist()])
    factors = (light[:, None] * channels.to(light)) ** (1 / GAMMA)
    return torch.round((rgb * factors[:, :, None, None]).clamp(0, 255))


def _hsv(rgb: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return hue in degrees, saturation and value of colours from 0 to 1."""
    value, largest = rgb.max(dim=1)
    span = value - rgb.amin(dim=1)
    red, green, blue = rgb.unbind(1)
    divisor = span.clamp(min=1e-9)
    sixth = torch.where(
        largest == 0,
        (green - blue) / divisor,
        torch.where(largest == 1, 2 + (blue - red) / divisor, 4 + (red - green) / divisor),
    )
    return sixth * 60 % HUE_CIRCLE, span / value.clamp(min=1e-9), value


def _rgb(hue: Tensor, saturation: Tensor, value: Tensor) -> Tensor:
    def channel(offset: int) -> Tensor:
        k = (offset + hue / 60) % 6
        return value - value * saturation * torch.minimum(k, 4 - k).clamp(0, 1)

    return torch.stack([channel(5), channel(3), channel(1)], dim=1)
