"""The shortest way out of an area that the robot must not be in, for one that stands in it already."""

from __future__ import annotations

import heapq

import numpy as np
import numpy.typing as npt

from navcore.grid import BoolGrid, Cell
from navcore.path import SQRT2, NoPath, Path, Reason
from navcore.search.bits import compiled

Ints = npt.NDArray[np.int64]


def way_out(*, closed: BoolGrid, inside: BoolGrid, start: Cell) -> Path | NoPath:
    """The shortest 8-connected path from start to the nearest cell that is neither closed nor inside.

    `closed`: bool (rows, cols), True where the robot's centre may not even pass; `inside`: True where it may pass but not
    stay. Corners are not cut. Exactly optimal (Dijkstra): there are many goals, and they are near.
    """
    rows, cols = closed.shape
    if not (0 <= start[0] < rows and 0 <= start[1] < cols):
        return NoPath(reason=Reason.OUTSIDE)
    if closed[start]:
        return NoPath(reason=Reason.START_BLOCKED)
    cells, diagonal = _search(np.ascontiguousarray(closed), np.ascontiguousarray(inside), start[0], start[1])
    if len(cells) == 0:
        return NoPath(reason=Reason.UNREACHABLE)
    return Path(cells=cells, length=len(cells) - 1 - diagonal + diagonal * SQRT2)


@compiled
def _search(closed: BoolGrid, inside: BoolGrid, start_row: int, start_col: int) -> tuple[Ints, int]:
    rows, cols = closed.shape
    came_from = np.full(rows * cols, -1, dtype=np.int64)
    best = np.full(rows * cols, np.inf)
    done = np.zeros(rows * cols, dtype=np.bool_)
    start = start_row * cols + start_col
    best[start] = 0.0
    heap = [(0.0, start)]
    while len(heap) > 0:
        cost, node = heapq.heappop(heap)
        if done[node]:
            continue
        done[node] = True
        row, col = node // cols, node % cols
        if not inside[row, col]:
            return _trace(came_from, node, cols)
        for down in range(-1, 2):
            for right in range(-1, 2):
                r, c = row + down, col + right
                if r < 0 or r >= rows or c < 0 or c >= cols or closed[r, c] or closed[row, c] or closed[r, col]:
                    continue
                there = cost + (SQRT2 if down != 0 and right != 0 else 1.0)
                if there < best[r * cols + c]:
                    best[r * cols + c], came_from[r * cols + c] = there, node
                    heapq.heappush(heap, (there, r * cols + c))
    return np.empty((0, 2), dtype=np.int64), 0


@compiled
def _trace(came_from: Ints, node: int, cols: int) -> tuple[Ints, int]:
    count, at = 1, node
    while came_from[at] >= 0:
        at = came_from[at]
        count += 1
    cells, diagonal = np.empty((count, 2), dtype=np.int64), 0
    for index in range(count - 1, -1, -1):
        cells[index, 0], cells[index, 1] = node // cols, node % cols
        if index < count - 1:
            diagonal += cells[index, 0] != cells[index + 1, 0] and cells[index, 1] != cells[index + 1, 1]
        node = came_from[node]
    return cells, diagonal
