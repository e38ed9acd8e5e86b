"""A restored map continues as if the program had never ended."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.errors import BadConfiguration
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage.map_file import load, save
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import ALL, SMALL, SURE, random_step
from tests.navcore.mapping.storage.test_map_file import assert_same


def step(cloud: PointMap, seed: int) -> None:
    rng = np.random.default_rng(seed)
    frame, observation = random_step(rng, confident=False)
    cloud.insert(observation, frame)
    cloud.explored.integrate_rays(frame, ObservationConfig(min_support=1))
    cloud.explored.mark_driven(
        rng.normal(size=2) + np.array([[0.0, 0.0], [0.5, 0.1], [0.2, 0.6]]), frame.pose
    )


def prior() -> BoolGrid:
    return np.random.default_rng(0).random((SMALL.rows, SMALL.cols)) < 0.05


def assert_same_grids(first: PointMap, second: PointMap) -> None:
    for beware in (ALL, SURE):
        one, other = layer_grid(first, beware, ()), layer_grid(second, beware, ())
        np.testing.assert_array_equal(one.geometric, other.geometric)
        assert one.beware.keys() == other.beware.keys()
        for class_id, layer in one.beware.items():
            np.testing.assert_array_equal(layer, other.beware[class_id])
    assert first.poses == second.poses
    assert first.explored.area_m2 == second.explored.area_m2
    assert first.explored.volume_m3 == second.explored.volume_m3


@law(20)
@given(st.integers(0, 2**32 - 1), st.integers(0, 6), st.integers(0, 4))
def test_a_drive_interrupted_by_saving_and_loading_makes_the_same_map_as_one_without(
    tmp_path_factory: pytest.TempPathFactory, seed: int, before: int, after: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "kept"
    without, first, second = (PointMap(SMALL, MappingConfig()) for _ in range(3))
    for cloud in (without, first):
        cloud.load_prior(prior())
        for number in range(before):
            step(cloud, seed + number)
    save(path, first.state(), {1: "first", 2: "second"})
    step(second, seed + 99)  # what it knew before is forgotten
    version = second.version
    second.restore(load(path).state)
    assert second.version > version
    assert_same(without.state(), second.state())
    assert_same_grids(without, second)
    for cloud in (without, second):
        for number in range(before, before + after):
            step(cloud, seed + number)
    assert_same(without.state(), second.state())
    assert_same_grids(without, second)


def test_a_state_is_a_snapshot_that_later_frames_do_not_change() -> None:
    cloud, again = PointMap(SMALL, MappingConfig()), PointMap(SMALL, MappingConfig())
    for seed in (1, 2):
        step(cloud, seed)
    state = cloud.state()
    again.restore(state)
    for seed in (3, 4):
        step(cloud, seed)
        step(again, seed)
    third = PointMap(SMALL, MappingConfig())
    third.restore(state)
    for seed in (3, 4):
        step(third, seed)
    assert_same(cloud.state(), third.state())
    assert_same(again.state(), third.state())


def test_a_map_with_cells_of_another_size_is_refused_and_nothing_is_lost(tmp_path: Path) -> None:
    cloud, other = (
        PointMap(SMALL, MappingConfig()),
        PointMap(GridSpec.centred(size_m=(6.0, 6.0), resolution_m=0.2), MappingConfig()),
    )
    step(cloud, 1)
    save(tmp_path / "m", cloud.state(), {})
    with pytest.raises(
        BadConfiguration, match=r"the stored map .* in cells of 0\.1 m, this one .* of 0\.2 m"
    ):
        other.restore(load(tmp_path / "m").state)
    assert other.version == 0
