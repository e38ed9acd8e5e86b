"""Painted patterns of floor markings: the parts of a polygon and their colours, without overlap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import shapely
import shapely.affinity
from shapely.geometry.base import BaseGeometry

from sim.models.solids import Colour

PaintPattern = Literal[
    "tape",
    "red-white-tape",
    "hatched",
    "bay",
    "white-bay",
    "high-voltage",
    "radiation",
    "yellow",
    "blue",
    "green",
    "white-line",
]
"""Pattern of a floor marking."""
YELLOW: Colour = (245, 200, 10)
RED: Colour = (200, 20, 20)
BLUE: Colour = (25, 85, 205)
GREEN: Colour = (20, 140, 60)
WHITE: Colour = (245, 245, 242)
BLACK: Colour = (22, 22, 24)
MAGENTA: Colour = (170, 15, 120)
PATTERN_COLOURS: dict[str, Colour] = {
    "tape": YELLOW,
    "red-white-tape": RED,
    "hatched": YELLOW,
    "bay": BLUE,
    "white-bay": WHITE,
    "high-voltage": YELLOW,
    "radiation": YELLOW,
    "yellow": YELLOW,
    "blue": BLUE,
    "green": GREEN,
    "white-line": WHITE,
}
"""Default main colour of each pattern."""
PLAIN = ("yellow", "blue", "green", "white-line")
"""Patterns whose whole area is painted."""
STRIPE_M = 0.1
"""Width of a stripe of tape and of every line."""
HATCH_M = 0.4
"""Distance from one line of a hatched area to the next."""
_BOLT = [
    (0.1, 1.0),
    (-0.45, -0.1),
    (-0.05, -0.05),
    (-0.25, -1.0),
    (0.45, 0.2),
    (0.05, 0.15),
    (0.45, 1.0),
]
"""Outline of the flash of ISO 7010 W012 within a circle of about 1."""
_BORDER_SHARE = 0.12
"""Width of the black border of a warning sign as a share of its radius."""
Part = tuple[Colour, BaseGeometry]
"""Colour, and the area painted with it."""


def painted_parts(
    polygon: Sequence[Sequence[float]], pattern: PaintPattern, colour: Colour
) -> list[Part]:
    """Return the painted parts of a polygon in metres; what is left out is bare floor.

    Tape has stripes of `colour` and of black or white; a hatched area has lines of `colour` and an
    edge line, a bay only the edge line; a symbol lies in the middle of an area of `colour`, its
    upper side towards +y.
    """
    area = shapely.Polygon(polygon)
    if pattern in PLAIN:
        return [(colour, area)]
    if pattern in ("tape", "red-white-tape"):
        second = BLACK if pattern == "tape" else WHITE
        return _both(area, _stripes(area, STRIPE_M, 2 * STRIPE_M), colour, second)
    edge = area.difference(area.buffer(-STRIPE_M, join_style="mitre"))
    if pattern in ("bay", "white-bay"):
        return [(colour, edge)]
    if pattern == "hatched":
        lines = _stripes(area, STRIPE_M, HATCH_M)
        return [(colour, area.intersection(shapely.union_all([edge, lines])))]
    circle = shapely.maximum_inscribed_circle(area)
    middle, radius_m = circle.coords[0], circle.length
    if pattern == "radiation":
        return _both(area, _placed(_trefoil(), middle, 0.85 * radius_m), colour, MAGENTA)
    border = area.difference(area.buffer(-_BORDER_SHARE * radius_m, join_style="mitre"))
    bolt = _placed(shapely.Polygon(_BOLT), middle, 0.75 * radius_m)
    return _both(area, shapely.union_all([border, bolt]), colour, BLACK)


def _both(area: BaseGeometry, drawn: BaseGeometry, below: Colour, above: Colour
          ) -> list[Part]:  # fmt: skip
    parts = [(below, area.difference(drawn)), (above, area.intersection(drawn))]
    return [(colour, part) for colour, part in parts if part.area > 0]


def _stripes(area: BaseGeometry, width_m: float, period_m: float) -> BaseGeometry:
    """Return diagonal stripes over the bounding box of an area."""
    x0, y0, x1, y1 = area.bounds
    middle, reach_m = ((x0 + x1) / 2, (y0 + y1) / 2), math.hypot(x1 - x0, y1 - y0) / 2
    count = math.ceil(reach_m / period_m)
    bars = [
        shapely.box(k * period_m - width_m / 2, -reach_m, k * period_m + width_m / 2, reach_m)
        for k in range(-count, count + 1)
    ]
    turned = shapely.affinity.rotate(shapely.union_all(bars), 45, origin=(0, 0))
    return shapely.affinity.translate(turned, *middle)


def _trefoil() -> BaseGeometry:
    """Return the trefoil of ISO 7010 W003 in a circle of 1: a disc of 1/5, and three blades of 60°
    from 3/10 on."""
    ring = shapely.Point(0, 0).buffer(1.0).difference(shapely.Point(0, 0).buffer(0.3))
    blades = [
        shapely.Polygon(
            [(0, 0), *((2 * math.cos(a), 2 * math.sin(a)) for a in (at - 0.5236, at, at + 0.5236))]
        )
        for at in (math.pi / 6, 5 * math.pi / 6, 3 * math.pi / 2)
    ]
    return shapely.union_all(
        [shapely.Point(0, 0).buffer(0.2), *(ring.intersection(blade) for blade in blades)]
    )


def _placed(shape: BaseGeometry, middle: Sequence[float], scale: float) -> BaseGeometry:
    grown = shapely.affinity.scale(shape, scale, scale, origin=(0, 0))
    return shapely.affinity.translate(grown, *middle[:2])
