"""Camera effects on rendered images: exposure, tint, uneven light, blur, noise, stereo errors."""

from __future__ import annotations

import cv2
import numpy as np

from sim.dataset.patterns import smooth_noise
from sim.rendering.lighting import PLAIN, Lighting
from sim.sensors.exposure import expose
from sim.sensors.stereo_noise import Depth, Rgb, StereoErrors, degrade_colour, degrade_depth

SIMULATOR_ERRORS = StereoErrors()
"""Errors of the camera of every scenario."""


def random_errors(rng: np.random.Generator) -> StereoErrors:
    """Return the errors of a depth camera that is a little better or worse than that of the
    simulator."""
    return StereoErrors(
        disparity_noise_px=float(rng.uniform(0.04, 0.16)),
        speckle=float(rng.choice([0.002, 0.01, 0.03])),
        edge_px=int(rng.integers(1, 3)),
        colour_noise=int(rng.integers(1, 8)),
    )


def apply_camera_effects(
    rgb: Rgb,
    depth_m: Depth,
    focal_px: float,
    rng: np.random.Generator,
    *,
    like_simulator: bool,
    lighting: Lighting = PLAIN,
    turn_radps: float = 0.0,
) -> tuple[Rgb, Depth]:
    """Return colours and depth as the camera reports them; `like_simulator` applies exactly the
    errors of the simulator. `lighting`: settings of the colour camera, of a robot that turns at
    `turn_radps`."""
    rgb = expose(rgb, lighting, turn_radps * focal_px)
    errors = SIMULATOR_ERRORS if like_simulator else random_errors(rng)
    if not like_simulator:
        rgb = _blurred(_exposed(rgb, rng), rng)
    return degrade_colour(rgb, errors, rng), degrade_depth(depth_m, focal_px, errors, rng)


def _exposed(rgb: Rgb, rng: np.random.Generator) -> Rgb:
    """Vary brightness, contrast and tint, and add soft shadows."""
    height, width = rgb.shape[:2]
    gain = rng.uniform(0.6, 1.25) * rng.uniform(0.92, 1.08, 3)
    gamma = rng.uniform(0.8, 1.3)
    table = 255.0 * np.clip(gain * (np.arange(256) / 255.0)[:, None] ** gamma, 0, 1)
    levels = table.astype(np.float32)[rgb, np.arange(3)]
    if rng.random() < 0.6:
        shade = 1.0 + rng.uniform(0.0, 0.08) * smooth_noise(rng, 4, 64)
        levels *= cv2.resize(
            shade.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR
        )[:, :, None]
    return np.asarray(np.clip(levels, 0, 255), dtype=np.uint8)


def _blurred(rgb: Rgb, rng: np.random.Generator) -> Rgb:
    kind = rng.random()
    if kind < 0.4:
        return np.asarray(cv2.GaussianBlur(rgb, (0, 0), rng.uniform(0.3, 0.9)), dtype=np.uint8)
    if kind < 0.5:  # motion blur of a turning robot
        return np.asarray(cv2.blur(rgb, (int(rng.integers(2, 5)), 1)), dtype=np.uint8)
    return rgb
