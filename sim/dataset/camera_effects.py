"""What a real camera adds to a rendered picture: exposure, tint, uneven light, blur, noise, and a
stereo camera's errors."""

from __future__ import annotations

import cv2
import numpy as np

from sim.dataset.patterns import clouds
from sim.sensors.stereo_noise import Depth, Rgb, StereoErrors, spoil_colour, spoil_depth

USUAL = StereoErrors()
"""Of every scenario."""


def random_errors(rng: np.random.Generator) -> StereoErrors:
    """A depth camera that is a little better or worse than the usual one."""
    return StereoErrors(
        disparity_noise_px=float(rng.uniform(0.04, 0.16)),
        speckle=float(rng.choice([0.002, 0.01, 0.03])),
        edge_px=int(rng.integers(1, 3)),
        colour_noise=int(rng.integers(1, 8)),
    )


def apply_camera_effects(
    rgb: Rgb, depth_m: Depth, focal_px: float, rng: np.random.Generator, *, usual: bool
) -> tuple[Rgb, Depth]:
    """Colours and depth as the camera gives them; `usual` for exactly the simulator's camera."""
    errors = USUAL if usual else random_errors(rng)
    if not usual:
        rgb = _blurred(_exposed(rgb, rng), rng)
    return spoil_colour(rgb, errors, rng), spoil_depth(depth_m, focal_px, errors, rng)


def _exposed(rgb: Rgb, rng: np.random.Generator) -> Rgb:
    """Brightness, contrast and tint, and soft shadows that lie over the picture."""
    height, width = rgb.shape[:2]
    gain = rng.uniform(0.6, 1.25) * rng.uniform(0.92, 1.08, 3)
    gamma = rng.uniform(0.8, 1.3)
    table = 255.0 * np.clip(gain * (np.arange(256) / 255.0)[:, None] ** gamma, 0, 1)
    picture = table.astype(np.float32)[rgb, np.arange(3)]
    if rng.random() < 0.6:
        shade = 1.0 + rng.uniform(0.0, 0.08) * clouds(rng, 4, 64)
        picture *= cv2.resize(
            shade.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR
        )[:, :, None]
    return np.asarray(np.clip(picture, 0, 255), dtype=np.uint8)


def _blurred(rgb: Rgb, rng: np.random.Generator) -> Rgb:
    kind = rng.random()
    if kind < 0.4:
        return np.asarray(cv2.GaussianBlur(rgb, (0, 0), rng.uniform(0.3, 0.9)), dtype=np.uint8)
    if kind < 0.5:  # the robot turned
        return np.asarray(cv2.blur(rgb, (int(rng.integers(2, 5)), 1)), dtype=np.uint8)
    return rgb
