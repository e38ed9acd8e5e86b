"""What the colour camera makes of the light: its exposure, its white balance, its motion blur."""

from __future__ import annotations

from navcore.learning.data.photometry import NEUTRAL_K, exposed, motion_blurred
from sim.rendering.lighting import Lighting
from sim.sensors.stereo_noise import Rgb


def expose(rgb: Rgb, lighting: Lighting, speed_px: float) -> Rgb:
    """Return (H, W, 3) colours with the exposure time and amount of a light, the image moving
    across the columns at `speed_px` pixels per second."""
    rgb = motion_blurred(rgb, speed_px * lighting.exposure_ms / 1000)
    if lighting.exposure == 1.0 and lighting.white_k == NEUTRAL_K:
        return rgb
    return exposed(rgb, lighting.exposure, lighting.white_k)
