"""The shortest path on the grid: A* over the eight neighbours, in full, from scratch (the paper's Algorithm 1).

Lengths are octile: a straight step costs 1, a diagonal one √2, and a diagonal step needs both orthogonal neighbours free, so
that the robot never cuts a corner. Costs are kept as the pair (straight steps, diagonal steps); the float that orders the queue
is computed from the pair afresh, so rounding does not pile up along a path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numba
import numpy as np
import numpy.typing as npt

from navcore.grid import BoolGrid, Cell

SQRT2 = math.sqrt(2.0)


class Reason(StrEnum):
    """Why there is no path."""

    START_BLOCKED = "start blocked"
    """The robot's own cell is blocked."""
    GOAL_BLOCKED = "goal blocked"
    """The goal's cell lies in an obstacle or a zone, or closer to one than the robot's body allows."""
    OUTSIDE = "outside the map"
    """Start or goal is no cell of the grid."""
    UNREACHABLE = "unreachable"
    """Every way to the goal is closed."""
    TIMEOUT = "time budget exceeded"
    """The search was given up."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Path:
    """A shortest path."""

    cells: npt.NDArray[np.int64]
    """(N, 2) every cell (row, col) from start to goal."""
    length: float
    """In cells: straight steps + √2 · diagonal steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoPath:
    """There is no path, and why."""

    reason: Reason
    """What stands in the way."""


def plan(blocked: BoolGrid, start: Cell, goal: Cell, *, max_expansions: int | None = None) -> Path | NoPath:
    """The shortest 8-connected path from start to goal without cutting corners.

    `blocked` is bool (rows, cols), True where the robot's centre may not be; `start` and `goal` are (row, col). The result is
    exactly optimal and deterministic. `max_expansions` bounds the search (`Reason.TIMEOUT`) by work, not by a clock.
    """
    rows, cols = blocked.shape
    for row, col in (start, goal):
        if not (0 <= row < rows and 0 <= col < cols):
            return NoPath(reason=Reason.OUTSIDE)
    if blocked[start]:
        return NoPath(reason=Reason.START_BLOCKED)
    if blocked[goal]:
        return NoPath(reason=Reason.GOAL_BLOCKED)
    budget = max_expansions if max_expansions is not None else rows * cols + 1
    cells, straight, diagonal = _search(
        np.ascontiguousarray(blocked).view(np.uint8), start[0], start[1], goal[0], goal[1], budget
    )
    if straight < 0:
        return NoPath(reason=Reason.UNREACHABLE if straight == _UNREACHABLE else Reason.TIMEOUT)
    return Path(cells=cells, length=straight + diagonal * SQRT2)


_UNREACHABLE, _TIMEOUT = -1, -2
_MOVE_ROW = np.array([0, 0, 1, -1, 1, 1, -1, -1], dtype=np.int64)
_MOVE_COL = np.array([1, -1, 0, 0, 1, -1, 1, -1], dtype=np.int64)


@numba.njit(cache=True, nogil=True)
def _octile(rows: int, cols: int) -> float:
    """Length of the shortest path between two cells on an empty grid; consistent, so no cell is expanded twice."""
    low, high = min(rows, cols), max(rows, cols)
    return (high - low) + low * 1.4142135623730951


@numba.njit(cache=True, nogil=True)
def _search(
    blocked: npt.NDArray[np.uint8], start_row: int, start_col: int, goal_row: int, goal_col: int, budget: int
) -> tuple[npt.NDArray[np.int64], int, int]:
    rows, cols = blocked.shape
    straight = np.full(rows * cols, -1, dtype=np.int32)
    diagonal = np.zeros(rows * cols, dtype=np.int32)
    came_by = np.full(rows * cols, -1, dtype=np.int8)
    closed = np.zeros(rows * cols, dtype=np.uint8)
    keys = np.empty(1024, dtype=np.float64)
    nodes = np.empty(1024, dtype=np.int64)
    start, goal = start_row * cols + start_col, goal_row * cols + goal_col
    straight[start] = 0
    keys[0], nodes[0], size = _octile(abs(start_row - goal_row), abs(start_col - goal_col)), start, 1
    while size > 0:
        node = nodes[0]
        size = _pop(keys, nodes, size)
        if closed[node]:
            continue
        if node == goal:
            return _trace(came_by, start, goal, cols), straight[goal], diagonal[goal]
        closed[node] = 1
        budget -= 1
        if budget < 0:
            return np.empty((0, 2), dtype=np.int64), _TIMEOUT, 0
        row, col = node // cols, node % cols
        for move in range(8):
            r, c = row + _MOVE_ROW[move], col + _MOVE_COL[move]
            if r < 0 or r >= rows or c < 0 or c >= cols or blocked[r, c]:
                continue
            if move >= 4 and (blocked[row, c] or blocked[r, col]):
                continue
            other = r * cols + c
            if closed[other]:
                continue
            s = straight[node] + (1 if move < 4 else 0)
            d = diagonal[node] + (0 if move < 4 else 1)
            cost = s + d * 1.4142135623730951
            if straight[other] >= 0 and cost >= straight[other] + diagonal[other] * 1.4142135623730951:
                continue
            straight[other], diagonal[other], came_by[other] = s, d, move
            if size == len(keys):
                keys = np.concatenate((keys, np.empty_like(keys)))
                nodes = np.concatenate((nodes, np.empty_like(nodes)))
            size = _push(keys, nodes, size, cost + _octile(abs(r - goal_row), abs(c - goal_col)), other)
    return np.empty((0, 2), dtype=np.int64), _UNREACHABLE, 0


@numba.njit(cache=True, nogil=True)
def _push(keys: npt.NDArray[np.float64], nodes: npt.NDArray[np.int64], size: int, key: float, node: int) -> int:
    at = size
    while at > 0:
        parent = (at - 1) >> 1
        if keys[parent] <= key:
            break
        keys[at], nodes[at] = keys[parent], nodes[parent]
        at = parent
    keys[at], nodes[at] = key, node
    return size + 1


@numba.njit(cache=True, nogil=True)
def _pop(keys: npt.NDArray[np.float64], nodes: npt.NDArray[np.int64], size: int) -> int:
    size -= 1
    key, node, at = keys[size], nodes[size], 0
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[at], nodes[at] = keys[child], nodes[child]
        at = child
    keys[at], nodes[at] = key, node
    return size


@numba.njit(cache=True, nogil=True)
def _trace(came_by: npt.NDArray[np.int8], start: int, goal: int, cols: int) -> npt.NDArray[np.int64]:
    count, node = 1, goal
    while node != start:
        node -= _MOVE_ROW[came_by[node]] * cols + _MOVE_COL[came_by[node]]
        count += 1
    cells = np.empty((count, 2), dtype=np.int64)
    node = goal
    for i in range(count - 1, -1, -1):
        cells[i, 0], cells[i, 1] = node // cols, node % cols
        if i > 0:
            node -= _MOVE_ROW[came_by[node]] * cols + _MOVE_COL[came_by[node]]
    return cells
