"""Zones from a picture of cells and back: Nav2's keep-out masks.

A mask has staircases, holes and any number of parts; a zone is one simple polygon. Parts become
zones of their own, a part with a hole is cut through the hole, so that the floor within a fence
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
from navcore.mission.zone import MAX_CORNERS, Zone, cells_of

MAX_PARTS, MAX_HOLES = 200, 2000
INSET = 0.1
"""So many cells the polygon stays inside its cells: on their border it would touch, and so take,
the next ones."""


def closed_cells(zones: Iterable[Zone], spec: GridSpec) -> BoolGrid:
    """(rows, cols) the keep-outs that are switched on, each grown by its own margin."""
    plain, wide = cells_of(zones, spec)
    for margin_m, mask in wide:
        plain = plain | inflate_by(mask, margin_m, spec.resolution_m)
    return plain


def polygons_of(mask: BoolGrid, spec: GridSpec) -> tuple[Corners, ...]:
    """Simple polygons that touch exactly the marked cells of (rows, cols), biggest first; raises
    `BadGeometry` for too many."""
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
        f"the mask falls into more than {MAX_PARTS} zones; is it a map instead of a keep-out mask?"
    )


def _runs(mask: BoolGrid, spec: GridSpec) -> Iterator[Polygon]:
    """One box for each run of marked cells in a row."""
    edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, starts = np.nonzero(edges == 1)
    _, ends = np.nonzero(edges == -1)
    side, x, y = spec.resolution_m, spec.origin_x_m, spec.origin_y_m
    for row, start, end in zip(rows.tolist(), starts.tolist(), ends.tolist(), strict=True):
        yield box(x + start * side, y + row * side, x + end * side, y + (row + 1) * side)


def _simple(whole: Polygon, most: int) -> list[Polygon]:
    """The polygon cut in two, and again, until no part has a hole or too many corners; raises
    `BadGeometry` for too many."""
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
            one_way, other_way = _cut(polygon)
            waiting += one_way if len(one_way) <= len(other_way) else other_way
    return found


def _cut(polygon: Polygon) -> list[list[Polygon]]:
    """What it falls into, cut through a hole, so that it is one no more, or else in the middle: up
    and down, and across."""
    left, low, right, top = polygon.bounds
    middle = (
        polygon.interiors[0].centroid if polygon.interiors else box(left, low, right, top).centroid
    )
    at_x, at_y = (
        min(max(middle.x, left + 1e-6), right - 1e-6),
        min(max(middle.y, low + 1e-6), top - 1e-6),
    )
    ways = (
        (box(left, low, at_x, top), box(at_x, low, right, top)),
        (box(left, low, right, at_y), box(left, at_y, right, top)),
    )
    return [
        [piece for half in halves for piece in _polygons(polygon.intersection(half))]
        for halves in ways
    ]


def _polygons(shape: shapely.Geometry) -> Sequence[Polygon]:
    if isinstance(shape, Polygon):
        return [] if shape.is_empty else [shape]
    if isinstance(shape, MultiPolygon) or hasattr(shape, "geoms"):
        return [part for part in shape.geoms if isinstance(part, Polygon) and not part.is_empty]
    return []
