"""Zones: areas that the operator draws on the map.

A keep-out zone counts as a wall in every later stage; in a speed-limit zone the robot drives slowly
(`control/speed_limits.py`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Polygon
from shapely.validation import explain_validity

from navcore.errors import BadGeometry
from navcore.grid.bitplane import MOST_CELLS
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mission.zone_shapes import Shape

MIN_AREA_M2 = 1e-3
"""Smallest area of a zone in square metres."""
MAX_CORNERS = 1000
"""Largest number of corners of a zone."""
MAX_ZONE_MARGIN_M = 2.0
"""Largest margin of a zone in metres."""
MIN_LIMIT_MPS, MAX_LIMIT_MPS = 0.05, 5.0
"""Range of speed limits in metres per second."""
COLOUR = re.compile(r"#[0-9a-f]{6}")
OWN_COLOUR = "#8a929e"
"""Colour of the zones that the robot closes for itself for a while."""


class ZoneKind(StrEnum):
    """Rule that holds in a zone."""

    KEEP_OUT = "keep-out"
    """No part of the robot may be in the zone."""
    SPEED_LIMIT = "speed-limit"
    """The robot drives no faster than the limit while any part of it is in the zone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneSpec:
    """Area of the map frame and the rule that holds in it."""

    name: str
    """Name that the operator gave it."""
    polygon: tuple[tuple[float, float], ...]
    """Corners (x, y) in metres of the map frame, in order, the first not repeated."""
    enabled: bool = True
    """Whether the rule holds; a disabled zone stays stored."""
    margin_m: float = 0.0
    """Clearance in metres beyond the robot's own margin."""
    kind: ZoneKind = ZoneKind.KEEP_OUT
    """Rule that holds in the zone."""
    max_speed_mps: float | None = None
    """Speed limit in metres per second; None for a keep-out zone."""
    colour: str | None = None
    """Colour `#rrggbb` in the console; None for the default."""
    expires_at_s: float | None = None
    """Time at which the zone is disabled, in seconds since 1970 (UTC) of the robot's calendar
    clock; None for never."""
    drawn: Shape | None = None
    """Shape that the polygon was made from; None for a zone drawn corner by corner."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone(ZoneSpec):
    """Stored area of the map frame in which a rule of the operator holds."""

    id: str
    """Unique id, made by the store."""
    version: int = 1
    """Version that grows with every edit; the ETag of HTTP."""

    @classmethod
    def of(cls, spec: ZoneSpec, *, zone_id: str, version: int) -> Zone:
        """Return the zone with an id, a version, and the area and rule of `spec`."""
        shared = {field.name: getattr(spec, field.name) for field in fields(ZoneSpec)}
        return cls(id=zone_id, version=version, **shared)

    @property
    def closed(self) -> bool:
        """Whether the robot must stay out of the zone now."""
        return self.enabled and self.kind is ZoneKind.KEEP_OUT


def check_rules(zone: Zone) -> None:
    """Raise `BadGeometry` for the first value of a zone, except its polygon, that is out of
    range."""
    if not 0 <= zone.margin_m <= MAX_ZONE_MARGIN_M:
        raise BadGeometry(
            f"zone margin {zone.margin_m:g} m is out of range, allowed 0 to {MAX_ZONE_MARGIN_M:g} m"
        )
    if zone.colour is not None and COLOUR.fullmatch(zone.colour) is None:
        raise BadGeometry("zone colour must be #rrggbb in small hexadecimal digits")
    if (zone.kind is ZoneKind.SPEED_LIMIT) != (zone.max_speed_mps is not None):
        raise BadGeometry("a speed limit needs max_speed_mps, a keep-out has none")
    if zone.max_speed_mps is not None and not MIN_LIMIT_MPS <= zone.max_speed_mps <= MAX_LIMIT_MPS:
        raise BadGeometry(
            f"max_speed_mps {zone.max_speed_mps:g} is out of range, allowed {MIN_LIMIT_MPS:g} to "
            f"{MAX_LIMIT_MPS:g} m/s"
        )


def zone_masks(
    zones: Iterable[Zone], spec: GridSpec
) -> tuple[BoolGrid, tuple[tuple[float, BoolGrid], ...]]:
    """Return the cells of the enabled keep-out zones: (rows, cols) of those without a margin, and
    (margin in metres, (rows, cols)) for each margin of the others."""
    plain, wide = np.zeros((spec.rows, spec.cols), dtype=np.bool_), dict[float, BoolGrid]()
    for zone in zones:
        if not zone.closed:
            continue
        mask = rasterise(zone.polygon, spec)
        if zone.margin_m == 0:
            plain |= mask
        else:
            wide[zone.margin_m] = wide[zone.margin_m] | mask if zone.margin_m in wide else mask
    return plain, tuple(wide.items())


def check_polygon(
    corners: Sequence[Sequence[float]], spec: GridSpec
) -> tuple[tuple[float, float], ...]:
    """Return the corners as a simple polygon on the map, without the closing corner; raises
    `BadGeometry` with the reason."""
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
        raise BadGeometry(
            f"zone has {len(set(points))} distinct corners, a polygon needs at least 3"
        )
    polygon = Polygon(points)
    if not polygon.is_valid:
        raise BadGeometry(
            f"zone outline is not simple: {explain_validity(polygon)}; draw it without crossing "
            "itself"
        )
    if polygon.area < MIN_AREA_M2:
        raise BadGeometry(
            f"zone covers {polygon.area:g} m², at least {MIN_AREA_M2:g} m² are needed"
        )
    for x_m, y_m in points:
        if not spec.contains(x_m, y_m):
            raise BadGeometry(
                f"zone corner ({x_m:g}, {y_m:g}) lies outside the map, {spec.extent()}"
            )
    return tuple(points)


def rasterise(polygon: Sequence[Sequence[float]], spec: GridSpec) -> npt.NDArray[np.bool_]:
    """Return read-only (rows, cols), True for every cell that the polygon touches, so that no
    sliver of a zone is lost to rounding.

    A part of a map gets exactly the cells that the whole map gets there.
    """
    first_row, row_phase = _aligned(spec.origin_y_m, spec.resolution_m)
    first_col, col_phase = _aligned(spec.origin_x_m, spec.resolution_m)
    corners = tuple((float(x), float(y)) for x, y in polygon)
    if np.prod(np.ptp(np.asarray(corners), axis=0) / spec.resolution_m) > MOST_CELLS:
        return _cells_in(np.asarray(corners, dtype=np.float64), spec)
    row, col, cells = rasterise_box(corners, spec.resolution_m, row_phase, col_phase)
    top, left = row - first_row, col - first_col
    bottom, right = min(top + cells.shape[0], spec.rows), min(left + cells.shape[1], spec.cols)
    whole = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    if max(top, 0) < bottom and max(left, 0) < right:
        whole[max(top, 0) : bottom, max(left, 0) : right] = cells[
            max(-top, 0) : bottom - top, max(-left, 0) : right - left
        ]
    whole.flags.writeable = False
    return whole


def _aligned(origin_m: float, resolution_m: float) -> tuple[int, float]:
    """Return the number of the grid's first line of cells, counted from 0 m, and the offset of that
    count from 0 m in cells."""
    cells = origin_m / resolution_m
    first = math.floor(cells + 1e-6)
    return first, round(cells - first, 6)


@lru_cache(maxsize=64)
def rasterise_box(
    corners_m: tuple[tuple[float, float], ...],
    resolution_m: float,
    row_phase: float,
    col_phase: float,
) -> tuple[int, int, npt.NDArray[np.bool_]]:
    """Return first row, first column and cells of the polygon's bounding box; cached whole maps
    would fill the memory.

    The polygon is drawn whole, because OpenCV draws clipped polygons differently at the border.
    """
    corners = np.asarray(corners_m, dtype=np.float64)
    ends = corners / resolution_m - np.array([col_phase, row_phase])
    left, top = (np.floor(ends.min(axis=0)).astype(int) - 2).tolist()
    right, bottom = (np.ceil(ends.max(axis=0)).astype(int) + 2).tolist()
    box = GridSpec(
        resolution_m=resolution_m,
        rows=bottom - top,
        cols=right - left,
        origin_x_m=(left + col_phase) * resolution_m,
        origin_y_m=(top + row_phase) * resolution_m,
    )
    return top, left, _cells_in(corners, box)


def _cells_in(corners: npt.NDArray[np.float64], spec: GridSpec) -> npt.NDArray[np.bool_]:
    # fillPoly works on pixel centres with `shift` fractional bits: metres → cells whose centres are
    # integers.
    shift = 8
    pixels = (corners - np.array([spec.origin_x_m, spec.origin_y_m])) / spec.resolution_m
    fixed = np.round((pixels - 0.5) * (1 << shift)).astype(np.int32)
    mask = np.zeros((spec.rows, spec.cols), dtype=np.uint8)
    cv2.fillPoly(mask, [fixed], 1, shift=shift)
    cv2.polylines(mask, [fixed], True, 1, shift=shift)
    # Drawn lines are 8-connected and skip cells that the polygon only clips: each is tested.
    rim = np.argwhere((cv2.dilate(mask, np.ones((3, 3), dtype=np.uint8)) > 0) & (mask == 0))
    low = rim[:, ::-1] * spec.resolution_m + np.array([spec.origin_x_m, spec.origin_y_m])
    squares = shapely.box(
        low[:, 0], low[:, 1], low[:, 0] + spec.resolution_m, low[:, 1] + spec.resolution_m
    )
    clipped = rim[shapely.intersects(Polygon(corners), squares)]
    mask[clipped[:, 0], clipped[:, 1]] = 1
    return mask > 0
