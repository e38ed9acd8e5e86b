"""Beware zones: polygons an operator draws on the map; as hard as walls for every stage downstream."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Polygon
from shapely.validation import explain_validity

from navcore.errors import BadGeometry
from navcore.grid import GridSpec

MIN_AREA_M2 = 1e-3
MAX_CORNERS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone:
    """An area of the map frame that no part of the robot may enter."""

    id: str
    """Unique, made by the store."""
    name: str
    """What the operator calls it."""
    polygon: tuple[tuple[float, float], ...]
    """Corners (x, y) in metres of the map frame, in order, the first not repeated."""
    enabled: bool = True
    """A zone that is switched off stays stored and binds nobody."""
    margin_m: float = 0.0
    """Room kept around it beyond the robot's own margin."""
    version: int = 1
    """Grows with every edit; the ETag of HTTP."""


def check_polygon(corners: Sequence[Sequence[float]], spec: GridSpec) -> tuple[tuple[float, float], ...]:
    """The corners as a simple polygon on the map, closing corner dropped; raises `BadGeometry` with the reason."""
    if len(corners) > MAX_CORNERS:
        raise BadGeometry(f"zone has {len(corners)} corners, at most {MAX_CORNERS} are allowed")
    if any(len(corner) != 2 for corner in corners):
        raise BadGeometry("zone corners must be (x, y) pairs in metres")
    points = [(float(x), float(y)) for x, y in corners]
    if not np.isfinite(np.array(points)).all():
        raise BadGeometry("zone has a corner that is not finite; give metres of the map frame")
    if len(points) > 1 and points[0] == points[-1]:
        points.pop()
    if len(set(points)) < 3:
        raise BadGeometry(f"zone has {len(set(points))} distinct corners, a polygon needs at least 3")
    polygon = Polygon(points)
    if not polygon.is_valid:
        raise BadGeometry(f"zone outline is not simple: {explain_validity(polygon)}; draw it without crossing itself")
    if polygon.area < MIN_AREA_M2:
        raise BadGeometry(f"zone covers {polygon.area:g} m², at least {MIN_AREA_M2:g} m² are needed")
    for x_m, y_m in points:
        if not spec.contains(x_m, y_m):
            raise BadGeometry(f"zone corner ({x_m:g}, {y_m:g}) lies outside the map, {spec.extent()}")
    return tuple(points)


def rasterise(polygon: Sequence[Sequence[float]], spec: GridSpec) -> npt.NDArray[np.bool_]:
    """(rows, cols) read-only, True for every cell the polygon touches, so that no sliver of a zone is lost to rounding."""
    return _rasterised(tuple((float(x), float(y)) for x, y in polygon), spec)


@lru_cache(maxsize=64)
def _rasterised(polygon: tuple[tuple[float, float], ...], spec: GridSpec) -> npt.NDArray[np.bool_]:
    # fillPoly works on pixel centres with `shift` fractional bits: world metres → cells, where a centre is an integer.
    shift = 8
    corners = np.asarray(polygon, dtype=np.float64)
    pixels = (corners - np.array([spec.origin_x_m, spec.origin_y_m])) / spec.resolution_m
    fixed = np.round((pixels - 0.5) * (1 << shift)).astype(np.int32)
    mask = np.zeros((spec.rows, spec.cols), dtype=np.uint8)
    cv2.fillPoly(mask, [fixed], 1, shift=shift)
    cv2.polylines(mask, [fixed], True, 1, shift=shift)
    # Drawn lines are 8-connected and skip cells that the polygon only clips: those are asked one by one.
    rim = np.argwhere((cv2.dilate(mask, np.ones((3, 3), dtype=np.uint8)) > 0) & (mask == 0))
    low = rim[:, ::-1] * spec.resolution_m + np.array([spec.origin_x_m, spec.origin_y_m])
    squares = shapely.box(low[:, 0], low[:, 1], low[:, 0] + spec.resolution_m, low[:, 1] + spec.resolution_m)
    clipped = rim[shapely.intersects(Polygon(corners), squares)]
    mask[clipped[:, 0], clipped[:, 1]] = 1
    cells = mask > 0
    cells.flags.writeable = False
    return cells
