"""Array types that several stages share; shapes and units stand where the arrays are used."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
"""Real numbers in any shape."""
Points = npt.NDArray[np.float64]
"""(N, 2) or (N, 3) coordinates in metres, or (N, 3) poses x, y, heading."""
FloatImage = npt.NDArray[np.float32]
"""(H, W) one real number for each pixel or cell, such as depth in metres."""
Indices = npt.NDArray[np.int64]
"""Integers in any shape, such as (N,) indices or (N, 2) cells (row, col)."""
Bools = npt.NDArray[np.bool_]
"""Truth values in any shape."""
Words = npt.NDArray[np.uint64]
"""Words of 64 bits in any shape."""


def sorted_distinct(numbers: Indices) -> Indices:
    """Return each of (N,) whole numbers once, in rising order: by sorting, which for the thousands
    of a frame is several times as fast as the hashing of `np.unique`."""
    ordered = np.sort(numbers)
    first = np.ones(len(ordered), dtype=np.bool_)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]
