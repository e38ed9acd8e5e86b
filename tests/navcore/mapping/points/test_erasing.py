"""Erasing: what the operator erases is gone until the camera sees it again or it is put back."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.arrays import Indices
from navcore.geometry.transform import Pose2
from navcore.grid.growth import growth_to
from navcore.mapping.correction import prepare
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.erasing import Erasable
from navcore.mapping.points.point_table import MapPoints
from navcore.mapping.storage.map_file import load, save
from navcore.mapping.views.observation import observe
from navcore.mission.zone_cells import rasterise
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.frame import Frame
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import ALL, SMALL, assert_same, layers, random_step, rebuilt
from tests.navcore.scene import RED_ID, RED_LIST, SPEC, Box, Paint, picture

BOX = Box(x=(1.8, 2.2), y=(-0.3, 0.3), z=(0.0, 0.5))
MARK = Paint(x=(1.2, 1.6), y=(-0.3, 0.3))
EVERYWHERE = np.arange(SPEC.rows * SPEC.cols)


def look(point_map: PointMap, frame: Frame) -> None:
    labels = ColourSegmenter().segment(frame, RED_LIST)
    seen = observe(frame, labels, RED_LIST, point_map.spec, ObservationConfig())
    point_map.insert(seen, frame, labels)


def mapped(*frames: Frame) -> PointMap:
    point_map = PointMap(SPEC, MappingConfig())
    for frame in frames:
        look(point_map, frame)
    return point_map


def occupied(point_map: PointMap) -> tuple[int, int]:
    """Return the number of cells with obstacles and of those with red floor."""
    grid = layer_grid(point_map, RED_LIST, ())
    return int(grid.geometric.sum()), int(grid.beware[RED_ID].sum())


def cells_of(left: float, low: float, right: float, high: float) -> Indices:
    corners = ((left, low), (right, low), (right, high), (left, high))
    return np.flatnonzero(rasterise(corners, SPEC))


def in_order(points: MapPoints) -> list[tuple[float, ...]]:
    columns = (getattr(points, field.name) for field in dataclasses.fields(points))
    return sorted(map(tuple, np.column_stack(list(columns)).tolist()))


@pytest.mark.parametrize("what", list(Erasable))
def test_only_what_was_asked_for_is_erased_and_comes_back_when_it_is_put_back(
    what: Erasable,
) -> None:
    point_map = mapped(picture(BOX, MARK))
    before, points = occupied(point_map), in_order(point_map.points)
    assert min(before) > 0
    version = point_map.version
    erased = point_map.edits.erase(EVERYWHERE, what.class_ids)
    assert point_map.version > version
    assert occupied(point_map) == (
        before[0] if what is Erasable.BEWARE else 0,
        before[1] if what is Erasable.GEOMETRY else 0,
    )
    point_map.edits.put_back(erased)
    assert occupied(point_map) == before
    assert in_order(point_map.points) == points


def test_only_the_area_is_erased() -> None:
    point_map = mapped(picture(BOX, MARK))
    kept = layer_grid(point_map, RED_LIST, ())
    area = cells_of(1.0, 0.0, 1.7, 1.0)
    point_map.edits.erase(area, Erasable.BOTH.class_ids)
    now = layer_grid(point_map, RED_LIST, ())
    for before, after in (
        (kept.geometric, now.geometric),
        (kept.beware[RED_ID], now.beware[RED_ID]),
    ):
        expected = before.copy().reshape(-1)
        expected[area] = False
        np.testing.assert_array_equal(after.reshape(-1), expected)


def test_what_the_camera_sees_again_comes_back_and_what_is_gone_does_not() -> None:
    point_map = mapped(picture(BOX, MARK))
    before = occupied(point_map)
    point_map.edits.erase(EVERYWHERE, Erasable.BOTH.class_ids)
    look(point_map, picture(BOX))
    assert occupied(point_map) == (before[0], 0)


def test_erased_points_that_are_put_back_are_where_their_pose_is_now() -> None:
    frame = picture(BOX, MARK)
    moved = {0: Pose2(x_m=0.5, y_m=-0.3, yaw_rad=0.2)}
    corrected = mapped(frame)
    corrected.correct(moved)
    erased_before = mapped(frame)
    erased = erased_before.edits.erase(EVERYWHERE, Erasable.BOTH.class_ids)
    erased_before.correct(moved)
    assert occupied(erased_before) == (0, 0)
    erased_before.edits.put_back(erased)
    assert in_order(erased_before.points) == in_order(corrected.points)
    assert_same(layers(erased_before, RED_LIST), layers(corrected, RED_LIST))


def test_a_correction_under_way_does_not_bring_erased_points_back() -> None:
    point_map = mapped(picture(BOX, MARK))
    prepared = prepare(point_map.snapshot(), {0: Pose2(x_m=0.2, y_m=0.0, yaw_rad=0.0)})
    point_map.edits.erase(EVERYWHERE, Erasable.BOTH.class_ids)
    assert point_map.apply(prepared)
    assert occupied(point_map) == (0, 0)


def test_erased_points_stay_erased_in_the_map_file_and_when_the_map_grows(
    tmp_path: Path,
) -> None:
    point_map = mapped(picture(BOX, MARK))
    erased = point_map.edits.erase(EVERYWHERE, Erasable.GEOMETRY.class_ids)
    before = occupied(point_map)
    save(tmp_path / "map", point_map.state(), {})
    again = PointMap(SPEC, MappingConfig())
    again.restore(load(tmp_path / "map").state)
    assert occupied(again) == before
    growth = growth_to(SPEC, (-1, -1, SPEC.rows + 1, SPEC.cols + 1))
    assert growth is not None
    point_map.grow(growth)
    assert occupied(point_map) == before
    point_map.edits.put_back(erased)
    assert occupied(point_map) == occupied(mapped(picture(BOX, MARK)))


def test_the_prior_map_is_erased_as_geometry_for_good_and_can_be_put_back() -> None:
    point_map = PointMap(SPEC, MappingConfig())
    prior = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    prior[20:30, 20:30] = True
    point_map.load_prior(prior)
    look(point_map, picture())
    assert point_map.edits.erase(EVERYWHERE, Erasable.BEWARE.class_ids).cells == 0
    erased = point_map.edits.erase(EVERYWHERE, Erasable.GEOMETRY.class_ids)
    assert erased.cells == 100
    assert occupied(point_map) == (0, 0)
    point_map.correct({0: Pose2(x_m=0.2, y_m=0.0, yaw_rad=0.0)})  # this derives the prior map again
    assert occupied(point_map) == (0, 0)
    point_map.edits.put_back(erased)
    assert occupied(point_map) == (100, 0)


def test_a_cell_of_the_prior_map_whose_floor_was_seen_does_not_come_back() -> None:
    point_map = PointMap(SPEC, MappingConfig())
    prior = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    prior[SPEC.cell(1.5, 0.0)] = prior[20, 20] = True
    point_map.load_prior(prior)
    erased = point_map.edits.erase(EVERYWHERE, Erasable.GEOMETRY.class_ids)
    look(point_map, picture())
    point_map.edits.put_back(erased)
    assert occupied(point_map) == (1, 0)


def test_a_correction_under_way_does_not_bring_an_erased_prior_map_back() -> None:
    point_map = PointMap(SPEC, MappingConfig())
    prior = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    prior[20, 20] = True
    point_map.load_prior(prior)
    look(point_map, picture())
    prepared = prepare(point_map.snapshot(), {0: Pose2(x_m=0.2, y_m=0.0, yaw_rad=0.0)})
    point_map.edits.erase(EVERYWHERE, Erasable.GEOMETRY.class_ids)
    assert not point_map.apply(prepared)
    assert occupied(point_map) == (0, 0)


@pytest.mark.parametrize("cell", [-1, SPEC.rows * SPEC.cols])
def test_a_cell_beside_the_grid_is_refused(cell: int) -> None:
    point_map = mapped(picture(BOX))
    before = in_order(point_map.points)
    with pytest.raises(ValueError, match="not all on the grid"):
        point_map.edits.erase(np.array([0, cell]), Erasable.BOTH.class_ids)
    assert in_order(point_map.points) == before


@law(25)
@given(st.integers(0, 2**32 - 1))
def test_the_map_after_looks_erasures_and_corrections_equals_that_of_its_points(seed: int) -> None:
    rng, cloud, erased = np.random.default_rng(seed), PointMap(SMALL, MappingConfig()), []
    for _ in range(10):
        step = rng.integers(4)
        if step == 0:
            cells = np.flatnonzero(rng.random(SMALL.rows * SMALL.cols) < 0.3)
            erased.append(cloud.edits.erase(cells, list(Erasable)[rng.integers(3)].class_ids))
        elif step == 1 and erased:
            cloud.edits.put_back(erased.pop())
        elif step == 2 and len(cloud.poses):
            moved = Pose2(x_m=rng.normal(0, 0.3), y_m=0.0, yaw_rad=rng.normal(0, 0.2))
            cloud.correct({int(rng.integers(len(cloud.poses))): moved})
        else:
            frame, observation = random_step(rng, confident=False)
            cloud.insert(observation, frame)
        assert_same(layers(cloud, ALL), rebuilt(cloud, ALL))
