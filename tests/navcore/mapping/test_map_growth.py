"""Growing commutes with mapping: a map that has grown is the map made on the larger grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.grid.growth import Growth, growth_into
from navcore.mapping.correction import prepare
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage.map_file import load, save
from navcore.mapping.views.extent import measured_bounds
from navcore.mapping.views.observation import observe
from navcore.mapping.views.voxels import frustum_box
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import ALL, random_frame
from tests.navcore.mapping.storage.test_map_file import assert_same
from tests.navcore.mapping.storage.test_map_state import assert_same_grids

WIDE = GridSpec.centred(size_m=(14.0, 14.2), resolution_m=0.1)
WIDER = WIDE.part(-256, -512, WIDE.rows + 256, WIDE.cols)
RULES = ObservationConfig(min_support=1)


def growth() -> Growth:
    found = growth_into(WIDE, WIDER)
    assert found is not None
    return found


def step(cloud: PointMap, seed: int) -> None:
    rng = np.random.default_rng(seed)
    frame, labels = random_frame(rng, confident=False)
    cloud.insert(observe(frame, labels, ALL, cloud.spec, RULES), frame, labels)
    cloud.explored.integrate_rays(frame, RULES)
    outline = rng.normal(size=2) + np.array([[0.0, 0.0], [0.5, 0.1], [0.2, 0.6]])
    cloud.explored.mark_driven(outline, frame.pose)


@law(20)
@given(st.integers(0, 2**32 - 1), st.integers(0, 5), st.integers(0, 4))
def test_growing_between_two_frames_makes_the_map_of_the_larger_grid(
    seed: int, before: int, after: int
) -> None:
    grown, large = PointMap(WIDE, MappingConfig()), PointMap(WIDER, MappingConfig())
    prior = np.random.default_rng(seed).random((WIDE.rows, WIDE.cols)) < 0.02
    grown.load_prior(prior)
    whole = np.zeros((WIDER.rows, WIDER.cols), dtype=np.bool_)
    whole[256 : 256 + WIDE.rows, 512:] = prior
    large.load_prior(whole)
    for number in range(before):
        step(grown, seed + number)
        step(large, seed + number)
    version = grown.version
    grown.grow(growth())
    assert grown.version > version and grown.layers.take_changes() is None
    assert grown.spec == WIDER
    for number in range(before, before + after):
        step(grown, seed + number)
        step(large, seed + number)
    assert_same(grown.state(), large.state())
    assert_same_grids(grown, large)


@law(10)
@given(st.integers(0, 2**32 - 1))
def test_a_stored_map_is_restored_with_its_grid_and_grows_on(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "grown"
    small, large, restored = (PointMap(spec, MappingConfig()) for spec in (WIDE, WIDER, WIDER))
    for number in range(3):
        step(small, seed + number)
        step(large, seed + number)
    save(path, small.state(), {1: "first", 2: "second"})
    restored.restore(load(path).state)
    assert restored.spec == WIDE
    assert_same(restored.state(), small.state())
    restored.grow(growth())
    assert_same(restored.state(), large.state())
    assert_same_grids(restored, large)


@law(15)
@given(st.integers(0, 2**32 - 1))
def test_what_a_correction_has_moved_beside_the_grid_comes_back_when_the_grid_grows(
    seed: int,
) -> None:
    small, large = PointMap(WIDE, MappingConfig()), PointMap(WIDER, MappingConfig())
    for cloud in (small, large):
        for number in range(4):
            step(cloud, seed + number)
    out = {number: Pose2(x_m=-8.0, y_m=2.0 + number, yaw_rad=0.7) for number in range(2)}
    known = {number: pose for number, pose in out.items() if number < len(small.poses)}
    prepared = prepare(small.snapshot(), known)
    small.correct(known)
    large.correct(known)
    count = small.explored.area_m2
    small.grow(growth())
    assert not small.apply(prepared)
    assert_same(small.state(), large.state())
    assert_same_grids(small, large)
    assert small.explored.area_m2 >= count


@law(40)
@given(st.integers(0, 2**32 - 1))
def test_the_measured_bounds_contain_every_point_of_the_map(seed: int) -> None:
    rng, cloud = np.random.default_rng(seed), PointMap(WIDE, MappingConfig())
    frame, labels = random_frame(rng, confident=False)
    seen = observe(frame, labels, ALL, cloud.spec, RULES)
    lens = frame.intrinsics.pinhole
    left, bottom, right, top = measured_bounds(
        frame.depth_m, frame.T_map_camera, lens, RULES.max_range_m
    )
    x, y = seen.points_map[:, 0], seen.points_map[:, 1]
    assert (x >= left - 1e-5).all() and (x <= right + 1e-5).all()
    assert (y >= bottom - 1e-5).all() and (y <= top + 1e-5).all()
    if np.isfinite(left):
        cells = [WIDE.cell(left, bottom), WIDE.cell(right, top)]
        box = frustum_box(frame, WIDE, RULES.max_range_m)
        assert box[0] <= cells[0][0] and cells[1][1] <= box[3]
