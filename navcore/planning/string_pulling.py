"""String pulling: a path of cells shortened to straight lines between the corners that it needs; a
grid has only eight directions.

Many paths on the grid are equally short, and the one that is found may deviate far from the
straight line between corners. Pulled taut it is never longer, and crosses free cells only. Its
corners are the waypoints.
"""

from __future__ import annotations

import numpy as np

from navcore.compiled import compiled, nested
from navcore.geometry.arrays import Indices
from navcore.grid.bitplane import ONE, PAD, BitPlane


def taut_corners(cells: Indices, free: BitPlane) -> Indices:
    """Return the (M, 2) corners (row, col) of the taut path, its first and last cell among them.

    `cells` is (N, 2), all cells of a path; `free` is the plane of the free cells. Between two
    corners the straight line of their centres crosses free cells only, and passes no blocked cell's
    corner. No corner can be left out: those before and after it do not see each other.
    """
    return cells[_corners(np.ascontiguousarray(cells), free)]


@compiled
def _corners(cells: Indices, free: BitPlane) -> Indices:
    """Indices of the cells that remain."""
    kept = np.zeros(len(cells), dtype=np.int64)
    count = 1
    while kept[count - 1] < len(cells) - 1:
        corner = _furthest_visible(cells, free, kept[count - 1])
        while count > 1 and line_of_sight(free, cells[kept[count - 2]], cells[corner]):
            count -= 1
        kept[count] = corner
        count += 1
    return kept[:count]


@nested
def _furthest_visible(cells: Indices, free: BitPlane, at: int) -> int:
    """Index of a cell that is visible from the cell `at`, while the one after it is not, or of the
    last; by doubled steps and then bisection, because long lines of sight take long to check."""
    near, last, step = at + 1, len(cells) - 1, 1
    far = min(near + step, last)
    while near < last and line_of_sight(free, cells[at], cells[far]):
        near, step = far, 2 * step
        far = min(near + step, last)
    while far - near > 1:
        middle = (near + far) // 2
        if line_of_sight(free, cells[at], cells[middle]):
            near = middle
        else:
            far = middle
    return near


@nested
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


@nested
def _is_free(free: BitPlane, row: int, col: int) -> bool:
    return bool(free[row + PAD, (col + PAD) >> 6] >> np.uint64(col & 63) & ONE)
