"""Textbook A*, compiled: a peer of the planner in the benchmark, and the reference for path
lengths."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.grid.grid import BoolGrid, Cell


def length_by_astar(blocked: BoolGrid, start: Cell, goal: Cell) -> float:
    """Return the exact path length in cells by A* over eight neighbours with a binary heap."""
    return float(_astar(blocked.view(np.uint8), start[0], start[1], goal[0], goal[1]))


_MOVE_ROW = np.array([0, 0, 1, -1, 1, 1, -1, -1], dtype=np.int64)
_MOVE_COL = np.array([1, -1, 0, 0, 1, -1, 1, -1], dtype=np.int64)


@compiled
def _octile(rows: int, cols: int) -> float:
    """Return the path length on an empty grid: consistent, so no cell is expanded twice."""
    low, high = min(rows, cols), max(rows, cols)
    return (high - low) + low * 1.4142135623730951


@compiled
def _astar(
    blocked: npt.NDArray[np.uint8], start_row: int, start_col: int, goal_row: int, goal_col: int
) -> float:
    rows, cols = blocked.shape
    length = np.full(rows * cols, np.inf)
    closed = np.zeros(rows * cols, dtype=np.uint8)
    keys, nodes = np.empty(1024, dtype=np.float64), np.empty(1024, dtype=np.int64)
    start, goal = start_row * cols + start_col, goal_row * cols + goal_col
    length[start] = 0.0
    keys[0], nodes[0], size = (
        _octile(abs(start_row - goal_row), abs(start_col - goal_col)),
        start,
        1,
    )
    while size > 0:
        node = nodes[0]
        size = _pop(keys, nodes, size)
        if closed[node]:
            continue
        if node == goal:
            return float(length[goal])
        closed[node] = 1
        row, col = node // cols, node % cols
        for move in range(8):
            r, c = row + _MOVE_ROW[move], col + _MOVE_COL[move]
            if r < 0 or r >= rows or c < 0 or c >= cols or blocked[r, c]:
                continue
            if move >= 4 and (blocked[row, c] or blocked[r, col]):
                continue
            other = r * cols + c
            cost = length[node] + (1.0 if move < 4 else 1.4142135623730951)
            if closed[other] or cost >= length[other]:
                continue
            length[other] = cost
            if size == len(keys):
                keys = np.concatenate((keys, np.empty_like(keys)))
                nodes = np.concatenate((nodes, np.empty_like(nodes)))
            size = _push(
                keys, nodes, size, cost + _octile(abs(r - goal_row), abs(c - goal_col)), other
            )
    return float(np.inf)


@compiled
def _push(
    keys: npt.NDArray[np.float64], nodes: npt.NDArray[np.int64], size: int, key: float, node: int
) -> int:
    at = size
    while at > 0:
        parent = (at - 1) >> 1
        if keys[parent] <= key:
            break
        keys[at], nodes[at] = keys[parent], nodes[parent]
        at = parent
    keys[at], nodes[at] = key, node
    return size + 1


@compiled
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
