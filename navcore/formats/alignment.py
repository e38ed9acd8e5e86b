"""Alignment of a map from elsewhere with the frame of a site, by two points known in both."""

from __future__ import annotations

import itertools
import math

import numpy as np

from navcore.errors import BadGeometry
from navcore.formats.map_image import MAX_PIXELS, MAX_SIDE
from navcore.formats.nav2_map import Nav2Map, State, map_from_cells
from navcore.geometry.arrays import Bools, Indices, Points
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.grid.grid import GridSpec

Point = tuple[float, float]
"""(x, y) in metres."""
MIN_DISTANCE_M = 1.0
"""Least distance of the two points in metres: nearer ones leave the heading open."""
MAX_SCALE_ERROR = 0.05
"""Largest relative difference of the distances of the points in both frames."""
_SUBSAMPLES = 3
"""Number of samples per pixel and side, so that thin walls stay closed when they are turned."""
_ROWS = 256
"""Number of rows that are worked on at a time, which bounds the memory."""


def align(map_points: tuple[Point, Point], site_points: tuple[Point, Point]) -> Pose2:
    """Return T_site_map of a map of which two points are known in the frame of the site.

    The heading is that of the line between the points, the position that of its middle, so that an
    error is shared by both. Raises `BadGeometry` for points that are too near to each other, and
    for distances that differ by more than `MAX_SCALE_ERROR`: then a point is wrong, or the map's
    resolution.
    """
    (a, b), (c, d) = np.array(map_points, dtype=np.float64), np.array(site_points, dtype=np.float64)
    if not np.isfinite([a, b, c, d]).all():
        raise BadGeometry("a point of the alignment is not finite; give metres")
    on_map_m, on_site_m = math.dist(a, b), math.dist(c, d)
    if min(on_map_m, on_site_m) < MIN_DISTANCE_M:
        raise BadGeometry(
            f"the two points are {min(on_map_m, on_site_m):.2f} m apart; choose two that are at "
            f"least {MIN_DISTANCE_M:g} m apart, the farther the better"
        )
    scale = on_site_m / on_map_m
    if abs(scale - 1) > MAX_SCALE_ERROR:
        raise BadGeometry(
            f"the two points are {on_map_m:.2f} m apart on the map and {on_site_m:.2f} m at the "
            f"site, {100 * (scale - 1):+.0f} %; choose the points again, or correct the "
            "resolution in the YAML file"
        )
    yaw_rad = wrap_angle(
        math.atan2(d[1] - c[1], d[0] - c[0]) - math.atan2(b[1] - a[1], b[0] - a[0])
    )
    turned = Pose2(x_m=0.0, y_m=0.0, yaw_rad=yaw_rad).to_parent((a + b) / 2)
    x_m, y_m = ((c + d) / 2 - turned).tolist()
    return Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


def placed(nav2_map: Nav2Map, T_site_map: Pose2) -> Nav2Map:
    """Return a map in the frame of the site, in cells of the same size.

    An occupied pixel occupies every cell that it covers visibly, so that no wall opens; a cell is
    free or unknown as the pixel at its centre. Raises `BadGeometry` for a map that would be too
    large.
    """
    source, states = nav2_map.spec, nav2_map.states()
    spec = _spec_around(source, T_site_map)
    known = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    for top in range(0, spec.rows, _ROWS):
        part = known[top : top + _ROWS]
        at = T_site_map.from_parent(
            spec.centres(np.argwhere(np.ones_like(part)) + np.array([top, 0]))
        )
        rows, cols, inside = _cells(source, at)
        part.reshape(-1)[inside] = states[rows[inside], cols[inside]] != State.UNKNOWN
    occupied = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    steps = (np.arange(_SUBSAMPLES) - (_SUBSAMPLES - 1) / 2) / _SUBSAMPLES * source.resolution_m
    for top in range(0, source.rows, _ROWS):
        pixels = np.argwhere(states[top : top + _ROWS] == State.OCCUPIED) + np.array([top, 0])
        for dx_m, dy_m in itertools.product(steps, steps):
            moved = T_site_map.to_parent(source.centres(pixels) + np.array([dx_m, dy_m]))
            rows, cols, inside = _cells(spec, moved)
            occupied[rows[inside], cols[inside]] = True
    return map_from_cells(occupied=occupied, known=known, spec=spec)


def _spec_around(source: GridSpec, T_site_map: Pose2) -> GridSpec:
    """Return the grid around a map in the frame of the site."""
    width, height = source.cols * source.resolution_m, source.rows * source.resolution_m
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    moved = T_site_map.to_parent(corners + np.array([source.origin_x_m, source.origin_y_m]))
    low, high = moved.min(axis=0), moved.max(axis=0)
    # Rounded up by less than a thousandth of a cell, so that a map that is not turned keeps its
    # size.
    cols, rows = np.ceil((high - low) / source.resolution_m - 1e-3).astype(int).tolist()
    if max(rows, cols) > MAX_SIDE or rows * cols > MAX_PIXELS:
        raise BadGeometry(f"the map would have {rows} × {cols} cells at the site; it is too large")
    return GridSpec(
        resolution_m=source.resolution_m,
        rows=rows,
        cols=cols,
        origin_x_m=float(low[0]),
        origin_y_m=float(low[1]),
    )


def _cells(
    spec: GridSpec, points: Points
) -> tuple[
    Indices,
    Indices,
    Bools,
]:
    """Return rows and columns of (N, 2) points, and which of them are on the grid."""
    rows = np.floor((points[:, 1] - spec.origin_y_m) / spec.resolution_m).astype(np.int64)
    cols = np.floor((points[:, 0] - spec.origin_x_m) / spec.resolution_m).astype(np.int64)
    inside = (rows >= 0) & (rows < spec.rows) & (cols >= 0) & (cols < spec.cols)
    return rows, cols, inside
