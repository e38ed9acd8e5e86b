"""Error model of a stereo depth camera: noise that grows with the square of the distance, occlusion
shadows at edges, speckle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled

Depth = npt.NDArray[np.float32]
Rgb = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class StereoErrors:
    """Errors of an Intel RealSense D455; all zero makes it a perfect camera."""

    baseline_m: float = 0.095
    """Distance between the two imagers."""
    disparity_noise_px: float = 0.08
    """Standard deviation of the matched disparity."""
    disparity_step_px: float = 1 / 32
    """Quantisation step of the disparity; 0 for none."""
    speckle: float = 0.01
    """Share of pixels anywhere without a match."""
    edge_px: int = 1
    """Width of the unmatched band on the near side of a depth edge."""
    shadows: bool = True
    """Whether pixels that only the left imager sees are missing."""
    colour_noise: int = 3
    """Largest error of a colour level, a difference of two uniform draws."""
    largest_disparity_px: float = 126.0
    """Search range of the matcher: nothing nearer than f·b/126 is measured, which is 0.17 m at 424
    columns and 0.5 m at 1280."""
    max_range_m: float = 6.0
    """Largest measured distance."""


PERFECT = StereoErrors(
    disparity_noise_px=0.0,
    disparity_step_px=0.0,
    speckle=0.0,
    edge_px=0,
    shadows=False,
    colour_noise=0,
)
"""A camera without errors; only the range is limited."""


def degrade_depth(
    true_m: Depth, focal_px: float, errors: StereoErrors, rng: np.random.Generator
) -> Depth:
    """Return (H, W) depth in metres as the camera reports it, 0 where it measures nothing.

    With disparity d = f·b/z the noise of z is z²·σ_d/(f·b).
    """
    shape, none = true_m.shape, np.empty((0, 0), dtype=np.float32)
    chances = rng.random(shape, dtype=np.float32) if errors.speckle else none
    draws = rng.standard_normal(shape, dtype=np.float32) if errors.disparity_noise_px else none
    depth: Depth = np.empty(shape, dtype=np.float32)
    strengths = (
        focal_px * errors.baseline_m,
        errors.largest_disparity_px,
        errors.max_range_m,
        errors.speckle,
        errors.disparity_noise_px,
        errors.disparity_step_px,
    )
    rules = np.array(strengths, dtype=np.float32)
    _measure(true_m, chances, draws, rules, errors.shadows, errors.edge_px, depth)
    return depth


def degrade_colour(true_rgb: Rgb, errors: StereoErrors, rng: np.random.Generator) -> Rgb:
    """Return (H, W, 3) colours with sensor noise."""
    if not errors.colour_noise:
        return true_rgb.copy()
    span = errors.colour_noise + 1
    draws = rng.integers(0, span, size=(2, *true_rgb.shape), dtype=np.uint8)
    noisy = true_rgb.astype(np.int16)
    noisy += draws[0]
    noisy -= draws[1]
    return np.clip(noisy, 0, 255, out=noisy).astype(np.uint8)


@compiled
def _measure(
    true_m: Depth,
    chances: Depth,
    draws: Depth,
    rules: npt.NDArray[np.float32],
    shadows: bool,
    edge_px: int,
    depth_m: Depth,
) -> None:
    """Write the (H, W) depth as the camera reports it.

    `chances` and `draws` are uniform and normal numbers for speckle and noise, or empty; `rules`
    are f·b, the largest disparity and range, the share of speckle, and noise and step of the
    disparity.
    """
    strength, largest_px, range_m, speckle, noise_px, step_px = rules
    height, width = true_m.shape
    disparity, gone = np.empty((height, width), dtype=np.float32), np.empty(width, dtype=np.bool_)
    for i in range(height):
        row = disparity[i]
        for j in range(width):
            row[j] = strength / max(true_m[i, j], np.float32(0.05))
        # Column j of the left image lands in column j − d of the right one; a pixel is hidden when
        # another one further right lands further left.
        leftmost = np.float32(np.inf)
        for j in range(width - 1, -1, -1):
            landing = np.float32(j) - row[j]
            gone[j] = shadows & (landing > leftmost)
            leftmost = min(leftmost, landing)
        for k in range(edge_px):  # beside a jump of more than one pixel
            for j in range(k + 1, width):
                gone[j] |= abs(row[j - k] - row[j - k - 1]) > np.float32(1)
            for j in range(width if i > k else 0):
                gone[j] |= abs(disparity[i - k, j] - disparity[i - k - 1, j]) > np.float32(1)
        for j in range(width if len(chances) else 0):
            gone[j] |= chances[i, j] < speckle
        for j in range(width):
            gone[j] |= (row[j] > largest_px) | (true_m[i, j] > range_m)
            pixels = row[j] + noise_px * draws[i, j] if len(draws) else row[j]
            pixels = np.rint(pixels / step_px) * step_px if step_px > 0 else pixels
            depth = strength / max(pixels, np.float32(0.1))
            depth_m[i, j] = np.float32(0) if gone[j] | (depth > range_m) else depth
