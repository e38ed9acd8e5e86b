"""Circles and corridors: the polygon contains all of the shape, which is kept only while it is
true."""

from __future__ import annotations

import math

import pytest
from shapely.geometry import LineString, Point, Polygon

from navcore.errors import BadGeometry
from navcore.mission.zone_shapes import Circle, Corridor, Shape, still_drawn

CIRCLE = Circle(centre=(1.0, -2.0), radius_m=0.7)
BENT = Corridor(line=((0.0, 0.0), (2.0, 0.0), (2.0, 1.5)), width_m=0.4)


def test_no_part_of_a_circle_or_a_strip_is_outside_its_polygon_and_little_else_is_inside() -> None:
    circle = Polygon(CIRCLE.outline())
    assert circle.buffer(1e-9).contains(Point(CIRCLE.centre).buffer(0.7, quad_segs=64))
    assert circle.area < 1.01 * math.pi * 0.7**2
    strip = Polygon(BENT.outline())
    assert strip.buffer(1e-6).contains(LineString(BENT.line).buffer(0.19, cap_style="flat"))
    assert strip.area == pytest.approx(0.4 * 3.5, rel=0.02)


@pytest.mark.parametrize(
    ("shape", "word"),
    [
        (Circle(centre=(math.nan, 0.0), radius_m=1.0), "not finite"),
        (Circle(centre=(0.0, 0.0), radius_m=0.0), "radius"),
        (Circle(centre=(0.0, 0.0), radius_m=math.inf), "radius"),
        (Corridor(line=((0.0, 0.0), (0.0, 0.0)), width_m=1.0), "distinct points"),
        (Corridor(line=((0.0, 0.0), (math.inf, 0.0)), width_m=1.0), "not finite"),
        (Corridor(line=((0.0, 0.0), (1.0, 0.0)), width_m=0.0), "width"),
        (
            Corridor(
                line=((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0), (0.0, 0.0)), width_m=0.2
            ),
            "encloses an area",
        ),
        (Corridor(line=tuple((0.1 * i, 0.0) for i in range(300)), width_m=0.2), "at most 200"),
    ],
)
def test_an_invalid_shape_is_refused_with_the_reason(shape: Shape, word: str) -> None:
    with pytest.raises(BadGeometry, match=word):
        shape.outline()


def test_a_shape_is_kept_while_its_polygon_is_unchanged_and_dropped_when_a_corner_moves() -> None:
    ring = CIRCLE.outline()
    sent = tuple((round(x, 6), round(y, 6)) for x, y in ring)
    assert still_drawn(CIRCLE, sent) == CIRCLE
    assert still_drawn(CIRCLE, ((ring[0][0] + 0.1, ring[0][1]), *ring[1:])) is None
    assert still_drawn(None, ring) is None
