"""The true static map as a grid."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from navcore.grid.grid import BoolGrid, GridSpec, inflate
from sim.models.solids import Polygon

SUBCELLS = 16
"""Corners are rasterised to this fraction of a cell, a power of two for the fixed point of OpenCV.
"""
SUBCELL_BITS = 4


def rasterise(polygons: Sequence[Polygon], spec: GridSpec) -> BoolGrid:
    """Return (rows, cols), True in every cell that a polygon (metres of the map frame) touches,
    edges included."""
    grid = np.zeros((spec.rows, spec.cols), dtype=np.uint8)
    for polygon in polygons:
        # Pixel centres are at whole numbers in OpenCV, hence the half cell.
        cells = (polygon - (spec.origin_x_m, spec.origin_y_m)) / spec.resolution_m - 0.5
        corners = np.round(cells * SUBCELLS).astype(np.int32)
        cv2.fillPoly(grid, [corners], (1,), cv2.LINE_8, SUBCELL_BITS)
        cv2.polylines(grid, [corners], True, (1,), 1, cv2.LINE_8, SUBCELL_BITS)
    return grid > 0


def blocked_grid(polygons: Sequence[Polygon], spec: GridSpec, inflation_m: float) -> BoolGrid:
    """Return (rows, cols), True where the centre of the robot would be nearer than `inflation_m` to
    a polygon."""
    return inflate(rasterise(polygons, spec), math.ceil(inflation_m / spec.resolution_m))
