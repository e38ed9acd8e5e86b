"""Error model of a stereo depth camera: noise that grows with the square of the distance, occlusion
shadows at edges, speckle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

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
    strength = np.float32(focal_px * errors.baseline_m)
    disparity: Depth = (strength / np.maximum(true_m, np.float32(0.05))).astype(np.float32)
    missing = (disparity > errors.largest_disparity_px) | (true_m > errors.max_range_m)
    if errors.shadows:
        missing |= _shadowed(disparity)
    if errors.edge_px:
        missing |= _near_edges(disparity, errors.edge_px)
    if errors.speckle:
        missing |= rng.random(true_m.shape, dtype=np.float32) < errors.speckle
    if errors.disparity_noise_px:
        disparity += np.float32(errors.disparity_noise_px) * rng.standard_normal(
            true_m.shape, dtype=np.float32
        )
    if errors.disparity_step_px:
        disparity = np.round(disparity / np.float32(errors.disparity_step_px)) * np.float32(
            errors.disparity_step_px
        )
    depth: Depth = (strength / np.maximum(disparity, np.float32(0.1))).astype(np.float32)
    depth[missing | (depth > errors.max_range_m)] = 0.0
    return depth


def degrade_colour(true_rgb: Rgb, errors: StereoErrors, rng: np.random.Generator) -> Rgb:
    """Return (H, W, 3) colours with sensor noise."""
    if not errors.colour_noise:
        return true_rgb.copy()
    span = errors.colour_noise + 1
    draws = rng.integers(0, span, size=(2, *true_rgb.shape), dtype=np.uint8)
    noisy = true_rgb.astype(np.int16) + draws[0] - draws[1]
    return np.asarray(np.clip(noisy, 0, 255), dtype=np.uint8)


def _shadowed(disparity: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """Return the mask of pixels that a nearer surface to their right hides from the right imager.

    Column j of the left image lands in column j − d of the right one; a pixel is hidden when
    another one further right lands further left.
    """
    landing = np.arange(disparity.shape[1], dtype=np.float32) - disparity
    rest = np.minimum.accumulate(landing[:, ::-1], axis=1)[:, ::-1]
    hidden = np.zeros(disparity.shape, dtype=np.bool_)
    hidden[:, :-1] = landing[:, :-1] > rest[:, 1:]
    return hidden


def _near_edges(disparity: npt.NDArray[np.float32], width_px: int) -> npt.NDArray[np.bool_]:
    """Return the mask of pixels beside a jump of more than one pixel of disparity, along rows and
    columns."""
    edges = np.zeros(disparity.shape, dtype=np.bool_)
    across = np.abs(np.diff(disparity, axis=1)) > 1.0
    along = np.abs(np.diff(disparity, axis=0)) > 1.0
    for k in range(width_px):
        edges[:, k + 1 :] |= across[:, : across.shape[1] - k]
        edges[k + 1 :, :] |= along[: along.shape[0] - k, :]
    return edges
