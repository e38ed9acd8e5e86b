"""Augmentation: random scaling, cropping, tinting and mirroring for training; resizing for
validation."""

from __future__ import annotations

import cv2
import numpy as np

from navcore.learning.data.card import Sample
from navcore.learning.data.images import LabelArray, RgbArray
from navcore.learning.data.photometry import (
    KERNEL_SIDE,
    NEUTRAL_K,
    exposed,
    filtered,
    motion_blurred,
    random_kernel,
)
from navcore.learning.training.recipe import Augmentation
from navcore.perception.esanet.network.preprocess import Size

HUE_CIRCLE = 360.0


def augmented(
    sample: Sample,
    size: Size,
    changes: Augmentation,
    random: np.random.Generator,
    *,
    crop: Size | None = None,
) -> Sample:
    """Return a random variation of the sample, of size `crop` or else of the working size; the same
    generator gives the same variation."""
    window = crop or size
    scale = random.uniform(*changes.scale)
    if changes.reduced and random.random() < changes.reduced:
        scale = random.uniform(least_scale(size, window), 1.0)
    scaled = Size(
        height=max(window.height, round(size.height * scale)),
        width=max(window.width, round(size.width * scale)),
    )
    row = int(random.integers(scaled.height - window.height + 1))
    col = int(random.integers(scaled.width - window.width + 1))
    factors = random.uniform(*changes.hsv, size=3)
    mirrored = random.random() < changes.flip
    if changes.focus and random.random() < changes.focus:
        row, col = _window_on_class(sample.labels, scaled, window, random)
    cut = cropped(resized(sample, scaled), row, col, window)
    tinted_rgb = cut.rgb if (factors == 1.0).all() else tinted(cut.rgb, factors)
    rgb = _in_other_light(tinted_rgb, scaled.width, changes, random)
    varied = Sample(rgb=rgb, depth=cut.depth, labels=cut.labels)
    return flipped(varied) if mirrored else varied


def least_scale(size: Size, window: Size) -> float:
    """Return the factor by which an image of the working size can be reduced until the window fits
    just so."""
    return max(window.height / size.height, window.width / size.width)


def _in_other_light(
    rgb: RgbArray, width_px: int, changes: Augmentation, random: np.random.Generator
) -> RgbArray:
    """Return colours with random textures, exposure, white balance and motion blur; draws nothing
    for what does not vary, so that earlier recipes give the same images. `width_px`: width of the
    whole image, of which the colours may be a window."""
    if changes.filtered and random.random() < changes.filtered:
        normal = random.standard_normal((KERNEL_SIDE, KERNEL_SIDE))
        rgb = filtered(rgb, random_kernel(random.random(), normal))
    if changes.blur != (0.0, 0.0):
        rgb = motion_blurred(rgb, width_px * random.uniform(*changes.blur))
    light, white_k = 1.0, NEUTRAL_K
    if changes.exposure != (1.0, 1.0):
        light = float(np.exp(random.uniform(*np.log(changes.exposure))))
    if changes.white_k != (NEUTRAL_K, NEUTRAL_K):
        low, high = changes.white_k  # even steps of what is seen: of the reciprocal
        white_k = 1 / random.uniform(1 / high, 1 / low)
    return rgb if (light, white_k) == (1.0, NEUTRAL_K) else exposed(rgb, light, white_k)


def _window_on_class(
    labels: LabelArray, scaled: Size, window: Size, random: np.random.Generator
) -> tuple[int, int]:
    """Return the first row and column of a window with a random pixel of a random class, preferring
    small classes.

    An image is mostly floor and walls; a cable has some dozen pixels, which a random window would
    seldom show.
    """
    classes, counts = np.unique(labels[labels > 0], return_counts=True)
    if not len(classes):
        return int(random.integers(scaled.height - window.height + 1)), int(
            random.integers(scaled.width - window.width + 1)
        )
    shares = 1 / np.sqrt(counts)
    rows, cols = np.nonzero(labels == random.choice(classes, p=shares / shares.sum()))
    at = int(random.integers(len(rows)))
    row = rows[at] * scaled.height // labels.shape[0] - int(random.integers(window.height))
    col = cols[at] * scaled.width // labels.shape[1] - int(random.integers(window.width))
    return int(np.clip(row, 0, scaled.height - window.height)), int(
        np.clip(col, 0, scaled.width - window.width)
    )


def resized(sample: Sample, size: Size) -> Sample:
    """Resize a sample: colours bilinearly, depth and labels by nearest neighbour."""
    if sample.labels.shape == (size.height, size.width):
        return sample
    shape = (size.width, size.height)
    return Sample(
        rgb=np.asarray(
            cv2.resize(sample.rgb, shape, interpolation=cv2.INTER_LINEAR), dtype=np.uint8
        ),
        depth=np.asarray(
            cv2.resize(sample.depth, shape, interpolation=cv2.INTER_NEAREST), dtype=np.uint16
        ),
        labels=np.asarray(
            cv2.resize(sample.labels, shape, interpolation=cv2.INTER_NEAREST), dtype=np.uint8
        ),
    )


def cropped(sample: Sample, row: int, col: int, size: Size) -> Sample:
    """Return the window of a size whose upper left pixel is (row, col)."""
    window = np.s_[row : row + size.height, col : col + size.width]
    return Sample(rgb=sample.rgb[window], depth=sample.depth[window], labels=sample.labels[window])


def flipped(sample: Sample) -> Sample:
    """Return the sample mirrored left to right."""
    return Sample(
        rgb=sample.rgb[:, ::-1], depth=sample.depth[:, ::-1], labels=sample.labels[:, ::-1]
    )


def tinted(rgb: RgbArray, factors: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> RgbArray:
    """Multiply hue, saturation and value of (H, W, 3) by three factors and clip; hue does not wrap
    around."""
    hsv = cv2.cvtColor(rgb.astype(np.float32) / np.float32(255.0), cv2.COLOR_RGB2HSV)
    hsv *= factors.astype(np.float32)
    np.minimum(hsv, np.array([HUE_CIRCLE, 1.0, 1.0], dtype=np.float32), out=hsv)
    colours = cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)
    return np.asarray(np.rint(colours * 255.0), dtype=np.uint8)
