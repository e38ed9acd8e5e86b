"""Whether a path on the grid is as short as on an endless one, on which all cells beyond are free.

Move every cell of a path that leaves the grid to the nearest cell of the grid: the path gets no
longer, and what was outside lies on the border. So no path outside is shorter than the best one
inside, unless it was moved onto a blocked cell b of the border; and then it is at least
octile(start, b) + octile(b, goal) long. Only such cells need to be looked for, and only on their
sides does the grid have to grow.
"""

from __future__ import annotations

import math

import numpy as np

from navcore.compiled import compiled, nested
from navcore.grid.bitplane import ONE, PAD, BitPlane, plane_of
from navcore.grid.flood_fill import flood
from navcore.grid.free_space import FREE, FreeSpace
from navcore.grid.grid import Box, Cell
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import SQRT2

TOP, LEFT, BOTTOM, RIGHT = 1, 2, 4, 8
"""Sides of the grid."""
_ROUNDING = 1e-6
"""Difference in cells below which two lengths are equal."""


def lacking_cells(space: FreeSpace, start: Cell, goal: Cell, outcome: Path | NoPath) -> Box | None:
    """Return the part with one more line on each side of the grid beyond which a shorter path from
    start to goal may lead; None where there is none.

    `outcome` is the shortest path on the grid. Without one, only a start and a goal that both
    reach the border may be connected outside.
    """
    if isinstance(outcome, NoPath) and outcome.reason is not Reason.UNREACHABLE:
        return None
    free, rows, cols = space.across[FREE], space.rows, space.cols
    length = outcome.length if isinstance(outcome, Path) else math.inf
    sides = sides_to_pass(free, rows, cols, *start, *goal, length - _ROUNDING)
    if sides == 0:
        return None
    if isinstance(outcome, NoPath) and not all(
        sides_reached(free, rows, cols, end) for end in (start, goal)
    ):
        return None
    return beyond(sides, rows, cols)


def beyond(sides: int, rows: int, cols: int) -> Box:
    """Return the grid of (rows, cols) with one line more on some sides."""
    top, left, bottom, right = (int(sides & side > 0) for side in (TOP, LEFT, BOTTOM, RIGHT))
    return -top, -left, rows + bottom, cols + right


def sides_reached(free: BitPlane, rows: int, cols: int, cell: Cell) -> int:
    """Return the sides of the grid that free cells connect a cell with."""
    reached = np.zeros_like(free)
    flood(free, reached, plane_of(cell, like=free))
    ends = reached[PAD : PAD + rows]
    first, last = PAD, PAD + cols - 1
    return (
        TOP * int(ends[0].any())
        | BOTTOM * int(ends[-1].any())
        | LEFT * int((ends[:, first >> 6] & ONE << np.uint64(first & 63)).any())
        | RIGHT * int((ends[:, last >> 6] & ONE << np.uint64(last & 63)).any())
    )


@compiled
def sides_to_pass(
    free: BitPlane,
    rows: int,
    cols: int,
    start_row: int,
    start_col: int,
    goal_row: int,
    goal_col: int,
    length: float,
) -> int:
    """Return the sides with a blocked cell of the border past which a path that is shorter than
    `length` cells might lead."""
    sides = 0
    for index in range(2 * cols):
        row, col = (0, index) if index < cols else (rows - 1, index - cols)
        if _may_pass(free, row, col, start_row, start_col, goal_row, goal_col, length):
            sides |= TOP if row == 0 else 0
            sides |= BOTTOM if row == rows - 1 else 0
    for index in range(2 * rows):
        row, col = (index, 0) if index < rows else (index - rows, cols - 1)
        if _may_pass(free, row, col, start_row, start_col, goal_row, goal_col, length):
            sides |= LEFT if col == 0 else 0
            sides |= RIGHT if col == cols - 1 else 0
    return sides


@nested
def _may_pass(
    free: BitPlane,
    row: int,
    col: int,
    start_row: int,
    start_col: int,
    goal_row: int,
    goal_col: int,
    length: float,
) -> bool:
    if free[row + PAD, (col + PAD) >> 6] >> np.uint64(col & 63) & ONE != 0:
        return False
    around = _octile(row - start_row, col - start_col) + _octile(row - goal_row, col - goal_col)
    return around < length


@nested
def _octile(rows: int, cols: int) -> float:
    rows, cols = abs(rows), abs(cols)
    return max(rows, cols) + (SQRT2 - 1.0) * min(rows, cols)
