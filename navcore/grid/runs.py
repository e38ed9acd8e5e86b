"""Runs of equal codes in a row of an image: neighbouring pixels mostly show the same cell, so what
is done once for each run costs a sixth of what is done for each pixel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import inlined
from navcore.grid.bitplane import ONE, lowest

WORD = 64
"""Number of pixels that are looked through together."""
_GATHER = np.uint64(0x0102040810204080)
"""Factor that moves eight bytes of 0 or 1 into the eight bits of the product's highest byte."""

Codes = npt.NDArray[np.int32]
"""(W + 1,) codes of the pixels of a row, after a sentinel: no code, or one whose pixels need no
visit at the beginning of a row."""


@inlined
def run_starts(
    codes: Codes,
    changed: npt.NDArray[np.uint8],
    starts: npt.NDArray[np.int32],
    width: int,
) -> int:
    """Return the number of runs of one code in a row of `width` pixels; write the pixel at which
    each begins, and where the row ends, to `starts`, (W + 1,).

    `changed` is memory for (W,) bytes in whole words of `WORD`, 0 at the first use.
    """
    for j in range(width):
        changed[j] = codes[j + 1] != codes[j]
    bytes_, count = changed.view(np.uint64), 0
    for word in range(len(bytes_) // 8):
        left = np.uint64(0)
        for byte in range(8):
            left |= ((bytes_[8 * word + byte] * _GATHER) >> np.uint64(56)) << np.uint64(8 * byte)
        while left != 0:
            starts[count] = WORD * word + lowest(left)
            count += 1
            left &= left - ONE
    starts[count] = width
    return count
