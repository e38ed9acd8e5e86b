"""Where one can get to instead of a goal that one cannot get to: only on request, for a goal is never moved in silence."""

from __future__ import annotations

import cv2
import numpy as np

from navcore.grid.grid import BoolGrid, Cell


def nearest_reachable(blocked: BoolGrid, start: Cell, goal: Cell) -> Cell | None:
    """The cell nearest to the goal, in a straight line, to which there is a path from start; the goal itself if there is one.

    `blocked` is bool (rows, cols); `start` and `goal` are (row, col), the goal may be blocked or lie outside. None if the start
    is blocked or outside. Of cells equally near the first in reading order is taken.
    """
    rows, cols = blocked.shape
    if not (0 <= start[0] < rows and 0 <= start[1] < cols) or blocked[start]:
        return None
    # A diagonal step needs both orthogonal neighbours free, so what can be reached at all can be reached by straight steps.
    _, regions = cv2.connectedComponents((~blocked).view(np.uint8), connectivity=4)
    row, col = np.nonzero(regions == regions[start])
    at = int(np.argmin((row - goal[0]) ** 2 + (col - goal[1]) ** 2))
    return int(row[at]), int(col[at])
