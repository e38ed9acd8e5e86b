"""Flood fill on bit planes: 64 cells a step; cell by cell it takes seconds on the largest maps.

Planes are those of `navcore.grid.bitplane`. Cells are connected by straight steps: without corner
cutting, a diagonal step reaches nothing that two straight ones do not.
"""

from __future__ import annotations

import numpy as np

from navcore.compiled import compiled, inlined, nested
from navcore.geometry.arrays import Bools
from navcore.grid.bitplane import ONE, PAD, BitPlane, mirrored
from navcore.grid.grid import Cell

TOP = np.uint64(63)
"""Number of the highest bit of a word."""


@compiled
def flood(free: BitPlane, reached: BitPlane, begin: BitPlane) -> tuple[int, int]:
    """Add to `reached` the cells of `begin` and all free cells that are connected with its free
    ones.

    Returns the first and the last line with an added cell.
    """
    last = free.shape[0] - PAD - 1
    due = np.zeros(free.shape[0], dtype=np.bool_)
    waiting, low, high = False, free.shape[0], 0
    for line in range(PAD, last + 1):
        for word in range(1, free.shape[1] - 1):
            if begin[line, word] != 0:
                reached[line, word] |= begin[line, word]
                due[line - 1] = due[line] = due[line + 1] = waiting = True
                low, high = min(low, line), line
    while waiting:
        waiting, top, bottom = _sweep(free, reached, due)
        low, high = min(low, top), max(high, bottom)
    return low, high


@nested
def _sweep(free: BitPlane, reached: BitPlane, due: Bools) -> tuple[bool, int, int]:
    """Spread downwards and then upwards, so that a long straight corridor takes one sweep.

    `due` are the lines in which, or beside which, cells were reached that have not spread along the
    line yet. Returns whether there are any left, and the first and the last line with an added
    cell.
    """
    last, waiting, low, high = free.shape[0] - PAD - 1, False, free.shape[0], 0
    for line in range(PAD, last + 1):
        if due[line] and _spread(free, reached, line):
            due[line - 1] = due[line + 1] = True
            low, high = min(low, line), max(high, line)
        due[line] = False
    for line in range(last, PAD - 1, -1):
        if due[line] and _spread(free, reached, line):
            due[line - 1] = due[line + 1] = waiting = True
            low, high = min(low, line), max(high, line)
        due[line] = False
    return waiting, low, high


@nested
def are_separate(free: BitPlane, first: Cell, second: Cell, sweeps: int) -> bool:
    """Return whether free cells, (line, column) of the plane, are found not to be connected within
    a number of sweeps: open ground takes a few, a maze as many as it has turns."""
    reached, due = np.zeros_like(free), np.zeros(free.shape[0], dtype=np.bool_)
    reached[first[0], first[1] >> 6] = ONE << np.uint64(first[1] & 63)
    due[first[0] - 1] = due[first[0]] = due[first[0] + 1] = True
    for _ in range(sweeps):
        waiting, _, _ = _sweep(free, reached, due)
        if reached[second[0], second[1] >> 6] >> np.uint64(second[1] & 63) & ONE:
            return False
        if not waiting:
            return True
    return False


@nested
def beside(cells: BitPlane) -> BitPlane:
    """Return the cells one straight step away from a set; the padding is undefined."""
    found = np.zeros_like(cells)
    for line in range(PAD, cells.shape[0] - PAD):
        for word in range(1, cells.shape[1] - 1):
            found[line, word] = _beside(cells, line, word)
    return found


@compiled
def crossings(free: BitPlane, closed: BitPlane, within: BitPlane, end: BitPlane) -> BitPlane:
    """Return the cells of `within` at which the paths to `end` with the fewest closed cells leave
    it.

    A wavefront starts at the end: free cells are flooded, and closed ones entered step by step.
    `end` holds one cell outside of `within`, which holds whole areas of free cells. Without a path
    the result is empty.
    """
    reached, entered, begin = end & (free | closed), end & closed, end & free
    spare, lowest, highest = np.zeros_like(free), PAD, free.shape[0] - PAD - 1
    first, last = lowest, highest  # the lines of `entered`; others need not be visited again
    while True:
        top, bottom, is_found, is_open = (
            max(first - 1, lowest),
            min(last + 1, highest),
            False,
            False,
        )
        for line in range(top, bottom + 1):
            for word in range(1, free.shape[1] - 1):
                around = _beside(entered, line, word)
                begin[line, word] |= around & free[line, word] & ~reached[line, word]
                is_found |= around & within[line, word] != 0
                is_open |= begin[line, word] != 0
        if is_found:
            return beside(entered) & within
        if is_open:
            low, high = flood(free, reached, begin)
            begin[top : bottom + 1] = 0
            top, bottom = max(min(top, low - 1), lowest), min(max(bottom, high + 1), highest)
        # The closed cells beside the cells just reached are entered next.
        entered, spare = spare, entered
        low, high = highest, lowest - 1
        for line in range(top, bottom + 1):
            for word in range(1, free.shape[1] - 1):
                entered[line, word] = (
                    _beside(reached, line, word) & closed[line, word] & ~reached[line, word]
                )
                if entered[line, word] != 0:
                    low, high = min(low, line), line
        if high < low:
            return entered
        for line in range(low, high + 1):
            for word in range(1, free.shape[1] - 1):
                reached[line, word] |= entered[line, word]
        spare[first : last + 1] = 0
        first, last = low, high


@inlined
def _beside(cells: BitPlane, line: int, word: int) -> np.uint64:
    """Return the cells of one word that are one straight step away from a set."""
    here = cells[line, word]
    west, east = (
        here << ONE | cells[line, word - 1] >> TOP,
        here >> ONE | cells[line, word + 1] << TOP,
    )
    around: np.uint64 = cells[line - 1, word] | cells[line + 1, word] | west | east
    return around


@inlined
def _spread(free: BitPlane, reached: BitPlane, line: int) -> bool:
    """Spread the reached cells of a line and its neighbours along the line; return whether any cell
    was added."""
    grown, carried = False, np.uint64(0)
    for word in range(1, free.shape[1] - 1):
        open_, known = free[line, word], reached[line, word]
        missing = open_ & ~known
        if missing != 0:
            above = reached[line - 1, word] & free[line - 1, word]
            below = reached[line + 1, word] & free[line + 1, word]
            found = _up(open_, (known | above | below | carried) & open_)
            reached[line, word] = known | found
            grown |= found & missing != 0
        carried = (reached[line, word] & open_) >> TOP
    carried = np.uint64(0)
    for word in range(free.shape[1] - 2, 0, -1):
        open_, known = free[line, word], reached[line, word]
        missing, near = open_ & ~known, (known | carried << TOP) & open_
        if missing != 0 and near != 0:
            found = mirrored(_up(mirrored(open_), mirrored(near)))
            reached[line, word] = known | found
            grown |= found & missing != 0
        carried = reached[line, word] & open_ & ONE
    return grown


@inlined
def _up(free: np.uint64, cells: np.uint64) -> np.uint64:
    """Return the part of each run of free cells from the lowest of `cells`, all free, upwards."""
    # The sum carries through a run, and past it into a cell that is not free.
    return free & ((free ^ (free + cells)) | cells)
