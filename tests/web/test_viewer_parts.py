"""Laws of the 3D view's small parts."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from tests.web.fake_operations import SPEC
from web.viewer.cloud import chosen_points, coloured
from web.viewer.picking import clamped, floor_point
from web.viewer.shapes import flag, knob, ribbon, triangulated

anything = st.floats(allow_nan=True, allow_infinity=True)
sensible = st.floats(-50, 50)


@given(st.tuples(sensible, sensible), st.tuples(sensible, sensible, st.floats(0.5, 30)))
def test_a_ray_through_a_point_of_the_floor_meets_it_there(point: tuple[float, float], eye: tuple[float, float, float]) -> None:
    way = (point[0] - eye[0], point[1] - eye[1], -eye[2])
    picked = floor_point(eye, way)
    assert picked is not None and np.allclose(picked, point, atol=1e-6)


@given(st.tuples(anything, anything, anything), st.tuples(anything, anything, anything))
def test_any_ray_gives_a_finite_place_or_none(origin: tuple[float, ...], way: tuple[float, ...]) -> None:
    picked = floor_point(origin, way)
    assert picked is None or np.isfinite(picked).all()


def test_rays_that_meet_no_floor_give_nothing() -> None:
    for way in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (float("nan"), 0.0, -1.0)):
        assert floor_point((0.0, 0.0, 2.0), way) is None
    assert floor_point((0.0, 0.0), (0.0, 0.0, -1.0)) is None


@given(st.tuples(sensible, sensible))
def test_a_place_beside_the_map_is_brought_onto_it_even_rounded_to_millimetres(point: tuple[float, float]) -> None:
    x, y = clamped(point, SPEC)
    assert SPEC.contains(round(x, 3), round(y, 3))


@given(st.lists(st.tuples(sensible, sensible), min_size=3, max_size=12, unique=True))
def test_the_triangles_of_a_zone_cover_exactly_its_area(points: list[tuple[float, float]]) -> None:
    middle = np.mean(points, axis=0)
    ring = sorted(points, key=lambda point: np.arctan2(point[1] - middle[1], point[0] - middle[0]))
    polygon = Polygon(ring)
    if not polygon.is_valid or polygon.area < 1e-3:
        return
    vertices, faces = triangulated(np.array(ring), 0.5)
    assert (vertices[:, 2] == 0.5).all()
    assert np.isclose(sum(Polygon(vertices[face, :2]).area for face in faces), polygon.area)


def test_the_cloud_keeps_its_budget_and_what_it_has_chosen() -> None:
    points = np.random.default_rng(0).uniform(-20, 20, (50_000, 3)).astype(np.float32)
    points[7] = np.nan
    chosen = chosen_points(points, budget=10_000)
    assert 8_000 < len(chosen) <= 10_000 and 7 not in chosen
    assert (chosen == chosen_points(points.copy(), budget=10_000)).all()
    assert len(chosen_points(points, budget=100_000)) == 49_999


def test_points_of_a_class_have_its_colour_and_the_rest_grows_lighter_with_height() -> None:
    points = np.array([[0, 0, 0], [0, 0, 2], [0, 0, 1]], dtype=np.float32)
    rgb = coloured(points, np.array([0, 0, 1], dtype=np.uint8)).astype(int)
    assert rgb[0].sum() < rgb[1].sum() and rgb[2, 0] > 2 * rgb[2, 2]


def test_shapes_name_only_vertices_they_have() -> None:
    for vertices, faces in (flag(), knob()):
        assert faces.max() < len(vertices) and np.isfinite(vertices).all()
    assert ribbon(np.zeros((5, 2)), 1.0).shape == (4, 2, 3)
