"""Explored cells of frozen poses: they are kept as those of the grid, and the map is the same as
with a submap for each pose."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.geometry.transform import Pose2
from navcore.grid.cell_mask import CellMask
from navcore.grid.growth import growth_into
from navcore.mapping.correction import prepare
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage.map_file import load, save
from navcore.mapping.storage.map_state import MapState
from tests.navcore.laws import law
from tests.navcore.mapping.storage.test_map_file import assert_same
from tests.navcore.mapping.test_correction import assert_same_maps, explored, moved, new_map, step
from tests.navcore.mapping.test_map_growth import WIDE, WIDER
from tests.navcore.mapping.test_map_growth import step as wide_step

FAR = st.sampled_from([0.02, 1.0, 6.0])


def session_poses(cloud: PointMap, rng: np.random.Generator, far: float) -> dict[int, Pose2]:
    """Return random poses for some IDs of those that are not frozen."""
    chosen = moved(cloud, rng, far)
    return {pose_id: pose for pose_id, pose in chosen.items() if pose_id >= cloud.pose_ids.frozen}


def by_pose(cloud: PointMap) -> MapState:
    """Return the state of a map as older programs stored it: a submap for each pose ID."""
    spec = cloud.spec
    none = CellMask.empty(spec.rows, spec.cols)
    state = cloud.state()
    return dataclasses.replace(
        state,
        measured=none,
        visible=none,
        driven=none,
        volume=np.zeros_like(state.volume),
        submaps=cloud.explored.submaps.values(),
    )


@law(25)
@given(st.integers(0, 2**32 - 1), st.booleans(), FAR)
def test_corrections_in_a_loaded_map_make_the_map_of_all_poses_own_cells(
    tmp_path_factory: pytest.TempPathFactory, seed: int, prior: bool, far: float
) -> None:
    path, rng = tmp_path_factory.getbasetemp() / "folded", np.random.default_rng(seed)
    whole, loaded = new_map(prior=prior), new_map()
    for number in range(4):
        step(whole, seed + number)
    save(path, whole.state(), {1: "first", 2: "second"})
    loaded.restore(load(path).state)
    for number in range(4, 8):
        step(whole, seed + number)
        step(loaded, seed + number)
        poses = session_poses(loaded, rng, far)
        whole.correct(poses)
        loaded.correct(poses)
    assert not loaded.explored.submaps.values().keys() & set(range(loaded.pose_ids.frozen))
    for mine, theirs in zip(
        [*whole.explored.live.planes[:3], whole.explored.live.volume],
        [*loaded.explored.live.planes[:3], loaded.explored.live.volume],
        strict=True,
    ):
        np.testing.assert_array_equal(mine, theirs)
    assert_same(whole.state(), loaded.state())


@law(25)
@given(st.integers(0, 2**32 - 1), st.booleans(), FAR)
def test_a_file_with_a_submap_for_each_pose_is_the_same_map(
    tmp_path_factory: pytest.TempPathFactory, seed: int, prior: bool, far: float
) -> None:
    folder, rng, cloud = tmp_path_factory.getbasetemp(), np.random.default_rng(seed), new_map()
    if prior:
        cloud = new_map(prior=True)
    for number in range(4):
        step(cloud, seed + number)
    cloud.correct(moved(cloud, rng, far))
    save(folder / "old", by_pose(cloud), {1: "first", 2: "second"})
    save(folder / "new", cloud.state(), {1: "first", 2: "second"})
    old, new = new_map(), new_map()
    old.restore(load(folder / "old").state)
    new.restore(load(folder / "new").state)
    for number in range(4, 7):
        assert_same(old.state(), new.state())
        for mine, theirs in zip(explored(old), explored(new), strict=True):
            np.testing.assert_array_equal(mine, theirs)
        poses = session_poses(old, rng, far)
        for both in (old, new):
            both.correct(poses)
            step(both, seed + number)


@law(15)
@given(st.integers(0, 2**32 - 1))
def test_what_lay_beside_the_grid_when_the_map_was_stored_comes_back_when_it_grows(
    seed: int,
) -> None:
    small, large = PointMap(WIDE, MappingConfig()), PointMap(WIDER, MappingConfig())
    for cloud in (small, large):
        for number in range(4):
            wide_step(cloud, seed + number)
        out = {number: Pose2(x_m=-8.0, y_m=2.0 + number, yaw_rad=0.7) for number in range(2)}
        cloud.correct({number: at for number, at in out.items() if number < len(cloud.poses)})
        cloud.restore(cloud.state())
    growth = growth_into(WIDE, WIDER)
    assert growth is not None
    kept = set(small.explored.submaps.values())
    assert kept and kept <= {0, 1}
    small.grow(growth)
    assert_same(small.state(), large.state())
    small.restore(small.state())
    assert not small.explored.submaps.values()
    assert_same(small.state(), large.state())


@law(20)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_frames_at_frozen_poses_while_a_correction_is_prepared_are_on_the_map(
    seed: int, prior: bool
) -> None:
    rng, first = np.random.default_rng(seed), new_map(prior=prior)
    for number in range(3):
        step(first, seed + number)
    early, late = new_map(), new_map()
    for cloud in (early, late):
        cloud.restore(first.state())
        step(cloud, seed + 3)
    poses = session_poses(early, rng, 1.0)
    snapshot = early.snapshot()
    kept = snapshot.base.planes.copy()
    for number in (0, 1, 4):  # the first two are looks from poses of the loaded map
        for cloud in (early, late):
            step(cloud, seed + number)
    np.testing.assert_array_equal(snapshot.base.planes, kept)
    assert early.apply(prepare(snapshot, poses))
    late.correct(poses)
    assert_same_maps(early, late)


def test_driving_in_a_loaded_map_adds_no_submap_for_its_poses(tmp_path: Path) -> None:
    first, loaded = new_map(), new_map()
    for number in range(6):
        step(first, number)
    save(tmp_path / "m", first.state(), {1: "first", 2: "second"})
    stored = load(tmp_path / "m").state
    assert not stored.submaps
    loaded.restore(stored)
    for number in range(6):
        step(loaded, number)
    assert len(loaded.poses) == len(first.poses)
    assert loaded.explored.submaps.bytes_used == 0
    assert loaded.explored.area_m2 == first.explored.area_m2
