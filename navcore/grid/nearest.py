"""Nearest cells: among given ones, among the free ones, among those that can be reached."""

from __future__ import annotations

import math

import cv2
import numpy as np

from navcore.geometry.arrays import Indices
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, Cell


def nearest_of(cells: Indices, cell: Cell, within: float = math.inf) -> Cell | None:
    """Return the one of (N, 2) cells nearest to `cell`, or None without one within that many cells.

    The distance is the straight one between centres; of equally near cells the first is taken.
    """
    squared = ((cells - cell) ** 2).sum(axis=1)
    if len(cells) == 0 or squared.min() > within**2:
        return None
    row, col = cells[int(np.argmin(squared))]
    return int(row), int(col)


def nearest_marked(mask: BoolGrid, cell: Cell) -> Cell | None:
    """Return the marked cell of (rows, cols) nearest to `cell`, which may lie outside; None without
    one. Of cells equally near the first in reading order is taken."""
    within = 16
    while True:
        top, left = max(cell[0] - within, 0), max(cell[1] - within, 0)
        part = mask[top : max(cell[0] + within + 1, 0), left : max(cell[1] + within + 1, 0)]
        is_all = part.shape == mask.shape
        cells = np.argwhere(part) + np.array([top, left])
        found = nearest_of(cells, cell, math.inf if is_all else within)
        if found is not None or is_all:
            return found
        within *= 2


def cells_around(mask: CellMask, cell: Cell, within: int) -> Indices:
    """Return the (N, 2) cells of a set in the square of that many cells around `cell`, in reading
    order."""
    top, left = max(cell[0] - within, 0), max(cell[1] - within, 0)
    bottom, right = min(cell[0] + within + 1, mask.rows), min(cell[1] + within + 1, mask.cols)
    return np.asarray(np.argwhere(mask.window(top, left, bottom, right)) + np.array([top, left]))


def nearest_free(free: CellMask, cell: Cell, within: float) -> Cell | None:
    """Return the free cell nearest to `cell`, or None when all within that many cells are blocked.

    A cell that is free or lies outside the grid is returned itself.
    """
    if not (0 <= cell[0] < free.rows and 0 <= cell[1] < free.cols):
        return cell
    return nearest_of(cells_around(free, cell, math.floor(within)), cell, within)


def nearest_reachable(blocked: BoolGrid, start: Cell, goal: Cell) -> Cell | None:
    """Return the cell nearest to the goal to which there is a path from start, or None if the start
    is blocked or outside the grid.

    `blocked` is bool (rows, cols); `start` and `goal` are (row, col), and the goal may be blocked
    or lie outside. Of cells equally near the first in reading order is taken.
    """
    rows, cols = blocked.shape
    if not (0 <= start[0] < rows and 0 <= start[1] < cols) or blocked[start]:
        return None
    # A diagonal step needs both orthogonal neighbours free, so what can be reached at all can be
    # reached by straight steps.
    _, regions = cv2.connectedComponents((~blocked).view(np.uint8), connectivity=4)
    return nearest_marked(regions == regions[start], goal)
