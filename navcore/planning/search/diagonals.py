"""Diagonals packed into words: how far one can walk on a diagonal before a cell of it has to be
looked at, 64 cells at a time.

`FreeSpace.sloping` is uint64 (4, slots, words): diagonals that fall (row and column grow together)
walked southwards and northwards, then those that rise. Bit b of word w is the diagonal's cell in
row 64 w + b of the planes, set where a walk may pass: no straight walk to either side leads
anywhere (VAIN_AHEAD, VAIN_BACK), and one can step on. A bit that is not set costs a look at the
cell and nothing else. So all may be 0 at first: words are surveyed only once searches have walked a
diagonal for a while. Where a line has been forgotten since (`navcore.search.free_space.forget`),
the bits do not count, and once there are many such lines all diagonals are surveyed anew.

Word 0 lies in the padding. It holds whose words these are; in the second plane, how often a walk
was held up for nothing.
"""

from __future__ import annotations

import numpy as np

from navcore.compiled import inlined, lean
from navcore.grid.bitplane import ALL, ONE, BitPlanes, highest, lowest, mirrored, ones
from navcore.grid.free_space import DEAD_END_AHEAD, PATIENCE, SQUARE, VAIN_BACK, bit_of, look_along

OWNER = 0
TRIED = np.uint64(6)
"""So often a walk is held up for nothing on a diagonal before words of it are surveyed."""
FEW = 8
"""All diagonals are surveyed anew where more than one line in so many has been forgotten."""


@lean
def settle(across: BitPlanes, along: BitPlanes) -> None:
    """Before a search: have no diagonal surveyed if the bits of too many cells do not count any
    more."""
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
        across[VAIN_BACK, 0, OWNER] += ONE


@inlined
def slot_of(across: BitPlanes, sloping: BitPlanes, rising: int, line: int) -> int:
    """Where a diagonal's words are; those of another that were there are cleared."""
    slot: int = line & (sloping.shape[1] - 1)
    owner = across[VAIN_BACK, 0, OWNER] << np.uint64(32) | np.uint64(line)
    if sloping[np.uint64(2 * rising), np.uint64(slot), OWNER] != owner:
        clear(sloping, rising, slot, owner)
    return slot


@lean
def clear(sloping: BitPlanes, rising: int, slot: int, owner: np.uint64) -> None:
    """Give the words of a slot to another diagonal."""
    for plane in range(2 * rising, 2 * rising + 2):
        for word in range(sloping.shape[2]):
            sloping[plane, slot, word] = 0
    sloping[2 * rising, slot, OWNER] = owner


@inlined
def doubtful(across: BitPlanes, along: BitPlanes, rising: int, line: int, word: int) -> np.uint64:
    """The cells of a diagonal's word whose row or column has been forgotten since all diagonals
    were last surveyed anew."""
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
    sloping: BitPlanes,
    row: int,
    col: int,
    west: int,
    north: int,
    most: int,
) -> int:
    """Steps, at most so many, from a cell from which one can step on diagonally to the next that
    has to be looked at."""
    rising = west ^ north
    line = row + col if rising else col - row + across.shape[1]
    slot = slot_of(across, sloping, rising, line)
    plane = np.uint64(2 * rising + north)
    word, at = row >> 6, np.uint64(row & 63)
    if north:
        here = (ONE << at) - ONE
        while True:
            stops = ~sloping[plane, np.uint64(slot), np.uint64(word)] | doubtful(
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
        stops = ~sloping[plane, np.uint64(slot), np.uint64(word)] | doubtful(
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
    sloping: BitPlanes,
    row: int,
    col: int,
    west: int,
    north: int,
    goal: int,
) -> None:
    """A walk was held up at a cell for nothing: once that has happened often enough, survey the
    diagonal's word there.

    The goal's row and column stop at a goal of today (`navcore.search.jump_points.mark_goal`) and
    are left as they are.
    """
    rising = west ^ north
    line = row + col if rising else col - row + across.shape[1]
    slot, word = slot_of(across, sloping, rising, line), row >> 6
    south = sloping[2 * rising]
    back = sloping[2 * rising + 1]
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
        if row != goal >> 16 and across[DEAD_END_AHEAD, row, 0] < PATIENCE:
            look_along(across, row)
        if col != goal & 0xFFFF and along[DEAD_END_AHEAD, col, 0] < PATIENCE:
            look_along(along, col)
        east, beyond = bit_of(across, DEAD_END_AHEAD, row, col), bit_of(across, VAIN_BACK, row, col)
        open_south &= bit_of(along, DEAD_END_AHEAD, col, row) & (beyond if rising else east)
        open_north &= bit_of(along, VAIN_BACK, col, row) & (east if rising else beyond)
        passed_south |= open_south << np.uint64(bit)
        passed_north |= open_north << np.uint64(bit)
    south[slot, word], back[slot, word] = passed_south, passed_north
