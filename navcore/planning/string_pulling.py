"""String pulling: the path shortened to straight lines between corners over its first stretch; the
grid has only eight directions.

Many paths on the grid are equally short, and the one that is found may deviate far from the
straight line between corners. Pulled taut it is never longer, and crosses free cells only.
"""

from __future__ import annotations

import numpy as np

from navcore.compiled import compiled
from navcore.geometry.arrays import Indices
from navcore.grid.bitplane import ONE, PAD, BitPlane


def shortcut(cells: Indices, free: BitPlane, *, stretch: int) -> Indices:
    """Return the (M, 2) corners (row, col) of the taut path; from the first corner more than
    `stretch` cells along it is the path itself.

    `cells` is (N, 2), all cells of a path; `free` is the plane of the free cells. Between two
    corners the straight line of their centres crosses free cells only, and passes no blocked cell's
    corner.
    """
    return cells[_corners(np.ascontiguousarray(cells), free, stretch)]


@compiled
def _corners(cells: Indices, free: BitPlane, stretch: int) -> Indices:
    """Indices of the cells that remain: from each the furthest that is visible without a break."""
    kept = np.empty(len(cells), dtype=np.int64)
    kept[0], count, at = 0, 1, 0
    while at < len(cells) - 1:
        further = at + 1
        if at < stretch:
            while (
                further < len(cells) - 1
                and further < at + stretch
                and line_of_sight(free, cells[at], cells[further + 1])
            ):
                further += 1
        at = further
        kept[count] = at
        count += 1
    return kept[:count]


@compiled
def line_of_sight(free: BitPlane, here: Indices, there: Indices) -> bool:
    """Return whether the straight line between the centres of two free cells crosses free cells
    only; where it passes a corner, both cells beside it must be free."""
    rows, cols = abs(there[0] - here[0]), abs(there[1] - here[1])
    row, col = here[0], here[1]
    row_step, col_step = (1 if there[0] > row else -1), (1 if there[1] > col else -1)
    # Positive while the line leaves the present cell through its side towards the next column,
    # negative through the next row's.
    side = cols - rows
    for _ in range(rows + cols):
        if row == there[0] and col == there[1]:
            break
        if side == 0:
            # Through a corner, as a diagonal step: both cells beside it have to be free.
            if not (_is_free(free, row + row_step, col) and _is_free(free, row, col + col_step)):
                return False
            row, col, side = row + row_step, col + col_step, side + 2 * (cols - rows)
        elif side > 0:
            col, side = col + col_step, side - 2 * rows
        else:
            row, side = row + row_step, side + 2 * cols
        if not _is_free(free, row, col):
            return False
    return True


@compiled
def _is_free(free: BitPlane, row: int, col: int) -> bool:
    return bool(free[row + PAD, (col + PAD) >> 6] >> np.uint64(col & 63) & ONE)
