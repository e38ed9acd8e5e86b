"""The parts of a path that lead over floor that was not seen yet.

Unknown cells count as free, so a path may lead through what no image has shown. A gap of single
cells between two rows of pixels is no such part.
"""

from __future__ import annotations

import numpy as np

from navcore.geometry.arrays import Points
from navcore.geometry.polyline import metres_along
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec

Parts = tuple[tuple[int, int], ...]
"""(first, last) indices of points of a path."""
MIN_CELLS = 3
"""Smallest number of consecutive unseen points that are a part."""


def unseen_parts(points: Points, seen: CellMask, spec: GridSpec) -> Parts:
    """Return the first and last point of each part of a path, (N, 2) points in metres of the map
    frame, one per cell, that leads over cells that were not seen or lie beyond the map."""
    cells = np.array([spec.cell(*point) for point in points.tolist()]).reshape(-1, 2)
    if len(cells) == 0:
        return ()
    low = np.clip(cells.min(axis=0), 0, [spec.rows - 1, spec.cols - 1])
    high = np.clip(cells.max(axis=0) + 1, low + 1, [spec.rows, spec.cols])
    known = seen.window(*low.tolist(), *high.tolist())
    inside = np.clip(cells - low, 0, high - low - 1)
    on_map = (inside == cells - low).all(axis=1)
    hidden = ~(known[inside[:, 0], inside[:, 1]] & on_map)
    hidden = np.concatenate([[False], hidden, [False]])
    edges = np.flatnonzero(np.diff(hidden.astype(np.int8)))
    return tuple(
        (int(first), int(end) - 1)
        for first, end in zip(edges[::2], edges[1::2], strict=True)
        if end - first >= MIN_CELLS
    )


def unseen_m(points: Points, parts: Parts) -> float:
    """Return the length of these parts of a path in metres, with the steps that lead into them."""
    if not parts:
        return 0.0
    metres = metres_along(points)
    return float(sum(metres[last] - metres[max(first - 1, 0)] for first, last in parts))
