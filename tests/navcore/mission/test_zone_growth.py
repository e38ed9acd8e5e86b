"""Zones grow by an ellipse, and contain the exact sum of both."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from navcore.geometry.polyline import Corners
from navcore.grid.grid import GridSpec
from navcore.mission.zone import Zone, ZoneKind, forbidden_cells
from navcore.mission.zone_growth import (
    area_of,
    covering,
    distance_m,
    grow,
    grown_outlines,
    largest_axis_m,
    most_growth_m,
    spread_of,
)

SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0))


def covariance(along_m: float, across_m: float, angle_rad: float) -> np.ndarray:
    turn = np.array(
        [
            [math.cos(angle_rad), -math.sin(angle_rad)],
            [math.sin(angle_rad), math.cos(angle_rad)],
        ]
    )
    return np.asarray(turn @ np.diag([along_m**2, across_m**2]) @ turn.T)


@settings(max_examples=60, deadline=None)
@given(
    along_m=st.floats(0.0, 0.5),
    across_m=st.floats(0.0, 0.5),
    angle_rad=st.floats(-math.pi, math.pi),
    sigmas=st.floats(0.5, 3.0),
    direction_rad=st.floats(-math.pi, math.pi),
)
def test_every_corner_moved_within_the_ellipse_stays_inside(
    along_m: float, across_m: float, angle_rad: float, sigmas: float, direction_rad: float
) -> None:
    spread = spread_of(covariance(along_m, across_m, angle_rad), sigmas)
    grown = Polygon(grown_outlines(SQUARE, spread)[0]).buffer(1e-9)
    moved = spread @ np.array([math.cos(direction_rad), math.sin(direction_rad)])
    for corner in SQUARE:
        assert grown.contains(Point(np.asarray(corner) + moved))


def test_growth_is_as_wide_as_the_uncertainty_across_an_edge_and_no_wider() -> None:
    spread = spread_of(np.diag([0.2**2, 0.01**2]), 2.0)
    left, bottom, right, top = Polygon(grown_outlines(SQUARE, spread)[0]).bounds
    assert (left, right) == pytest.approx((-0.4, 2.4), abs=0.03)
    assert (bottom, top) == pytest.approx((-0.02, 1.02), abs=0.002)
    assert largest_axis_m(spread) == pytest.approx(0.4)


def test_a_certain_position_grows_nothing_to_speak_of() -> None:
    grown = Polygon(grown_outlines(SQUARE, spread_of(np.zeros((3, 3)), 2.0))[0])
    assert grown.area == pytest.approx(Polygon(SQUARE).area, abs=0.01)


@settings(max_examples=60, deadline=None)
@given(
    along_m=st.floats(0.0, 0.3),
    across_m=st.floats(0.0, 0.3),
    angle_rad=st.floats(-math.pi, math.pi),
    direction_rad=st.floats(-math.pi, math.pi),
)
def test_a_stay_inside_zone_shrinks_so_that_no_point_of_the_rest_is_moved_out_of_it(
    along_m: float, across_m: float, angle_rad: float, direction_rad: float
) -> None:
    spread = spread_of(covariance(along_m, across_m, angle_rad), 2.0)
    site = Zone(id="s", name="site", polygon=SQUARE, kind=ZoneKind.STAY_INSIDE)
    left = Polygon(grow(site, spread).polygon)
    moved = spread @ np.array([math.cos(direction_rad), math.sin(direction_rad)])
    whole = Polygon(SQUARE).buffer(1e-9)
    for corner in left.exterior.coords:
        assert whole.contains(Point(np.asarray(corner))) or left.area < 1e-5
        assert whole.contains(Point(np.asarray(corner) + moved)) or left.area < 1e-5
    assert left.area > 1e-5 or max(along_m, across_m) > 0.2


def test_nothing_is_left_of_a_site_smaller_than_the_uncertainty() -> None:
    site = Zone(id="s", name="site", polygon=SQUARE, kind=ZoneKind.STAY_INSIDE)
    left = Polygon(grow(site, spread_of(np.diag([1.0, 1.0]), 2.0)).polygon)
    assert 0 < left.area < 1e-4


@settings(max_examples=100, deadline=None)
@given(
    along_m=st.floats(0.0, 5.0),
    across_m=st.floats(0.0, 5.0),
    angle_rad=st.floats(-math.pi, math.pi),
    sigmas=st.floats(0.5, 3.0),
)
def test_no_growth_is_larger_than_its_bound(
    along_m: float, across_m: float, angle_rad: float, sigmas: float
) -> None:
    known = covariance(along_m, across_m, angle_rad)
    growth_m = largest_axis_m(spread_of(covering(known), sigmas))
    assert growth_m <= most_growth_m(known, sigmas) * (1 + 1e-12)


ROOMS = (
    *((-8.0, -3.0), (0.0, -3.0), (0.0, -0.5), (0.3, -0.5), (0.3, -3.0), (5.3, -3.0)),
    *((5.3, 3.0), (0.3, 3.0), (0.3, 0.5), (0.0, 0.5), (0.0, 3.0), (-8.0, 3.0)),
)
"""Two rooms, joined by a door of 1 m."""
BAND = (
    *((0.3, 0.5), (0.0, 0.5), (0.0, 3.3), (5.6, 3.3), (5.6, -3.3), (0.0, -3.3)),
    *((0.0, -0.5), (0.3, -0.5), (0.3, -3.0), (5.3, -3.0), (5.3, 3.0), (0.3, 3.0)),
)
"""A band round a yard, open by a gap of 1 m."""


@pytest.mark.parametrize(
    ("kind", "polygon", "others_m"),
    [(ZoneKind.STAY_INSIDE, ROOMS, -4.0), (ZoneKind.KEEP_OUT, BAND, -1.0)],
)
def test_what_is_left_free_stays_so_also_where_the_growth_closes_the_way_to_it(
    kind: ZoneKind, polygon: Corners, others_m: float
) -> None:
    zone = Zone(id="z", name="z", polygon=polygon, kind=kind)
    grown = grow(zone, spread_of(0.3**2 * np.eye(2), 2.0))
    assert len(grown.further) == 1
    in_yard, in_gap, beyond = (Point(x_m, 0.0).buffer(0.1) for x_m in (2.8, 0.15, others_m))
    away_m = distance_m(grown, np.array([in_yard, in_gap, beyond], dtype=np.object_))
    assert away_m[0] == pytest.approx(distance_m(zone, np.array([in_yard]))[0] - 0.6, abs=0.1)
    assert away_m[1] == 0.0 < away_m[2]
    spec = GridSpec.centred(size_m=(20.0, 10.0), resolution_m=0.05)
    forbidden = forbidden_cells(grown, spec)
    assert [bool(forbidden[spec.cell(x, 0.0)]) for x in (2.8, 0.15, others_m)] == [0, 1, 0]
    # Every cell that the area of the zone touches, and none that is a cell away from it.
    rows, cols = np.mgrid[: spec.rows, : spec.cols]
    centres = spec.centres(np.column_stack([rows.ravel(), cols.ravel()]))
    points = np.asarray(shapely.points(centres))
    exact_m = distance_m(grown, points).reshape(forbidden.shape)
    assert forbidden[exact_m == 0.0].all() and not forbidden[exact_m > 0.05].any()
    assert grown.bounds == pytest.approx(area_of(grown).bounds)
