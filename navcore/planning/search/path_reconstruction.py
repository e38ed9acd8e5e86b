"""Path reconstruction from jump points to cells: a leg between two of them has a diagonal and a
straight part, in the order that turns less.

Cells are numbered (row + PAD) << 16 | (col + PAD), as in `search.jump_point_search`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import inlined, lean, nested
from navcore.grid.bitplane import PAD, BitPlanes
from navcore.grid.free_space import FREE, SQUARE, bit_of


@nested
def expand_leg(cells: npt.NDArray[np.int64], at: int, corner: int, straight_first: bool) -> int:
    """Write the cells of one leg, diagonal and straight part in the order asked for; return the
    index of its last cell."""
    rows, cols = (corner >> 16) - PAD - cells[at, 0], (corner & 0xFFFF) - PAD - cells[at, 1]
    diagonal = min(abs(rows), abs(cols))
    straight = max(abs(rows), abs(cols)) - diagonal
    if straight_first:
        write_line(
            cells,
            at,
            straight,
            sign(rows) * (abs(rows) > diagonal),
            sign(cols) * (abs(cols) > diagonal),
        )
        write_line(cells, at + straight, diagonal, sign(rows), sign(cols))
    else:
        write_line(cells, at, diagonal, sign(rows), sign(cols))
        write_line(
            cells,
            at + diagonal,
            straight,
            sign(rows) * (abs(rows) > diagonal),
            sign(cols) * (abs(cols) > diagonal),
        )
    return int(at + diagonal + straight)


@lean
def write_line(
    cells: npt.NDArray[np.int64], at: int, steps: int, step_row: int, step_col: int
) -> None:
    """Write `steps` cells after `at`, all in one direction."""
    row, col = cells[at, 0], cells[at, 1]
    for step in range(1, steps + 1):
        cells[at + step, 0] = row + step * step_row
        cells[at + step, 1] = col + step * step_col


@inlined
def sign(number: int) -> int:
    """Return -1, 0 or 1."""
    return (number > 0) - (number < 0)


@nested
def fewest_turns(across: BitPlanes, corners: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Return for each leg between two jump points whether to walk its straight part first, which is
    equally long, if it is free.

    The search knows each leg diagonally first. Which order turns less depends on the legs before
    and after, so the fewest turns up to each leg are kept for both orders, from the last leg back
    to the first.
    """
    legs = len(corners) - 1
    turns = np.zeros((legs + 1, 2), dtype=np.int64)
    entry = np.zeros((legs + 1, 2), dtype=np.int64)
    then = np.zeros((legs + 1, 2), dtype=np.int64)
    for leg in range(legs - 1, -1, -1):
        diagonal, level = headings(corners[leg], corners[leg + 1])
        for order in range(2):
            entry[leg, order], leaving = (level, diagonal) if order else (diagonal, level)
            after = turns[leg + 1, 0] + (leg + 1 < legs and entry[leg + 1, 0] != leaving)
            other = turns[leg + 1, 1] + (leg + 1 < legs and entry[leg + 1, 1] != leaving)
            then[leg, order] = other < after
            turns[leg, order] = min(after, other) + (diagonal != level)
        # What follows can save the leg before one turn at most, so a worse order need not be
        # examined.
        if turns[leg, 1] > turns[leg, 0] or not is_clear(across, corners[leg], corners[leg + 1]):
            turns[leg, 1] = turns[leg, 0] + 2
    chosen = np.zeros(legs, dtype=np.bool_)
    order = int(legs > 0 and turns[0, 1] < turns[0, 0])
    for leg in range(legs):
        chosen[leg] = order == 1
        order = then[leg, order]
    return chosen


@lean
def headings(here: int, there: int) -> tuple[int, int]:
    """Return the directions of a leg's diagonal and straight part, as numbers that differ; the same
    twice if it has only one part."""
    rows, cols = (there >> 16) - (here >> 16), (there & 0xFFFF) - (here & 0xFFFF)
    diagonal = 3 * sign(rows) + sign(cols)
    if abs(rows) == abs(cols):
        return diagonal, diagonal
    level = 3 * sign(rows) if abs(rows) > abs(cols) else sign(cols)
    return (diagonal if rows != 0 and cols != 0 else level), level


@lean
def is_clear(across: BitPlanes, here: int, there: int) -> bool:
    """Return whether the leg from one cell to another, first straight and then diagonal, is
    free."""
    row, col = here >> 16, here & 0xFFFF
    rows, cols = (there >> 16) - row, (there & 0xFFFF) - col
    north, west = int(rows < 0), int(cols < 0)
    diagonal = min(abs(rows), abs(cols))
    straight = max(abs(rows), abs(cols)) - diagonal
    for _ in range(straight):
        if abs(rows) > abs(cols):
            row += sign(rows)
        else:
            col += sign(cols)
        if bit_of(across, FREE, row, col) == 0:
            return False
    for _ in range(diagonal):
        if bit_of(across, SQUARE, row - north, col - west) == 0:
            return False
        row += sign(rows)
        col += sign(cols)
    return True
