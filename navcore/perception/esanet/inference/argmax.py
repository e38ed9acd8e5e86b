"""Argmax of the logits: the most likely class of each pixel, and its probability."""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.errors import BadConfiguration

_LOG2_E = np.float32(math.log2(math.e))
_C0, _C1, _C2, _C3, _C4, _C5 = (np.float32(math.log(2) ** n / math.factorial(n)) for n in range(6))
"""Coefficients of the series of 2^x, for x from −1/2 to 1/2."""
_NEGLIGIBLE = np.float32(-60.0)
"""Smallest exponent of two relative to the largest logit; smaller ones are clipped, because they do
not change the sum."""
_HALF = np.float32(0.5)
_BIAS, _MANTISSA = np.int32(127), np.int32(23)
"""Exponent bias and number of mantissa bits of float32."""
_Index = npt.NDArray[np.uint64]
"""Unsigned, as numba asks of each signed index whether it counts from the end."""
_Axis = tuple[_Index, _Index, npt.NDArray[np.float32]]


def most_likely(
    logits: npt.NDArray[np.float32], *, height: int, width: int
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Return the most likely class (height, width) and its softmax probability (height, width) of
    logits (C, h, w).

    The logits are resized (bilinear, corners not aligned), not the labels, as in the paper's
    evaluation. At most 255 classes. Raises `BadConfiguration` for non-finite logits, which would
    otherwise label nothing.
    """
    if not np.isfinite(logits).all():
        raise BadConfiguration(
            "ESANet: the network's output is not finite; "
            "its weights do not fit this camera's images"
        )
    winners, confidence = (
        np.empty((height, width), dtype=np.uint8),
        np.empty((height, width), dtype=np.float32),
    )
    _most_likely(
        logits, *_axis(logits.shape[1], height), *_axis(logits.shape[2], width), winners, confidence
    )
    return winners, confidence


@functools.lru_cache(maxsize=16)
def _axis(length: int, wanted: int) -> _Axis:
    """Return the index before and after each output position, and its fraction between the two."""
    at = np.maximum((np.arange(wanted) + 0.5) * (length / wanted) - 0.5, 0.0)
    before = np.floor(at)
    after = np.minimum(before + 1, length - 1)
    return before.astype(np.uint64), after.astype(np.uint64), (at - before).astype(np.float32)


@compiled
def _most_likely(
    logits: npt.NDArray[np.float32],
    above: _Index,
    below: _Index,
    down: npt.NDArray[np.float32],
    left: _Index,
    right: _Index,
    along: npt.NDArray[np.float32],
    winners: npt.NDArray[np.uint8],
    confidence: npt.NDArray[np.float32],
) -> None:
    """Process row by row, so that all classes of a row stay in the cache, in vectorisable loops."""
    classes, columns = logits.shape[0], logits.shape[2]
    height, width = winners.shape
    blended = np.empty(columns, dtype=np.float32)
    row = np.empty((classes, width), dtype=np.float32)
    best, total = np.empty(width, dtype=np.float32), np.empty(width, dtype=np.float32)
    winner, bits = np.empty(width, dtype=np.int32), np.empty(width, dtype=np.int32)
    power = bits.view(np.float32)
    for i in range(height):
        for k in range(classes):
            upper, lower = logits[k, above[i]], logits[k, below[i]]
            for j in range(columns):
                blended[j] = upper[j] + down[i] * (lower[j] - upper[j])
            for j in range(width):
                first = blended[left[j]]
                row[k, j] = first + along[j] * (blended[right[j]] - first)
        best[:], winner[:], total[:] = row[0], 0, 0
        for k in range(1, classes):
            for j in range(width):
                higher = row[k, j] > best[j]
                winner[j] = np.int32(k) if higher else winner[j]
                best[j] = row[k, j] if higher else best[j]
        for k in range(classes):
            for j in range(width):
                # e^x = 2^whole · 2^part, the first by its exponent bits, the second by its series:
                # error 3e-6 at most. np.floor, as math.floor gives an int64.
                twos = max((row[k, j] - best[j]) * _LOG2_E, _NEGLIGIBLE)
                whole = np.floor(twos + _HALF)
                part = twos - whole
                series = _C0 + part * (
                    _C1 + part * (_C2 + part * (_C3 + part * (_C4 + part * _C5)))
                )
                bits[j] = (np.int32(whole) + _BIAS) << _MANTISSA
                total[j] += series * power[j]
        for j in range(width):
            winners[i, j], confidence[i, j] = winner[j], np.float32(1) / total[j]
