"""How good a segmentation is (IoU), and how rare each class is (its weight in the loss)."""

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
    """(C, C) pixels, row = true class, column = predicted class; add up over pictures.

    `labels`: any shape, 0 = void (left out), else class + 1. `predicted`: the same shape, class 0 …
    C−1.
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
    """(C,) intersection over union per class: TP / (TP + FP + FN); NaN for a class without true
    pixels."""
    hits = np.diag(confusion).astype(np.float64)
    truth = confusion.sum(axis=1)
    union = truth + confusion.sum(axis=0) - hits
    values = np.full(len(hits), np.nan)
    np.divide(hits, union, out=values, where=truth > 0)
    return values


def mean_iou(confusion: IntArray) -> float:
    """Mean over the classes that have true pixels; NaN when none has."""
    values = ious(confusion)
    known = ~np.isnan(values)
    return float(values[known].mean()) if known.any() else float("nan")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PixelCounts:
    """How often each class occurs in a data set."""

    of_class: npt.NDArray[np.int64]
    """(C,) pixels of the class."""
    of_pictures: npt.NDArray[np.int64]
    """(C,) all pixels, void ones too, of the pictures that show the class."""


def count_pixels(pictures: Iterable[IntArray], num_classes: int) -> PixelCounts:
    """Count over label pictures, each (H, W) with 0 = void, else class + 1."""
    of_class = np.zeros(num_classes, dtype=np.int64)
    of_pictures = np.zeros(num_classes, dtype=np.int64)
    for labels in pictures:
        _check_range("labels", labels, num_classes)
        here = np.bincount(labels.ravel(), minlength=num_classes + 1)[1:]
        of_class += here
        of_pictures[here > 0] += labels.size
    return PixelCounts(of_class=of_class, of_pictures=of_pictures)


def median_frequency_weights(counts: PixelCounts) -> FloatArray:
    """(C,) w = median(f) / f with f = pixels of the class / pixels of the pictures showing it
    (Eigen & Fergus 2015).

    A class that never occurs gets weight 0 and does not enter the median.
    """
    occurs = counts.of_class > 0
    weights = np.zeros(len(occurs))
    frequency = counts.of_class[occurs] / counts.of_pictures[occurs]
    if occurs.any():
        weights[occurs] = np.median(frequency) / frequency
    return weights


def logarithmic_weights(counts: PixelCounts, *, softening: float = 1.02) -> FloatArray:
    """(C,) w = 1 / ln(c + p) with p = share of the class among all labelled pixels (Paszke et al.
    2016)."""
    share: FloatArray = counts.of_class / max(1, int(counts.of_class.sum()))
    return 1.0 / np.log(softening + share)


def _check_range(name: str, values: IntArray, largest: int) -> None:
    if values.size and not 0 <= int(values.min()) <= int(values.max()) <= largest:
        raise BadFrame(
            f"{name}: reaches from {int(values.min())} to {int(values.max())}, expected 0 to {largest}"
        )
