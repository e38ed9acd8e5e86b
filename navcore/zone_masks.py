"""Zones from a picture of cells and back: Nav2's keep-out masks.

A mask has staircases, holes and any number of parts; a zone is one simple polygon. Parts become zones of their own, a part with
a hole is cut through the hole, so that the floor within a fence stays free.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import cv2
import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon, box

from navcore.errors import BadGeometry
from navcore.grid import BoolGrid, GridSpec, inflate, inflation_radius
from navcore.zones import MAX_CORNERS, Zone, cells_of

MAX_PARTS = 200
INSET = 0.1
"""So many cells the polygon stays inside its cells: on their border it would touch, and so take, the next ones."""
Corners = tuple[tuple[float, float], ...]


def closed_cells(zones: Iterable[Zone], spec: GridSpec) -> BoolGrid:
    """(rows, cols) the keep-outs that are switched on, each grown by its own margin."""
    plain, wide = cells_of(zones, spec)
    for margin_m, mask in wide:
        radius = inflation_radius(vehicle_width_m=0.0, safety_margin_m=margin_m, resolution_m=spec.resolution_m)
        plain = plain | inflate(mask, radius)
    return plain


def polygons_of(mask: BoolGrid, spec: GridSpec) -> tuple[Corners, ...]:
    """Simple polygons that touch exactly the marked cells of (rows, cols), biggest first; raises `BadGeometry` for too many."""
    count, _ = cv2.connectedComponents(mask.view(np.uint8), connectivity=4)
    if count - 1 > MAX_PARTS:
        raise _too_many()
    whole = shapely.union_all(list(_runs(mask, spec)))
    parts: list[Polygon] = []
    for polygon in sorted(_polygons(whole), key=lambda part: -part.area):
        parts.extend(_simple(polygon))
        if len(parts) > MAX_PARTS:
            raise _too_many()
    inset_m = INSET * spec.resolution_m
    shrunk = (inner for part in parts for inner in _polygons(part.buffer(-inset_m, join_style="mitre")))
    return tuple(tuple((float(x), float(y)) for x, y in polygon.exterior.coords[:-1]) for polygon in shrunk)


def _too_many() -> BadGeometry:
    return BadGeometry(f"the mask falls into more than {MAX_PARTS} zones; is it a map instead of a keep-out mask?")


def _runs(mask: BoolGrid, spec: GridSpec) -> Iterator[Polygon]:
    """One box for each run of marked cells in a row."""
    edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, starts = np.nonzero(edges == 1)
    _, ends = np.nonzero(edges == -1)
    side, x, y = spec.resolution_m, spec.origin_x_m, spec.origin_y_m
    for row, start, end in zip(rows.tolist(), starts.tolist(), ends.tolist(), strict=True):
        yield box(x + start * side, y + row * side, x + end * side, y + (row + 1) * side)


def _simple(polygon: Polygon) -> list[Polygon]:
    """The polygon cut in two, and again, until no part has a hole or too many corners."""
    (polygon,) = _polygons(polygon.simplify(0.0))
    if not polygon.interiors and len(polygon.exterior.coords) <= MAX_CORNERS:
        return [polygon]
    left, low, right, top = polygon.bounds
    hole = polygon.interiors[0].centroid if polygon.interiors else polygon.centroid
    at_x = min(max(hole.x, left + 1e-6), right - 1e-6)
    halves = (box(left, low, at_x, top), box(at_x, low, right, top))
    return [part for half in halves for piece in _polygons(polygon.intersection(half)) for part in _simple(piece)]


def _polygons(shape: shapely.Geometry) -> Sequence[Polygon]:
    if isinstance(shape, Polygon):
        return [] if shape.is_empty else [shape]
    if isinstance(shape, MultiPolygon) or hasattr(shape, "geoms"):
        return [part for part in shape.geoms if isinstance(part, Polygon) and not part.is_empty]
    return []
