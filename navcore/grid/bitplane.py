"""Bit planes: grids packed into words of 64 cells, and the machine instructions for such words.

A plane is uint64 (lines, words); bit b of word w of line l is the cell (l, 64 w + b). Planes are
padded by 64 blocked cells on every side (`PAD`), so that no scan needs a bounds check and a plane
and its transposed copy are cut into the same blocks.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types

from navcore.compiled import compiled, instruction, nested
from navcore.grid.grid import BoolGrid, Cell

BitPlane = npt.NDArray[np.uint64]
"""(lines, words) padded plane of cells."""
BitPlanes = npt.NDArray[np.uint64]
"""(planes, lines, words) stack of planes."""

PAD = 64
"""Blocked cells on every side of a plane."""
ZERO, ONE, ALL = np.uint64(0), np.uint64(1), np.uint64(2**64 - 1)
LONGEST_SIDE, MOST_CELLS = 65_000, 2**26
"""Limits of a grid: cells are numbered by 16 bits a side, padding included, and path lengths
(`search.open_list.UNIT`) are bounded for paths of 2^25 cells."""


@instruction
def lowest(_typing: Any, _word: Any) -> Any:
    """Return the number of the lowest set bit of a non-zero uint64."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.uint64), generate


@instruction
def highest(_typing: Any, _word: Any) -> Any:
    """Return the number of the highest set bit of a non-zero uint64."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.xor(
            builder.ctlz(arguments[0], ir.Constant(ir.IntType(1), 1)),
            ir.Constant(ir.IntType(64), 63),
        )

    return types.int64(types.uint64), generate


@instruction
def ones(_typing: Any, _word: Any) -> Any:
    """Return the number of set bits of a uint64."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return types.int64(types.uint64), generate


@instruction
def mirrored(_typing: Any, _word: Any) -> Any:
    """Return a uint64 with its bits in reverse order."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.bitreverse(arguments[0])

    return types.uint64(types.uint64), generate


@instruction
def joined_left(_typing: Any, _high: Any, _low: Any, _by: Any) -> Any:
    """Return the upper 64 bits of two joined uint64 after a left shift by 0 to 63 bits."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        shift = builder.module.declare_intrinsic(
            "llvm.fshl", [word], ir.FunctionType(word, [word] * 3)
        )
        return builder.call(shift, arguments)

    return types.uint64(types.uint64, types.uint64, types.uint64), generate


@instruction
def gather(_typing: Any, array: Any, _offset: Any, _of: Any) -> Any:
    """Return one bit for each of 64 bytes of a flat uint8 array from an offset on: whether the byte
    shares a set bit with the uint8 `of`.

    Bounds are not checked. This takes one or two instructions on current processors, and a loop
    over the bytes hundreds.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        byte, chunk = ir.IntType(8), ir.VectorType(ir.IntType(8), 64)
        address = builder.bitcast(builder.gep(data, [arguments[1]]), chunk.as_pointer())
        one = builder.insert_element(
            ir.Constant(chunk, ir.Undefined), arguments[2], ir.Constant(ir.IntType(32), 0)
        )
        of = builder.shuffle_vector(
            one,
            ir.Constant(chunk, ir.Undefined),
            ir.Constant(ir.VectorType(ir.IntType(32), 64), [0] * 64),
        )
        shared = builder.and_(builder.load(address, align=1), of)
        present = builder.icmp_unsigned(
            "!=", shared, ir.Constant(chunk, [ir.Constant(byte, 0)] * 64)
        )
        return builder.bitcast(present, ir.IntType(64))

    return types.uint64(array, types.int64, types.uint8), generate


@instruction
def cells_from(_typing: Any, plane: Any, _byte: Any) -> Any:
    """Return 32 cells of a contiguous plane, as the bits of a uint32, from a byte of it on.

    Bounds are not checked.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        first = builder.bitcast(data, ir.IntType(8).as_pointer())
        address = builder.bitcast(builder.gep(first, [arguments[1]]), ir.IntType(32).as_pointer())
        return builder.load(address, align=1)

    return types.uint32(plane, types.int64), generate


def empty_plane(rows: int, cols: int) -> BitPlane:
    """Return a plane of zeros for (rows, cols) cells and the padding around them."""
    return np.zeros((64 * blocks(rows), blocks(cols)), dtype=np.uint64)


def blocks(cells: int) -> int:
    """Return the number of words for a line of cells with the padding on both sides."""
    return -(-cells // 64) + 2


def pack(mask: BoolGrid, plane: BitPlane) -> None:
    """Write the True (or non-zero) cells of (rows, cols) into a plane."""
    if mask.itemsize != 1:
        mask = np.not_equal(mask, 0)
    flat = np.ascontiguousarray(mask).view(np.uint8).reshape(-1)
    _pack(flat, mask.shape[0], mask.shape[1], plane)


def unpack(plane: BitPlane, rows: int, cols: int) -> BoolGrid:
    """Return the bool (rows, cols) grid of a plane."""
    inner = np.ascontiguousarray(plane[PAD : PAD + rows, 1:-1]).view(np.uint8)
    return np.unpackbits(inner, axis=1, bitorder="little")[:, :cols].view(np.bool_)


def plane_of(cell: Cell, *, like: BitPlane) -> BitPlane:
    """Return a plane of the same size that holds only the cell (row, col)."""
    plane = np.zeros_like(like)
    plane[cell[0] + PAD, (cell[1] + PAD) >> 6] = ONE << np.uint64(cell[1] & 63)
    return plane


def contains(plane: BitPlane, cell: Cell) -> bool:
    """Return whether a plane holds the cell (row, col) of its grid."""
    return bool(plane[cell[0] + PAD, (cell[1] + PAD) >> 6] >> np.uint64(cell[1] & 63) & ONE)


def cells_of(plane: BitPlane) -> npt.NDArray[np.int64]:
    """Return the (N, 2) cells (row, col) of a plane in reading order; costs one pass over the
    words."""
    lines, words = np.nonzero(plane)
    held = np.unpackbits(plane[lines, words, None].view(np.uint8), axis=1, bitorder="little").view(
        np.bool_
    )
    which, bit = np.nonzero(held)
    return np.column_stack([lines[which] - PAD, 64 * words[which] + bit - PAD])


@compiled
def _pack(flat: npt.NDArray[np.uint8], rows: int, cols: int, plane: BitPlane) -> None:
    whole = cols >> 6
    for row in range(rows):
        for word in range(whole):
            plane[PAD + row, 1 + word] = gather(flat, row * cols + 64 * word, np.uint8(255))
        tail = np.uint64(0)
        for col in range(64 * whole, cols):
            tail |= np.uint64(flat[row * cols + col] != 0) << np.uint64(col & 63)
        if cols & 63:
            plane[PAD + row, 1 + whole] = tail


@nested
def transpose(source: BitPlane, target: BitPlane) -> None:
    """Write the transposed copy of a padded plane, block by block of 64 × 64 cells."""
    block = np.empty(64, dtype=np.uint64)
    bytes_of_block = block.view(np.uint8)
    for right in range(1, source.shape[1] - 1):
        for down in range(1, target.shape[1] - 1):
            # Rows are ordered so that swapping bytes leaves the 64 rows of 8 neighbouring columns
            # side by side, in order.
            for line in range(64):
                block[(line & 7) << 3 | line >> 3] = source[
                    np.uint64(64 * down + line), np.uint64(right)
                ]
            _transpose_bytes(block)
            for line in range(64):
                bits = gather(bytes_of_block, (line & ~7) << 3, np.uint8(1 << (line & 7)))
                target[np.uint64(64 * right + line), np.uint64(down)] = bits


@nested
def _transpose_bytes(block: BitPlane) -> None:
    """Exchange off-diagonal quarters down to bytes (Warren, Hacker's Delight, 7-3); loops of fixed
    length are vectorised."""
    for line in range(32):
        _exchange(block, line, line + 32, 32, 0x00000000FFFFFFFF)
    for line in range(16):
        _exchange(block, line, line + 16, 16, 0x0000FFFF0000FFFF)
    for line in range(32, 48):
        _exchange(block, line, line + 16, 16, 0x0000FFFF0000FFFF)
    for first in range(0, 64, 16):
        for line in range(8):
            _exchange(block, first + line, first + line + 8, 8, 0x00FF00FF00FF00FF)


@nested
def _exchange(block: BitPlane, upper: int, lower: int, shift: int, mask: int) -> None:
    up, low = np.uint64(upper), np.uint64(lower)
    swapped = ((block[up] >> np.uint64(shift)) ^ block[low]) & np.uint64(mask)
    block[low] ^= swapped
    block[up] ^= swapped << np.uint64(shift)


@compiled
def complement(plane: BitPlane, rows: int, cols: int) -> None:
    """Exchange the free and blocked cells of a plane; the padding becomes 0."""
    whole = cols >> 6
    for line in range(PAD, PAD + rows):
        for word in range(1, whole + 1):
            plane[line, word] = ~plane[line, word]
        if cols & 63:
            plane[line, whole + 1] = ~plane[line, whole + 1] & ((ONE << np.uint64(cols & 63)) - ONE)
