"""The true static map as a grid, for places that can be reached."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from navcore.grid.grid import BoolGrid, GridSpec
from sim.models.solids import Polygon

FINE = 16
"""Corners are rasterised to so many parts of a cell, as a power of two for OpenCV's fixed point."""
SHIFT = 4


def rasterise(polygons: Sequence[Polygon], spec: GridSpec) -> BoolGrid:
    """(rows, cols) True in every cell that a polygon (metres of the map frame) touches, edges
    included."""
    grid = np.zeros((spec.rows, spec.cols), dtype=np.uint8)
    for polygon in polygons:
        # Pixel centres are at whole numbers in OpenCV, hence the half cell.
        cells = (polygon - (spec.origin_x_m, spec.origin_y_m)) / spec.resolution_m - 0.5
        corners = np.round(cells * FINE).astype(np.int32)
        cv2.fillPoly(grid, [corners], (1,), cv2.LINE_8, SHIFT)
        cv2.polylines(grid, [corners], True, (1,), 1, cv2.LINE_8, SHIFT)
    return grid > 0


def blocked_grid(polygons: Sequence[Polygon], spec: GridSpec, inflation_m: float) -> BoolGrid:
    """(rows, cols) True where the robot's centre would be nearer than `inflation_m` to a polygon."""
    radius = math.ceil(inflation_m / spec.resolution_m)
    rows, cols = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    disc = (rows**2 + cols**2 <= radius**2).astype(np.uint8)
    return (
        np.asarray(cv2.dilate(rasterise(polygons, spec).astype(np.uint8), disc), dtype=np.uint8) > 0
    )
