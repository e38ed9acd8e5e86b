"""What is connected with what, on packed bits: 64 cells a step, where a flood cell by cell takes
seconds on the largest maps.

Planes are those of `navcore.search.bits`. Connected is by straight steps: where corners are not
cut, a diagonal one leads nowhere that two straight ones do not lead to.
"""

from __future__ import annotations

import numpy as np

from navcore.compiled import compiled, inlined
from navcore.grid.bitplane import ONE, PAD, BitPlane, mirrored

TOP = np.uint64(63)


@compiled
def flood(free: BitPlane, reached: BitPlane, begin: BitPlane) -> tuple[int, int]:
    """Add to `reached` what `begin` holds, and every free cell that is connected, over free ones,
    with a free cell of that.

    Returns the first and the last line in which something was added.
    """
    last = free.shape[0] - PAD - 1
    due = np.zeros(
        free.shape[0], dtype=np.bool_
    )  # lines that have not heard of all that was reached in them or beside them
    waiting, low, high = False, free.shape[0], 0
    for line in range(PAD, last + 1):
        for word in range(1, free.shape[1] - 1):
            if begin[line, word] != 0:
                reached[line, word] |= begin[line, word]
                due[line - 1] = due[line] = due[line + 1] = waiting = True
                low, high = min(low, line), line
    while waiting:
        waiting = False
        # Downwards and upwards in turn, so that a long straight way takes one sweep.
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
    return low, high


@compiled
def beside(cells: BitPlane) -> BitPlane:
    """The cells one straight step away from these; the padding means nothing."""
    found = np.zeros_like(cells)
    for line in range(PAD, cells.shape[0] - PAD):
        for word in range(1, cells.shape[1] - 1):
            found[line, word] = _beside(cells, line, word)
    return found


@compiled
def crossings(free: BitPlane, closed: BitPlane, within: BitPlane, end: BitPlane) -> BitPlane:
    """The cells of `within` that are one step from where it is left on the ways to `end` with the
    fewest closed cells.

    A wave from the end on: free cells are flooded, and closed ones entered one step after the
    other. `end` holds one cell, and `within` whole areas of free cells, it not among them; where no
    way leads there, nothing is found.
    """
    reached, entered, begin = end & (free | closed), end & closed, end & free
    spare, lowest, highest = np.zeros_like(free), PAD, free.shape[0] - PAD - 1
    first, last = (
        lowest,
        highest,
    )  # the lines that hold all of `entered`; what lies elsewhere is not looked at again
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
        # The closed cells beside what has just been reached are entered next.
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
    """What of one word is a straight step away from some cells."""
    here = cells[line, word]
    west, east = (
        here << ONE | cells[line, word - 1] >> TOP,
        here >> ONE | cells[line, word + 1] << TOP,
    )
    around: np.uint64 = cells[line - 1, word] | cells[line + 1, word] | west | east
    return around


@inlined
def _spread(free: BitPlane, reached: BitPlane, line: int) -> bool:
    """Add to a line what is connected, along it, with what has been reached in it and in the lines
    next to it."""
    grown, carried = False, np.uint64(0)
    for word in range(1, free.shape[1] - 1):
        open_, known = free[line, word], reached[line, word]
        above, below = (
            reached[line - 1, word] & free[line - 1, word],
            reached[line + 1, word] & free[line + 1, word],
        )
        found = _up(open_, (known | above | below | carried) & open_)
        reached[line, word] = known | found
        grown |= found & ~known != 0
        carried = found >> TOP
    carried = np.uint64(0)
    for word in range(free.shape[1] - 2, 0, -1):
        open_, known = free[line, word], reached[line, word]
        found = mirrored(_up(mirrored(open_), mirrored((known | carried << TOP) & open_)))
        reached[line, word] = known | found
        grown |= found & ~known != 0
        carried = found & ONE
    return grown


@inlined
def _up(free: np.uint64, cells: np.uint64) -> np.uint64:
    """Of each run of free cells the part from the lowest of `cells` in it upwards; they are free."""
    return free & (
        (free ^ (free + cells)) | cells
    )  # the sum carries through a run, and past it into a cell that is not free
