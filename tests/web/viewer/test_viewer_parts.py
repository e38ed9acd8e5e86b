"""Laws of the parts of the 3D view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import viser
from hypothesis import example, given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from app.runtime.control.stop_reasons import POSE_STOPS
from navcore.grid.cell_mask import CellMask
from navcore.mission.mission import Phase
from navcore.mission.zone import Zone
from tests.web.fake_operations import FakeOperations
from web.interface.insight import Candidates
from web.interface.snapshots import Cloud
from web.viewer.camera import overview
from web.viewer.layers.base import Scene
from web.viewer.layers.cloud import (
    TILE_M,
    CloudLayer,
    class_shading,
    halvings,
    index_tiles,
    is_kept,
)
from web.viewer.layers.floor import FloorLayer
from web.viewer.layers.geometry import flag_mesh, handle_mesh, polyline_segments, triangulate
from web.viewer.layers.goals_zones import label_of
from web.viewer.layers.primitives import primitive_segments
from web.viewer.layers.robot import mark_of
from web.viewer.picking import floor_point

anything = st.floats(allow_nan=True, allow_infinity=True)
sensible = st.floats(-50, 50)


@given(st.tuples(sensible, sensible), st.tuples(sensible, sensible, st.floats(0.5, 30)))
def test_a_ray_through_a_point_of_the_floor_meets_it_there(
    point: tuple[float, float], eye: tuple[float, float, float]
) -> None:
    way = (point[0] - eye[0], point[1] - eye[1], -eye[2])
    picked = floor_point(eye, way)
    assert picked is not None and np.allclose(picked, point, atol=1e-6)


@given(st.tuples(anything, anything, anything), st.tuples(anything, anything, anything))
def test_any_ray_gives_a_finite_place_or_none(
    origin: tuple[float, ...], way: tuple[float, ...]
) -> None:
    picked = floor_point(origin, way)
    assert picked is None or np.isfinite(picked).all()


def test_rays_that_meet_no_floor_give_nothing() -> None:
    for way in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (float("nan"), 0.0, -1.0)):
        assert floor_point((0.0, 0.0, 2.0), way) is None
    assert floor_point((0.0, 0.0), (0.0, 0.0, -1.0)) is None


@given(st.lists(st.tuples(sensible, sensible), min_size=3, max_size=12, unique=True))
@example([(0.0, -1.0), (1.0, 0.0), (2.2e-311, -9.3e-226), (4.9e-112, 0.0), (0.0, 0.0)])
def test_the_triangles_of_a_zone_cover_exactly_its_area(points: list[tuple[float, float]]) -> None:
    middle = np.mean(points, axis=0)
    ring = sorted(points, key=lambda point: np.arctan2(point[1] - middle[1], point[0] - middle[0]))
    polygon = Polygon(ring)
    if not polygon.is_valid or polygon.area < 1e-3:
        return
    vertices, faces = triangulate(np.array(ring), 0.5)
    assert (vertices[:, 2] == 0.5).all()
    assert np.isclose(sum(Polygon(vertices[face, :2]).area for face in faces), polygon.area)


def test_the_labels_of_the_scene_have_signs_in_place_of_words() -> None:
    operations = FakeOperations()
    idle = operations.state()
    reasons = tuple(stop for stop in POSE_STOPS.values())[:1]
    states = [replace(idle, phase=phase) for phase in Phase]
    states += [replace(idle, reasons=reasons), replace(idle, stop_latched=True)]
    states.append(replace(idle, phase=Phase.PAUSED, reasons=reasons))
    marks = [mark_of(state) for state in states]
    assert marks == ["●", "▶", "❚❚", "▶", "▲", "■", "❚❚"]
    zone = Zone(id="a", name="Ω", polygon=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    assert label_of(zone) == "Ω"
    assert label_of(replace(zone, max_speed_mps=0.25)) == "Ω ≤ 0.25 m/s"
    assert label_of(replace(zone, enabled=False)) == "○ Ω"


def cloud_of(points: npt.NDArray[np.float32], serial: int = 1) -> Cloud:
    grey = np.full((len(points), 3), 128, dtype=np.uint8)
    return Cloud(
        serial=serial, points_map=points, rgb=grey, class_ids=np.zeros(len(points), dtype=np.uint8)
    )


def test_the_sum_of_a_tile_changes_with_its_own_points_only_and_not_with_their_order() -> None:
    generator = np.random.default_rng(0)
    points = generator.uniform(-20, 20, (20_000, 3)).astype(np.float32)
    points[7] = np.nan
    tile_of, tiles, sums = index_tiles(cloud_of(points))
    assert tile_of[7] == -1 and tile_of.max() == len(tiles) - 1
    kept = np.delete(np.arange(len(points)), 7)
    assert (np.floor(points[kept, :2] / TILE_M).astype(int) == np.array(tiles)[tile_of[kept]]).all()
    shuffled = index_tiles(cloud_of(generator.permutation(points)))
    assert (shuffled[1], shuffled[2]) == (tiles, sums)
    moved = points.copy()
    moved[100, 2] += 0.01
    differs = [
        tile
        for tile, old, new in zip(tiles, sums, index_tiles(cloud_of(moved))[2], strict=True)
        if old != new
    ]
    assert differs == [tiles[tile_of[100]]]
    recoloured = cloud_of(points)
    recoloured.rgb[100] = (1, 2, 3)
    assert [
        i for i, (a, b) in enumerate(zip(sums, index_tiles(recoloured)[2], strict=True)) if a != b
    ] == [tile_of[100]]


@given(st.integers(0, 3_000_000), st.integers(1, 400_000))
def test_the_points_are_halved_until_they_keep_the_budget(count: int, budget: int) -> None:
    halved = halvings(count, budget, 0)
    assert count >> halved <= budget and (halved == 0 or count >> (halved - 1) > budget)


def test_the_share_of_points_has_hysteresis_and_depends_on_position_alone() -> None:
    assert [halvings(count, 100, 1) for count in (250, 190, 90, 70)] == [2, 1, 1, 0]
    points = np.random.default_rng(0).uniform(-20, 20, (50_000, 3)).astype(np.float32)
    shown = is_kept(points, 2)
    assert 0.23 < shown.mean() < 0.27 and (shown[::-1] == is_kept(points[::-1], 2)).all()
    assert not (shown & ~is_kept(points, 1)).any()


def test_only_tiles_that_changed_are_sent_again() -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        layer = CloudLayer(server, "cloud/height", "height", budget=5_000)
        points = np.random.default_rng(0).uniform(0, 40, (16_000, 3)).astype(np.float32)
        assert layer.push(cloud_of(points, 1)) == 25
        assert layer.push(cloud_of(points, 1)) == 0
        moved = np.vstack([points, [[1.0, 1.0, 0.5]]]).astype(np.float32)
        assert layer.push(cloud_of(moved, 2)) == 1
        assert layer.push(cloud_of(moved[moved[:, 0] > 8.0], 3)) == 0
    finally:
        server.stop()


def test_a_tile_of_the_floor_that_changes_keeps_its_node_which_has_a_place() -> None:
    # A node that is made again is drawn at the origin for a frame.
    operations = FakeOperations()
    tick = operations.newest_tick()
    assert tick is not None
    listed = operations.beware.list
    scene = Scene(state=operations.state(), tick=tick, zones=(), beware=listed)
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        layer = FloorLayer(server)
        layer.push(scene)
        before = dict(server.scene._handle_from_node_name)
        assert [name for name in before if name.startswith("/floor/")]
        layer.push(replace(scene, beware=replace(listed, version=listed.version + 1)))
        after = server.scene._handle_from_node_name
        assert {name: id(node) for name, node in after.items()} == {
            name: id(node) for name, node in before.items()
        }
    finally:
        server.stop()


def test_the_overview_shows_the_area_that_was_seen() -> None:
    tick = FakeOperations().newest_tick()
    assert tick is not None
    spec, seen = tick.grid_spec, np.zeros_like(tick.seen)
    seen[20:100, 10:30] = seen[50, 10:60] = True
    _, target = overview(replace(tick, seen_mask=CellMask.of(seen)))
    low, high = spec.centres(np.array([[20, 10], [99, 59]]))
    away = max(high[0] - low[0], 1.3 * (high[1] - low[1]), 9.0)
    assert np.allclose(target, [*(low + high) / 2 - [0.0, 0.1 * away], 0.0])
    _, whole = overview(replace(tick, seen_mask=CellMask.of(np.zeros_like(seen))))
    assert np.isclose(whole[0], spec.origin_x_m + spec.cols * spec.resolution_m / 2)


def test_an_arc_is_drawn_to_just_beyond_its_first_touch() -> None:
    arcs = np.stack([np.column_stack([np.arange(10), np.full(10, i)]) for i in range(4)]).astype(
        np.float64
    )
    segments, is_free = primitive_segments(
        Candidates(serial=1, arcs=arcs, free=np.array([10, 0, 4, 0]))
    )
    assert len(segments) == 9 + 4 and is_free.tolist() == [True] * 9 + [True] * 3 + [False]


def test_points_of_a_class_have_its_colour_and_the_rest_grows_lighter_with_height() -> None:
    points = np.array([[0, 0, 0], [0, 0, 2], [0, 0, 1]], dtype=np.float32)
    rgb = class_shading(points, np.array([0, 0, 1], dtype=np.uint8)).astype(int)
    assert rgb[0].sum() < rgb[1].sum() and rgb[2, 0] > 2 * rgb[2, 2]


def test_shapes_name_only_vertices_they_have() -> None:
    for vertices, faces in (flag_mesh(), handle_mesh()):
        assert faces.max() < len(vertices) and np.isfinite(vertices).all()
    assert polyline_segments(np.zeros((5, 2)), 1.0).shape == (4, 2, 3)
