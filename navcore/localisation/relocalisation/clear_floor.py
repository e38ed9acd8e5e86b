"""Clear floor: where a map has seen that nothing stands. What is measured there contradicts a place
in this map, however well the rest fits: the surfaces of rooms are alike, their contents are not."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from navcore.compiled import compiled
from navcore.config.localisation.relocalisation import PlaceSearchConfig
from navcore.geometry.arrays import Bools, Floats, Points
from navcore.localisation.relocalisation.search_tables import Lattice

LENS_MARGIN_M = 0.1
"""Length in metres of a line of sight beside the camera that is not counted."""
BAND = 256
"""Number of rows of cells whose nearest surfaces are looked for at once."""


def clear_floor(
    lines: npt.NDArray[np.uint16], lattice: Lattice, tree: cKDTree, config: PlaceSearchConfig
) -> Bools:
    """Return the cells that `config.seen_lines` of (rows, cols) lines of sight cross and that have
    no surface within `config.clear_m`; `tree` holds the surfaces in metres of the map."""
    clear: Bools = lines >= config.seen_lines
    corner = np.array(lattice[:2])
    for first in range(0, len(clear), BAND):
        rows, cols = np.nonzero(clear[first : first + BAND])
        rows += first
        middles = corner + config.cell_m * (np.column_stack([cols, rows]) + 0.5)
        away, _ = tree.query(middles, distance_upper_bound=config.clear_m)
        clear[rows, cols] = ~np.isfinite(away)
    return clear


@compiled
def count_lines(
    lines: npt.NDArray[np.uint16],
    lattice: Lattice,
    origin: Floats,
    ends: Points,
    end_m: float,
    most: int,
) -> None:
    """Count in each cell the lines of sight from (x, y) to (N, 2) ends in metres of the map that
    cross it, but for their last `end_m`; up to `most`."""
    rows, cols = lines.shape
    step = 0.5 * lattice.cell_m
    for i in range(len(ends)):
        dx, dy = ends[i, 0] - origin[0], ends[i, 1] - origin[1]
        length = math.hypot(dx, dy)
        last_row, last_col = -1, -1
        for k in range(math.ceil((length - LENS_MARGIN_M - end_m) / step)):
            along = (LENS_MARGIN_M + k * step) / length
            row = int((origin[1] + along * dy - lattice.y_m) / lattice.cell_m)
            col = int((origin[0] + along * dx - lattice.x_m) / lattice.cell_m)
            if (row != last_row or col != last_col) and 0 <= row < rows and 0 <= col < cols:
                lines[row, col] = min(lines[row, col] + 1, most)
            last_row, last_col = row, col
