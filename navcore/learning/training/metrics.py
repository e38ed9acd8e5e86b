"""Segmentation metrics (IoU) and class weights by frequency."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.errors import BadFrame

IntArray = npt.NDArray[np.integer]
FloatArray = npt.NDArray[np.float64]


def confusion_matrix(
    labels: IntArray, predicted: IntArray, num_classes: int
) -> npt.NDArray[np.int64]:
    """Return pixel counts (C, C), row = true class, column = predicted class; add up over images.

    `labels` has any shape, 0 = void (left out), else class + 1; `predicted` the same shape, class
    0 … C−1.
    """
    if labels.shape != predicted.shape:
        raise BadFrame(
            f"labels have shape {labels.shape}, the prediction {predicted.shape}; expected the same"
        )
    _check_range("labels", labels, num_classes)
    _check_range("prediction", predicted, num_classes - 1)
    known = labels > 0
    pairs = (labels[known].astype(np.int64) - 1) * num_classes + predicted[known]
    return np.bincount(pairs, minlength=num_classes**2).reshape(num_classes, num_classes)


def ious(confusion: IntArray) -> FloatArray:
    """Return the intersection over union (C,) per class, TP / (TP + FP + FN); NaN for a class
    without true pixels."""
    hits = np.diag(confusion).astype(np.float64)
    truth = confusion.sum(axis=1)
    union = truth + confusion.sum(axis=0) - hits
    values = np.full(len(hits), np.nan)
    np.divide(hits, union, out=values, where=truth > 0)
    return values


def mean_iou(confusion: IntArray) -> float:
    """Return the mean IoU of the classes with true pixels; NaN if there are none."""
    values = ious(confusion)
    known = ~np.isnan(values)
    return float(values[known].mean()) if known.any() else float("nan")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PixelCounts:
    """Pixel counts per class over a data set."""

    of_class: npt.NDArray[np.int64]
    """(C,) number of pixels of each class."""
    of_images: npt.NDArray[np.int64]
    """(C,) number of all pixels, also void, of the images that show each class."""


def count_pixels(images: Iterable[IntArray], num_classes: int) -> PixelCounts:
    """Count the pixels of label images, each (H, W) with 0 = void, else class + 1."""
    of_class = np.zeros(num_classes, dtype=np.int64)
    of_images = np.zeros(num_classes, dtype=np.int64)
    for labels in images:
        _check_range("labels", labels, num_classes)
        here = np.bincount(labels.ravel(), minlength=num_classes + 1)[1:]
        of_class += here
        of_images[here > 0] += labels.size
    return PixelCounts(of_class=of_class, of_images=of_images)


def median_frequency_weights(counts: PixelCounts) -> FloatArray:
    """Return weights (C,) w = median(f) / f with f = pixels of the class / pixels of the images
    showing it (Eigen & Fergus 2015).

    A class that never occurs has weight 0 and does not enter the median.
    """
    occurs = counts.of_class > 0
    weights = np.zeros(len(occurs))
    frequency = counts.of_class[occurs] / counts.of_images[occurs]
    if occurs.any():
        weights[occurs] = np.median(frequency) / frequency
    return weights


def logarithmic_weights(counts: PixelCounts, *, softening: float = 1.02) -> FloatArray:
    """Return weights (C,) w = 1 / ln(c + p) with p = share of the class among all labelled pixels
    (Paszke et al. 2016)."""
    share: FloatArray = counts.of_class / max(1, int(counts.of_class.sum()))
    return 1.0 / np.log(softening + share)


def _check_range(name: str, values: IntArray, largest: int) -> None:
    if values.size and not 0 <= int(values.min()) <= int(values.max()) <= largest:
        raise BadFrame(
            f"{name}: reaches from {int(values.min())} to {int(values.max())}, "
            f"expected 0 to {largest}"
        )
