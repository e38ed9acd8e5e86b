"""Nav2 keep-out masks: zones from a mask of cells and back.

A mask has staircases, holes and any number of parts; a zone is one simple polygon. So every part
becomes a zone, and a part with a hole is cut through the hole, so that the floor within a fence
stays free.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import cv2
import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon, box

from navcore.errors import BadGeometry
from navcore.geometry.polyline import Corners
from navcore.grid.grid import BoolGrid, GridSpec, inflate_by
from navcore.grid.growth import is_possible, reaching
from navcore.mission.zone import MAX_CORNERS, Zone, zone_masks

MAX_PARTS, MAX_HOLES = 200, 2000
"""Largest number of zones made from a mask, and of holes in a part."""
INSET = 0.1
"""Distance in cells of the polygon from the border of its cells; on the border it would touch, and
so include, the neighbouring ones."""


def mask_spec(zones: Iterable[Zone], spec: GridSpec) -> GridSpec:
    """Return a grid grown by whole tiles to all enabled keep-out zones with their margins; raises
    `BadGeometry` naming the zone for which it would become too large."""
    for zone in zones:
        if not zone.closed:
            continue
        (left, bottom, right, top), margin_m = zone.bounds, zone.margin_m
        corners = ((left - margin_m, bottom - margin_m), (right + margin_m, top + margin_m))
        spec = reaching(spec, corners)
        if not is_possible(spec):
            raise BadGeometry(
                f"zone {zone.name!r} lies so far away that the mask would cover {spec.extent()}; "
                "disable it, or export the zones as GeoJSON"
            )
    return spec


def closed_cells(zones: Iterable[Zone], spec: GridSpec) -> BoolGrid:
    """Return the (rows, cols) cells of the enabled keep-out zones, each inflated by its own
    margin."""
    plain, wide = zone_masks(zones, spec)
    for margin_m, mask in wide:
        plain = plain | inflate_by(mask, margin_m, spec.resolution_m)
    return plain


def polygons_of(mask: BoolGrid, spec: GridSpec) -> tuple[Corners, ...]:
    """Return simple polygons that touch exactly the marked cells of (rows, cols), largest first;
    raises `BadGeometry` for too many."""
    count, _ = cv2.connectedComponents(mask.view(np.uint8), connectivity=4)
    if count - 1 > MAX_PARTS:
        raise _too_many()
    whole = shapely.union_all(list(_runs(mask, spec)))
    parts: list[Polygon] = []
    for polygon in sorted(_polygons(whole), key=lambda part: -part.area):
        parts.extend(_simple(polygon, MAX_PARTS - len(parts)))
    inset_m = INSET * spec.resolution_m
    shrunk = (
        inner for part in parts for inner in _polygons(part.buffer(-inset_m, join_style="mitre"))
    )
    return tuple(
        tuple((float(x), float(y)) for x, y in polygon.exterior.coords[:-1]) for polygon in shrunk
    )


def _too_many() -> BadGeometry:
    return BadGeometry(
        f"the mask has more than {MAX_PARTS} zones; is it a map instead of a keep-out mask?"
    )


def _runs(mask: BoolGrid, spec: GridSpec) -> Iterator[Polygon]:
    """Yield one box for each run of marked cells in a row."""
    edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, starts = np.nonzero(edges == 1)
    _, ends = np.nonzero(edges == -1)
    side, x, y = spec.resolution_m, spec.origin_x_m, spec.origin_y_m
    for row, start, end in zip(rows.tolist(), starts.tolist(), ends.tolist(), strict=True):
        yield box(x + start * side, y + row * side, x + end * side, y + (row + 1) * side)


def _simple(whole: Polygon, most: int) -> list[Polygon]:
    """Cut a polygon in two repeatedly, until no part has a hole or too many corners; raises
    `BadGeometry` for too many parts."""
    if len(whole.interiors) > MAX_HOLES:
        raise _too_many()
    found, waiting = list[Polygon](), [whole]
    while waiting:
        if len(found) + len(waiting) > most:
            raise _too_many()
        (polygon,) = _polygons(waiting.pop().simplify(0.0))
        if not polygon.interiors and len(polygon.exterior.coords) <= MAX_CORNERS:
            found.append(polygon)
        else:
            vertical, horizontal = _cut(polygon)
            waiting += vertical if len(vertical) <= len(horizontal) else horizontal
    return found


def _cut(polygon: Polygon) -> list[list[Polygon]]:
    """Return the parts after a vertical and after a horizontal cut, through a hole if there is one,
    otherwise through the middle."""
    left, low, right, top = polygon.bounds
    middle = (
        polygon.interiors[0].centroid if polygon.interiors else box(left, low, right, top).centroid
    )
    at_x, at_y = (
        min(max(middle.x, left + 1e-6), right - 1e-6),
        min(max(middle.y, low + 1e-6), top - 1e-6),
    )
    cuts = (
        (box(left, low, at_x, top), box(at_x, low, right, top)),
        (box(left, low, right, at_y), box(left, at_y, right, top)),
    )
    return [
        [piece for half in halves for piece in _polygons(polygon.intersection(half))]
        for halves in cuts
    ]


def _polygons(shape: shapely.Geometry) -> Sequence[Polygon]:
    if isinstance(shape, Polygon):
        return [] if shape.is_empty else [shape]
    if isinstance(shape, MultiPolygon) or hasattr(shape, "geoms"):
        return [part for part in shape.geoms if isinstance(part, Polygon) and not part.is_empty]
    return []
