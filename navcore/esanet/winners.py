"""From logits to labels: the likeliest class of each pixel of the picture, and its probability."""

from __future__ import annotations

import functools
import math

import numba
import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration

_NEGLIGIBLE = 20.0
"""Logits so far below the largest add less than 1e-8 to the sum of the softmax."""
_Axis = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.float32]]


def most_likely(
    logits: npt.NDArray[np.float32], *, height: int, width: int
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """(C, h, w) → the most likely class (height, width) and its softmax probability (height, width).

    The logits are resized (bilinear, corners not aligned), not the labels, as in the paper's evaluation. At most 255 classes.
    Raises `BadConfiguration` for logits that are not finite: whoever looks at a NaN sees nothing to beware of.
    """
    if not np.isfinite(logits).all():
        raise BadConfiguration("ESANet: the network's output is not finite; its weights do not fit this camera's pictures")
    winners, confidence = np.empty((height, width), dtype=np.uint8), np.empty((height, width), dtype=np.float32)
    _most_likely(logits, *_axis(logits.shape[1], height), *_axis(logits.shape[2], width), winners, confidence)
    return winners, confidence


@functools.lru_cache(maxsize=16)
def _axis(length: int, wanted: int) -> _Axis:
    """For each of the wanted places the one before it, the one after it, and how far it lies between the two."""
    at = np.maximum((np.arange(wanted) + 0.5) * (length / wanted) - 0.5, 0.0)
    before = np.floor(at).astype(np.int64)
    return before, np.minimum(before + 1, length - 1), (at - before).astype(np.float32)


@numba.njit(cache=True, nogil=True)
def _most_likely(
    logits: npt.NDArray[np.float32],
    above: npt.NDArray[np.int64],
    below: npt.NDArray[np.int64],
    down: npt.NDArray[np.float32],
    left: npt.NDArray[np.int64],
    right: npt.NDArray[np.int64],
    along: npt.NDArray[np.float32],
    winners: npt.NDArray[np.uint8],
    confidence: npt.NDArray[np.float32],
) -> None:
    """Row by row, so that all classes of a row stay in the cache."""
    classes, columns = logits.shape[0], logits.shape[2]
    height, width = winners.shape
    blended = np.empty(columns, dtype=np.float32)
    row = np.empty((classes, width), dtype=np.float32)
    best = np.empty(width, dtype=np.float32)
    total = np.empty(width, dtype=np.float32)
    for i in range(height):
        for k in range(classes):
            for j in range(columns):
                blended[j] = logits[k, above[i], j] + down[i] * (logits[k, below[i], j] - logits[k, above[i], j])
            for j in range(width):
                first = blended[left[j]]
                row[k, j] = first + along[j] * (blended[right[j]] - first)
        best[:] = row[0]
        winners[i] = 0
        for k in range(1, classes):
            for j in range(width):
                if row[k, j] > best[j]:
                    best[j], winners[i, j] = row[k, j], k
        total[:] = 0
        for k in range(classes):
            for j in range(width):
                less = best[j] - row[k, j]
                if less < _NEGLIGIBLE:
                    total[j] += math.exp(-less)
        for j in range(width):
            confidence[i, j] = np.float32(1) / total[j]
