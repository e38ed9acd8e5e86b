"""Clear floor: where a map has seen that nothing stands. What is measured there contradicts a place
in this map, however well the rest fits: the surfaces of rooms are alike, their contents are not."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import cKDTree

from navcore.compiled import compiled
from navcore.config.localisation.relocalisation import PlaceSearchConfig
from navcore.geometry.arrays import Bools, Indices, Points

LENS_MARGIN_M = 0.1
"""Length in metres of a line of sight beside the camera that is not counted."""


def clear_floor(
    origins: Points,
    ends: Points,
    tree: cKDTree,
    corner: tuple[float, float],
    shape: tuple[int, int],
    config: PlaceSearchConfig,
) -> Bools:
    """Return the cells, of a shape (rows, cols), that `config.seen_lines` lines of sight cross and
    that have no surface within `config.clear_m`.

    The lines go from (N, 2) origins to (N, 2) ends in metres of the map, `tree` holds its surfaces,
    and `corner` is (x, y) of the corner of cell (0, 0).
    """
    lines = np.zeros(shape, dtype=np.int64)
    _count(lines, corner, config.cell_m, origins, ends, config.clear_m)
    clear = lines >= config.seen_lines
    rows, cols = np.nonzero(clear)
    middles = np.array(corner) + config.cell_m * (np.column_stack([cols, rows]) + 0.5)
    away, _ = tree.query(middles, distance_upper_bound=config.clear_m)
    clear[rows, cols] = ~np.isfinite(away)
    return clear


@compiled
def _count(
    lines: Indices,
    corner: tuple[float, float],
    cell_m: float,
    origins: Points,
    ends: Points,
    end_m: float,
) -> None:
    """Count in each cell the lines of sight that cross it, but for their last `end_m`."""
    rows, cols = lines.shape
    step = 0.5 * cell_m
    for i in range(len(ends)):
        dx, dy = ends[i, 0] - origins[i, 0], ends[i, 1] - origins[i, 1]
        length = math.hypot(dx, dy)
        last_row, last_col = -1, -1
        for k in range(math.ceil((length - LENS_MARGIN_M - end_m) / step)):
            along = (LENS_MARGIN_M + k * step) / length
            row = int((origins[i, 1] + along * dy - corner[1]) / cell_m)
            col = int((origins[i, 0] + along * dx - corner[0]) / cell_m)
            if (row != last_row or col != last_col) and 0 <= row < rows and 0 <= col < cols:
                lines[row, col] += 1
            last_row, last_col = row, col
