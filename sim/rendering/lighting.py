"""Light that makes seeing hard, and what a colour camera makes of it: lamps and their shadows, a
polished floor, exposure, motion blur, a wrong white balance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from navcore.learning.data.photometry import NEUTRAL_K
from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class Lighting:
    """Light of a world beyond its daylight, and settings of the colour camera; the defaults change
    nothing. Depth is not affected."""

    lamp_spacing_m: float = ranged(0.0, 50.0, default=0.0)
    """Distance between the ceiling lamps, which stand in a square grid; 0 for none."""
    lamp_offset_m: tuple[float, float] = ranged(-50.0, 50.0, default=(0.0, 0.0))
    """Position of one lamp, x and y of the map."""
    lamp_height_m: float = ranged(1.0, 20.0, default=2.5)
    """Height of the lamps above the floor."""
    shade: float = ranged(0.0, 1.0, default=0.4)
    """Brightness of what no lamp reaches, relative to the floor below one."""
    polish: float = ranged(0.0, 1.0, default=0.0)
    """Share of the light that a flat floor mirrors at a grazing angle; less from above."""
    exposure: float = ranged(0.02, 50.0, default=1.0)
    """Amount of light that the camera takes in, relative to a good exposure."""
    exposure_ms: float = ranged(0.0, 100.0, default=0.0)
    """Time for which it takes it in, milliseconds: a robot that turns blurs the image."""
    white_k: float = ranged(2000.0, 15_000.0, default=NEUTRAL_K)
    """Colour temperature of the light in kelvin, which the camera takes for neutral daylight."""


PLAIN = Lighting()
"""Nothing beyond daylight."""
DISTURBANCES: Mapping[str, Lighting] = {
    "none": PLAIN,
    "lamps": Lighting(lamp_spacing_m=4.0, shade=0.35),
    "polished floor": Lighting(polish=0.6),
    "polished floor under lamps": Lighting(polish=0.6, lamp_spacing_m=4.0, shade=0.6),
    "dark": Lighting(exposure=0.2),
    "overexposed": Lighting(exposure=3.0),
    "motion blur": Lighting(exposure_ms=30.0),
    "warm light": Lighting(white_k=3200.0),
    "cold light": Lighting(white_k=9000.0),
}
"""Disturbances that are measured one by one."""


def random_lighting(rng: np.random.Generator) -> Lighting:
    """Return a random light, in which each disturbance is absent about half of the time."""
    present = rng.random(5) < 0.5
    spacing_m, shade, polish = rng.uniform(2.5, 6.0), rng.uniform(0.2, 0.7), rng.uniform(0.1, 0.7)
    offset = rng.uniform(-3.0, 3.0, 2)
    exposure, exposure_ms = np.exp(rng.uniform(np.log(0.2), np.log(3.0))), rng.uniform(5.0, 35.0)
    white_k = 1e6 / rng.uniform(1e6 / 9000.0, 1e6 / 2800.0)
    return Lighting(
        lamp_spacing_m=float(spacing_m) if present[0] else 0.0,
        lamp_offset_m=(float(offset[0]), float(offset[1])),
        shade=float(shade),
        polish=float(polish) if present[1] else 0.0,
        exposure=float(exposure) if present[2] else 1.0,
        exposure_ms=float(exposure_ms) if present[3] else 0.0,
        white_k=float(white_k) if present[4] else NEUTRAL_K,
    )
