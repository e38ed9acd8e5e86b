"""Shapes that the operator draws instead of polygons, and the polygon of each.

The polygon is what holds for the robot; the shape is stored too, so that a circle can be edited as
a circle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import shapely
from shapely.geometry import LineString, Polygon

from navcore.errors import BadGeometry
from navcore.geometry.polyline import Corners

CIRCLE_CORNERS = 48
"""Number of corners of a circle's polygon."""
MIN_RADIUS_M, MAX_RADIUS_M = 0.02, 500.0
"""Range of radii in metres."""
MIN_WIDTH_M, MAX_WIDTH_M = 0.02, 100.0
"""Range of corridor widths in metres."""
MAX_BENDS = 200
"""Largest number of points of a corridor's line."""
SAME_M = 1e-3
"""Hausdorff distance in metres up to which a polygon is that of a shape, apart from rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """Disc around a point."""

    centre: tuple[float, float]
    """(x, y) in metres of the map frame."""
    radius_m: float
    """Radius in metres, `MIN_RADIUS_M` to `MAX_RADIUS_M`."""

    def outline(self) -> Corners:
        """Return the polygon that circumscribes the circle; raises `BadGeometry` for bad values."""
        if not all(map(math.isfinite, self.centre)):
            raise BadGeometry("the circle's centre is not finite; give metres of the map frame")
        if not MIN_RADIUS_M <= self.radius_m <= MAX_RADIUS_M:
            raise BadGeometry(
                f"radius {self.radius_m:g} m is out of range, allowed {MIN_RADIUS_M:g} to "
                f"{MAX_RADIUS_M:g} m"
            )
        (x, y), reach = self.centre, self.radius_m / math.cos(math.pi / CIRCLE_CORNERS)
        angles = [2 * math.pi * i / CIRCLE_CORNERS for i in range(CIRCLE_CORNERS)]
        return tuple((x + reach * math.cos(angle), y + reach * math.sin(angle)) for angle in angles)


@dataclass(frozen=True, slots=True, kw_only=True)
class Corridor:
    """Strip of constant width along a line, with flat ends."""

    line: Corners
    """Points (x, y) in metres of the map frame, at least two."""
    width_m: float
    """Width in metres from edge to edge, `MIN_WIDTH_M` to `MAX_WIDTH_M`."""

    def outline(self) -> Corners:
        """Return the polygon of the strip; raises `BadGeometry` for bad values and for a line that
        encloses an area."""
        if len(self.line) > MAX_BENDS:
            raise BadGeometry(
                f"the line has {len(self.line)} points, at most {MAX_BENDS} are allowed"
            )
        if not all(math.isfinite(value) for point in self.line for value in point):
            raise BadGeometry(
                "the line has a point that is not finite; give metres of the map frame"
            )
        if len(set(self.line)) < 2:
            raise BadGeometry(
                f"the line has {len(set(self.line))} distinct points, it needs at least 2"
            )
        if not MIN_WIDTH_M <= self.width_m <= MAX_WIDTH_M:
            raise BadGeometry(
                f"width {self.width_m:g} m is out of range, allowed {MIN_WIDTH_M:g} to "
                f"{MAX_WIDTH_M:g} m"
            )
        strip = LineString(self.line).buffer(
            self.width_m / 2, cap_style="flat", join_style="round", quad_segs=4
        )
        if not isinstance(strip, Polygon) or strip.is_empty:
            raise BadGeometry("the line makes no connected strip; draw it wider or in parts")
        if strip.interiors:
            raise BadGeometry(
                "the line encloses an area; leave it open, draw two lines, or draw a polygon"
            )
        return tuple((float(x), float(y)) for x, y in strip.exterior.coords[:-1])


Shape = Circle | Corridor


def still_drawn(shape: Shape | None, polygon: Corners) -> Shape | None:
    """Return the shape if the polygon is still that of the shape; None if its corners were
    moved."""
    if shape is None:
        return None
    outline = shape.outline()
    if len(polygon) < 3:
        return None
    apart = shapely.hausdorff_distance(Polygon(outline).exterior, Polygon(polygon).exterior)
    return shape if apart <= SAME_M else None
