"""Diagonals packed into words: the number of steps along a diagonal to the next cell that must be
examined, found 64 cells at a time.

`FreeSpace.diagonal_ends` is uint64 (4, slots, words): diagonals that fall (row and column grow
together) walked southwards and northwards, then those that rise. Bit b of word w is the diagonal's
cell in row 64 w + b of the planes, set where a walk may pass: straight walks to both sides are dead
ends (DEAD_END_AHEAD, DEAD_END_BACK), and the next step is free. A bit that is not set costs an
examination of the cell and nothing else. So all may be 0 at first: words are surveyed only after
searches have walked a diagonal several times. Where a line has been forgotten since
(`navcore.grid.free_space.forget`), the bits do not count, and once there are many such lines all
diagonals are surveyed again.

Word 0 lies in the padding. It holds the number of the diagonal that owns the words; in the second
plane, the number of stops that were needless.
"""

from __future__ import annotations

import numpy as np

from navcore.compiled import inlined, lean
from navcore.grid.bitplane import ALL, ONE, BitPlanes, highest, lowest, mirrored, ones
from navcore.grid.free_space import (
    DEAD_END_AHEAD,
    DEAD_END_BACK,
    REQUESTS_BEFORE_SCAN,
    SQUARE,
    bit_of,
    find_dead_ends,
)

OWNER = 0
TRIED = np.uint64(6)
"""Number of needless stops on a diagonal before words of it are surveyed."""
FEW = 8
"""All diagonals are surveyed again when more than one line in this number has been forgotten."""


@lean
def settle(across: BitPlanes, along: BitPlanes) -> None:
    """Discard all surveys before a search if the bits of too many cells do not count any more."""
    lost = 0
    for word in range(across.shape[2]):
        lost += ones(across[DEAD_END_AHEAD, 0, word])
    for word in range(along.shape[2]):
        lost += ones(along[DEAD_END_AHEAD, 0, word])
    if lost * FEW > across.shape[1] + along.shape[1]:
        for word in range(across.shape[2]):
            across[DEAD_END_AHEAD, 0, word] = 0
        for word in range(along.shape[2]):
            along[DEAD_END_AHEAD, 0, word] = 0
        across[DEAD_END_BACK, 0, OWNER] += ONE


@inlined
def slot_of(across: BitPlanes, diagonal_ends: BitPlanes, rising: int, line: int) -> int:
    """Return the slot of a diagonal's words; those of another diagonal in it are cleared."""
    slot: int = line & (diagonal_ends.shape[1] - 1)
    owner = across[DEAD_END_BACK, 0, OWNER] << np.uint64(32) | np.uint64(line)
    if diagonal_ends[np.uint64(2 * rising), np.uint64(slot), OWNER] != owner:
        clear(diagonal_ends, rising, slot, owner)
    return slot


@lean
def clear(diagonal_ends: BitPlanes, rising: int, slot: int, owner: np.uint64) -> None:
    """Assign the words of a slot to another diagonal."""
    for plane in range(2 * rising, 2 * rising + 2):
        for word in range(diagonal_ends.shape[2]):
            diagonal_ends[plane, slot, word] = 0
    diagonal_ends[2 * rising, slot, OWNER] = owner


@inlined
def doubtful(across: BitPlanes, along: BitPlanes, rising: int, line: int, word: int) -> np.uint64:
    """Return the cells of a diagonal's word whose row or column has been forgotten since all
    surveys were last discarded."""
    col = line - 64 * word - 63 if rising else line - across.shape[1] + 64 * word
    at, shift = np.uint64(col >> 6), np.uint64(col & 63)
    cols = across[DEAD_END_AHEAD, 0, at] >> shift | across[DEAD_END_AHEAD, 0, at + ONE] << ONE << (
        np.uint64(63) - shift
    )
    if rising:
        cols = mirrored(cols)
    lost: np.uint64 = along[DEAD_END_AHEAD, 0, np.uint64(word)] | cols
    return lost


@lean
def passable(
    across: BitPlanes,
    along: BitPlanes,
    diagonal_ends: BitPlanes,
    row: int,
    col: int,
    west: int,
    north: int,
    most: int,
) -> int:
    """Return the steps, at most `most`, from a cell with a free diagonal step to the next cell that
    must be examined."""
    rising = west ^ north
    line = row + col if rising else col - row + across.shape[1]
    slot = slot_of(across, diagonal_ends, rising, line)
    plane = np.uint64(2 * rising + north)
    word, at = row >> 6, np.uint64(row & 63)
    if north:
        here = (ONE << at) - ONE
        while True:
            stops = ~diagonal_ends[plane, np.uint64(slot), np.uint64(word)] | doubtful(
                across, along, rising, line, word
            )
            stops &= here
            if stops != 0:
                return min(most, row - 64 * word - int(highest(stops)))
            if row - 64 * word >= most:
                return most
            word, here = word - 1, ALL
    here = ALL << at << ONE
    while True:
        stops = ~diagonal_ends[plane, np.uint64(slot), np.uint64(word)] | doubtful(
            across, along, rising, line, word
        )
        stops &= here
        if stops != 0:
            return min(most, 64 * word + int(lowest(stops)) - row)
        if 64 * word + 63 - row >= most:
            return most
        word, here = word + 1, ALL


@lean
def survey(
    across: BitPlanes,
    along: BitPlanes,
    diagonal_ends: BitPlanes,
    row: int,
    col: int,
    west: int,
    north: int,
    goal: int,
) -> None:
    """Count a needless stop at a cell; after `TRIED` of them, survey the diagonal's word there.

    The goal's row and column stop at the goal of this search (`jump_point_search.mark_goal`) and
    are left as they are.
    """
    rising = west ^ north
    line = row + col if rising else col - row + across.shape[1]
    slot, word = slot_of(across, diagonal_ends, rising, line), row >> 6
    south = diagonal_ends[2 * rising]
    back = diagonal_ends[2 * rising + 1]
    if south[slot, word] | back[slot, word] != 0:
        return
    back[slot, OWNER] += ONE
    if back[slot, OWNER] < TRIED:
        return
    passed_south, passed_north = np.uint64(0), np.uint64(0)
    known = ~doubtful(across, along, rising, line, word)
    for bit in range(64):
        row = 64 * word + bit
        col = line - row if rising else line - across.shape[1] + row
        if known >> np.uint64(bit) & ONE == 0 or not (0 < col < along.shape[1]):
            continue
        # The square that a step south leads through, and that of a step north.
        open_south, open_north = (
            bit_of(across, SQUARE, row, col - rising),
            bit_of(across, SQUARE, row - 1, col - 1 + rising),
        )
        if open_south | open_north == 0:
            continue
        if row != goal >> 16 and across[DEAD_END_AHEAD, row, 0] < REQUESTS_BEFORE_SCAN:
            find_dead_ends(across, row)
        if col != goal & 0xFFFF and along[DEAD_END_AHEAD, col, 0] < REQUESTS_BEFORE_SCAN:
            find_dead_ends(along, col)
        east, beyond = (
            bit_of(across, DEAD_END_AHEAD, row, col),
            bit_of(across, DEAD_END_BACK, row, col),
        )
        open_south &= bit_of(along, DEAD_END_AHEAD, col, row) & (beyond if rising else east)
        open_north &= bit_of(along, DEAD_END_BACK, col, row) & (east if rising else beyond)
        passed_south |= open_south << np.uint64(bit)
        passed_north |= open_north << np.uint64(bit)
    south[slot, word], back[slot, word] = passed_south, passed_north
