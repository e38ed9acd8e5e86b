"""Pictures as training shows them: enlarged, cropped, tinted and mirrored at random; and as
validation shows them: resized."""

from __future__ import annotations

import cv2
import numpy as np

from navcore.learning.data.card import Sample
from navcore.learning.data.images import LabelArray, RgbArray
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
    """A random variation of the sample, `crop` (else all) of the working size. The same generator
    gives the same variation."""
    window = crop or size
    scale = random.uniform(*changes.scale)
    grown = Size(
        height=max(size.height, round(size.height * scale)),
        width=max(size.width, round(size.width * scale)),
    )
    row = int(random.integers(grown.height - window.height + 1))
    col = int(random.integers(grown.width - window.width + 1))
    factors = random.uniform(*changes.hsv, size=3)
    mirrored = random.random() < changes.flip
    if changes.focus and random.random() < changes.focus:
        row, col = _around_something(sample.labels, grown, window, random)
    cut = cropped(resized(sample, grown), row, col, window)
    tinted_rgb = cut.rgb if (factors == 1.0).all() else tinted(cut.rgb, factors)
    varied = Sample(rgb=tinted_rgb, depth=cut.depth, labels=cut.labels)
    return flipped(varied) if mirrored else varied


def _around_something(
    labels: LabelArray, grown: Size, window: Size, random: np.random.Generator
) -> tuple[int, int]:
    """First row and column of a window that shows a random pixel of a random class, small classes
    first.

    A picture is mostly floor and walls; of a cable it has some dozen pixels, and a random window
    would seldom show them.
    """
    classes, counts = np.unique(labels[labels > 0], return_counts=True)
    if not len(classes):
        return int(random.integers(grown.height - window.height + 1)), int(
            random.integers(grown.width - window.width + 1)
        )
    shares = 1 / np.sqrt(counts)
    rows, cols = np.nonzero(labels == random.choice(classes, p=shares / shares.sum()))
    at = int(random.integers(len(rows)))
    row = rows[at] * grown.height // labels.shape[0] - int(random.integers(window.height))
    col = cols[at] * grown.width // labels.shape[1] - int(random.integers(window.width))
    return int(np.clip(row, 0, grown.height - window.height)), int(
        np.clip(col, 0, grown.width - window.width)
    )


def resized(sample: Sample, size: Size) -> Sample:
    """Colours by bilinear interpolation; depth and labels by nearest, for there is nothing between
    two classes."""
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
    """The window of that size whose upper left pixel is (row, col)."""
    window = np.s_[row : row + size.height, col : col + size.width]
    return Sample(rgb=sample.rgb[window], depth=sample.depth[window], labels=sample.labels[window])


def flipped(sample: Sample) -> Sample:
    """Left and right exchanged."""
    return Sample(
        rgb=sample.rgb[:, ::-1], depth=sample.depth[:, ::-1], labels=sample.labels[:, ::-1]
    )


def tinted(rgb: RgbArray, factors: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> RgbArray:
    """Hue, saturation and value of (H, W, 3) multiplied by the three factors and clipped; hue does
    not wrap round."""
    hsv = cv2.cvtColor(rgb.astype(np.float32) / np.float32(255.0), cv2.COLOR_RGB2HSV)
    hsv *= factors.astype(np.float32)
    np.minimum(hsv, np.array([HUE_CIRCLE, 1.0, 1.0], dtype=np.float32), out=hsv)
    colours = cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)
    return np.asarray(np.rint(colours * 255.0), dtype=np.uint8)
