"""Words of 64 cells: the machine instructions that numba does not name, and grids packed into such words.

A plane is uint64 (lines, words); bit b of word w of line l is the cell (l, 64 w + b). Planes are padded by 64 blocked cells on
every side (`PAD`), so that no scan needs a bounds check and a plane and its transposed copy are cut into the same blocks.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from navcore.grid import BoolGrid

Plane = npt.NDArray[np.uint64]

PAD = 64
ZERO, ONE, ALL = np.uint64(0), np.uint64(1), np.uint64(2**64 - 1)


@intrinsic  # type: ignore[untyped-decorator]
def lowest(_typing: Any, _word: Any) -> Any:
    """Number of the lowest set bit of a uint64 that is not 0."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.uint64), generate


@intrinsic  # type: ignore[untyped-decorator]
def highest(_typing: Any, _word: Any) -> Any:
    """Number of the highest set bit of a uint64 that is not 0."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.xor(builder.ctlz(arguments[0], ir.Constant(ir.IntType(1), 1)), ir.Constant(ir.IntType(64), 63))

    return types.int64(types.uint64), generate


@intrinsic  # type: ignore[untyped-decorator]
def gather(_typing: Any, array: Any, _offset: Any) -> Any:
    """One bit for each of 64 bytes of a flat uint8 array from an offset on: whether it is not 0. Nothing checks the bounds."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        chunk = ir.VectorType(ir.IntType(8), 64)
        address = builder.bitcast(builder.gep(data, [arguments[1]]), chunk.as_pointer())
        present = builder.icmp_unsigned("!=", builder.load(address, align=1), ir.Constant(chunk, [0] * 64))
        return builder.bitcast(present, ir.IntType(64))

    return types.uint64(array, types.int64), generate


def empty_plane(rows: int, cols: int) -> Plane:
    """A plane of zeros with room for (rows, cols) cells and the padding around them."""
    return np.zeros((64 * blocks(rows), blocks(cols)), dtype=np.uint64)


def blocks(cells: int) -> int:
    """Words that hold so many cells and the padding on both sides."""
    return -(-cells // 64) + 2


def pack(mask: BoolGrid, plane: Plane) -> None:
    """Set the bits of `plane` to the cells of bool (rows, cols)."""
    flat = np.ascontiguousarray(mask).view(np.uint8).reshape(-1)
    _pack(flat, mask.shape[0], mask.shape[1], plane)


def unpack(plane: Plane, rows: int, cols: int) -> BoolGrid:
    """The bool (rows, cols) grid that a plane holds."""
    inner = np.ascontiguousarray(plane[PAD : PAD + rows, 1:-1]).view(np.uint8)
    return np.unpackbits(inner, axis=1, bitorder="little")[:, :cols].view(np.bool_)


@numba.njit(cache=True, nogil=True)
def _pack(flat: npt.NDArray[np.uint8], rows: int, cols: int, plane: Plane) -> None:
    whole = cols >> 6
    for row in range(rows):
        for word in range(whole):
            plane[PAD + row, 1 + word] = gather(flat, row * cols + 64 * word)
        tail = np.uint64(0)
        for col in range(64 * whole, cols):
            tail |= np.uint64(flat[row * cols + col] != 0) << np.uint64(col & 63)
        if cols & 63:
            plane[PAD + row, 1 + whole] = tail


@numba.njit(cache=True, nogil=True)
def transpose(source: Plane, target: Plane) -> None:
    """Write the transposed copy of a padded plane, block by block of 64 × 64 cells."""
    block = np.empty((64, 8), dtype=np.uint64)
    last = source.shape[1] - 1
    for down in range(1, source.shape[0] // 64 - 1):
        for right in range(1, last, 8):
            lanes = min(8, last - right)
            for line in range(64):
                for lane in range(lanes):
                    block[line, lane] = source[64 * down + line, right + lane]
            _transpose_block(block)
            for lane in range(lanes):
                for line in range(64):
                    target[64 * (right + lane) + line, down] = block[line, lane]


@numba.njit(cache=True, nogil=True)
def _transpose_block(block: Plane) -> None:
    """Transpose eight 64 × 64 bit matrices side by side (Warren, Hacker's Delight, 7-3: swap ever smaller quarters)."""
    size, mask = 32, np.uint64(0xFFFFFFFF)
    while size > 0:
        shift = np.uint64(size)
        line = 0
        while line < 64:
            for lane in range(8):
                swapped = ((block[line, lane] >> shift) ^ block[line + size, lane]) & mask
                block[line + size, lane] ^= swapped
                block[line, lane] ^= swapped << shift
            line = (line + size + 1) & ~size
        size >>= 1
        mask ^= mask << np.uint64(size)
