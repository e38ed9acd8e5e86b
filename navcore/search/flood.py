"""What is connected with what, on packed bits: 64 cells a step, where a flood cell by cell takes seconds on the largest maps.

Planes are those of `navcore.search.bits`. Connected is by straight steps: where corners are not cut, a diagonal one leads
nowhere that two straight ones do not lead to.
"""

from __future__ import annotations

import numpy as np

from navcore.search.bits import ONE, PAD, Plane, compiled, inlined, mirrored

TOP = np.uint64(63)


@compiled
def flood(free: Plane, reached: Plane, begin: Plane) -> None:
    """Add to `reached` what `begin` holds, and every free cell that is connected, over free ones, with a free cell of that."""
    last = free.shape[0] - PAD - 1
    due = np.zeros(free.shape[0], dtype=np.bool_)  # lines that have not heard of all that was reached in them or beside them
    waiting = False
    for line in range(PAD, last + 1):
        for word in range(1, free.shape[1] - 1):
            if begin[line, word] != 0:
                reached[line, word] |= begin[line, word]
                due[line - 1] = due[line] = due[line + 1] = waiting = True
    while waiting:
        waiting = False
        # Downwards and upwards in turn, so that a long straight way takes one sweep.
        for line in range(PAD, last + 1):
            if due[line] and _spread(free, reached, line):
                due[line - 1] = due[line + 1] = True
            due[line] = False
        for line in range(last, PAD - 1, -1):
            if due[line] and _spread(free, reached, line):
                due[line - 1] = due[line + 1] = waiting = True
            due[line] = False


@compiled
def beside(cells: Plane) -> Plane:
    """The cells one straight step away from these; the padding means nothing."""
    found = np.zeros_like(cells)
    for line in range(PAD, cells.shape[0] - PAD):
        for word in range(1, cells.shape[1] - 1):
            here = cells[line, word]
            west, east = here << ONE | cells[line, word - 1] >> TOP, here >> ONE | cells[line, word + 1] << TOP
            found[line, word] = cells[line - 1, word] | cells[line + 1, word] | west | east
    return found


@inlined
def _spread(free: Plane, reached: Plane, line: int) -> bool:
    """Add to a line what is connected, along it, with what has been reached in it and in the lines next to it."""
    grown, carried = False, np.uint64(0)
    for word in range(1, free.shape[1] - 1):
        open_, known = free[line, word], reached[line, word]
        above, below = reached[line - 1, word] & free[line - 1, word], reached[line + 1, word] & free[line + 1, word]
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
    return free & ((free ^ (free + cells)) | cells)  # the sum carries through a run, and past it into a cell that is not free
