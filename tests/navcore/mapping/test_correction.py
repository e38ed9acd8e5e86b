"""Corrections of poses: the map is always that of each pose's own points and cells, and nothing is
lost."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import unpack
from navcore.grid.grid import BoolGrid
from navcore.mapping.correction import prepare
from navcore.mapping.explored.patch import PLANES
from navcore.mapping.point_map import PointMap
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import (
    ALL,
    SMALL,
    SURE,
    assert_same,
    layers,
    random_step,
    rebuilt,
)
from tests.navcore.scene import ORIGIN


def new_map(*, prior: bool = False) -> PointMap:
    cloud = PointMap(SMALL, MappingConfig())
    if prior:
        cloud.load_prior(np.random.default_rng(0).random((SMALL.rows, SMALL.cols)) < 0.2)
    return cloud


def step(cloud: PointMap, seed: int) -> None:
    """Insert a random frame as the mapper does."""
    rng = np.random.default_rng(seed)
    frame, observation = random_step(rng, confident=False)
    outline = frame.pose.to_parent(np.array([[0.0, 0.0], [0.5, 0.1], [0.2, 0.6]]))
    cloud.explored.mark_driven(outline, frame.pose)
    cloud.insert(observation, frame)
    cloud.explored.integrate_rays(frame, ObservationConfig(min_support=1))


def moved(cloud: PointMap, rng: np.random.Generator, far: float = 1.0) -> dict[int, Pose2]:
    """Return random poses for some pose IDs; at 4 m and more, points leave the grid."""
    chosen = rng.choice(len(cloud.poses), size=rng.integers(1, len(cloud.poses) + 1), replace=False)
    return {
        int(pose_id): Pose2(
            x_m=rng.uniform(-far, far), y_m=rng.uniform(-far, far), yaw_rad=rng.uniform(-3, 3)
        )
        for pose_id in chosen
    }


def columns(cloud: PointMap) -> list[np.ndarray]:
    live = cloud._placed.table.live
    return [live[name].copy() for name in live.dtype.names or () if name != "next"]


def explored(cloud: PointMap) -> list[np.ndarray]:
    return [*cloud.explored.live.planes.copy(), cloud.explored.live.volume.copy()]


def prior_of(cloud: PointMap) -> BoolGrid:
    held = cloud.layers.prior
    return np.zeros((SMALL.rows, SMALL.cols), dtype=np.bool_) if held is None else held.bools


def assert_same_maps(one: PointMap, other: PointMap) -> None:
    """Assert that two maps are equal bit for bit: points, layers, explored space, prior."""
    assert one.poses == other.poses
    for mine, theirs in zip(
        [*columns(one), *explored(one), prior_of(one)],
        [*columns(other), *explored(other), prior_of(other)],
        strict=True,
    ):
        np.testing.assert_array_equal(mine, theirs)
    for beware in (ALL, SURE):
        assert_same(layers(one, beware), layers(other, beware))


def assert_consistent(cloud: PointMap) -> None:
    """Assert that layers and explored space are those of the points and submaps, by other
    means than those of the map."""
    if not prior_of(cloud).any():
        assert_same(layers(cloud, ALL), rebuilt(cloud, ALL))
        assert_same(layers(cloud, SURE), rebuilt(cloud, SURE))
    live = cloud._placed.table.live
    linked = 0
    for cell, first in enumerate(cloud._placed.table.first.tolist()):
        while first:
            assert live["cell"][first - 1] == cell
            linked, first = linked + 1, int(live["next"][first - 1])
    assert linked == np.count_nonzero(live["cell"] >= 0)
    for plane in range(PLANES):
        np.testing.assert_array_equal(
            unpack(cloud.explored.live.planes[plane], SMALL.rows, SMALL.cols),
            sampled_slowly(cloud, plane),
        )


def sampled_slowly(cloud: PointMap, plane: int) -> BoolGrid:
    """Return the explored cells: those whose centre lies in an explored cell of a submap."""
    grid = np.zeros((SMALL.rows, SMALL.cols), dtype=np.bool_)
    rows, cols = np.mgrid[: SMALL.rows, : SMALL.cols]
    centres = SMALL.centres(np.column_stack([rows.ravel(), cols.ravel()]))
    for pose_id, submap in cloud.explored.submaps.values().items():
        patch = submap.patch()
        back = submap.pose @ cloud.poses[pose_id].inverse()
        at = np.array([SMALL.origin_x_m, SMALL.origin_y_m])
        found = np.floor((back.to_parent(centres) - at) / SMALL.resolution_m).astype(int)
        bits = np.unpackbits(
            np.ascontiguousarray(patch.planes[plane]).view(np.uint8), axis=1, bitorder="little"
        )
        row, col = found[:, 1] - patch.top, found[:, 0] - patch.left
        within = (row >= 0) & (col >= 0) & (row < bits.shape[0]) & (col < bits.shape[1])
        grid[rows.ravel()[within], cols.ravel()[within]] |= bits[row[within], col[within]] > 0
    return grid


@law(30)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_after_any_corrections_the_map_is_that_of_each_poses_own_points_and_cells(
    seed: int, prior: bool
) -> None:
    rng, cloud = np.random.default_rng(seed), new_map(prior=prior)
    for number in range(6):
        step(cloud, seed + number)
        if rng.random() < 0.6:
            cloud.correct(moved(cloud, rng, far=float(rng.choice([0.02, 1.0, 6.0]))))
        assert_consistent(cloud)
    direct = new_map()
    direct.restore(cloud.state())
    for mine, theirs in zip(
        [*columns(cloud), *explored(cloud)[:3], explored(cloud)[-1]],
        [*columns(direct), *explored(direct)[:3], explored(direct)[-1]],
        strict=True,
    ):
        np.testing.assert_array_equal(mine, theirs)
    assert_same(layers(cloud, SURE), layers(direct, SURE))


@law(20)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_the_order_of_corrections_does_not_matter_and_those_to_and_fro_lose_nothing(
    seed: int, prior: bool
) -> None:
    rng, several, once = np.random.default_rng(seed), new_map(prior=prior), new_map(prior=prior)
    for cloud in (several, once):
        for number in range(5):
            step(cloud, seed + number)
    start = dict(enumerate(several.poses))
    for _ in range(4):
        several.correct(moved(several, rng, far=6.0))
    several.correct(start)
    assert_same_maps(several, once)
    last = moved(several, rng, far=1.0)
    several.correct(moved(several, rng, far=6.0))
    several.correct({**start, **last})
    once.correct(last)
    assert_same_maps(several, once)


def test_points_beside_the_grid_are_kept_and_come_back() -> None:
    cloud = new_map()
    step(cloud, 3)
    before, cells = len(cloud.points.class_ids), layers(cloud, ALL)
    cloud.correct({0: Pose2(x_m=50.0, y_m=0.0, yaw_rad=1.0)})
    assert len(cloud.points.class_ids) == before > 0
    assert not any(layer.any() for layer in layers(cloud, ALL).values())
    assert cloud.explored.area_m2 == 0
    cloud.correct({0: ORIGIN})
    cloud.correct({0: cloud.explored.submaps.values()[0].pose})
    assert_same(layers(cloud, ALL), cells)


@law(25)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_frames_between_preparing_and_applying_are_on_the_map_as_if_corrected_at_once(
    seed: int, prior: bool
) -> None:
    rng, early, late = np.random.default_rng(seed), new_map(prior=prior), new_map(prior=prior)
    for cloud in (early, late):
        for number in range(4):
            step(cloud, seed + number)
    poses = moved(early, rng)
    snapshot = early.snapshot()
    untouched = snapshot.records.copy()
    known = len(early.poses)
    for number in range(4, 7):  # frames enter while another thread prepares
        for cloud in (early, late):
            step(cloud, seed + number)
            cloud.forget(np.arange(0, 3600, 7, dtype=np.int64), [1])
    np.testing.assert_array_equal(untouched[: snapshot.count], snapshot.records[: snapshot.count])
    prepared = prepare(snapshot, poses)
    later = {
        pose_id: Pose2(x_m=0.3, y_m=0.1 * pose_id, yaw_rad=0.2)
        for pose_id in range(known, len(early.poses))
    }
    early.use(SURE)
    assert early.apply(prepared, later)
    late.use(SURE)
    late.correct({**poses, **later})
    assert_same_maps(early, late)
    assert_consistent(early)
    for cloud in (early, late):
        step(cloud, seed + 9)
    assert_same_maps(early, late)


@pytest.mark.parametrize(
    "meanwhile",
    [
        lambda cloud: cloud.correct({0: ORIGIN}),
        lambda cloud: cloud.restore(cloud.state()),
        lambda cloud: cloud.load_prior(np.zeros((SMALL.rows, SMALL.cols), dtype=np.bool_)),
        lambda cloud: cloud.snapshot(),
    ],
    ids=["corrected", "restored", "given a prior map", "another snapshot"],
)
def test_a_correction_of_a_map_that_was_replaced_meanwhile_is_not_applied(
    meanwhile: Callable[[PointMap], object],
) -> None:
    cloud = new_map()
    step(cloud, 3)
    prepared = prepare(cloud.snapshot(), {0: Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0)})
    meanwhile(cloud)
    poses, points = cloud.poses, cloud.points.points_map
    assert not cloud.apply(prepared)
    assert cloud.poses == poses
    np.testing.assert_array_equal(points, cloud.points.points_map)


def test_a_prepared_correction_is_applied_once() -> None:
    cloud = new_map()
    step(cloud, 3)
    prepared = prepare(cloud.snapshot(), {0: ORIGIN})
    assert cloud.apply(prepared)
    assert not cloud.apply(prepared)


def test_later_poses_must_be_later_and_known_and_otherwise_nothing_moves() -> None:
    cloud = new_map()
    step(cloud, 3)
    prepared, poses = prepare(cloud.snapshot(), {0: ORIGIN}), cloud.poses
    with pytest.raises(BadConfiguration, match="pose ID 1 is not on the map, which has 1"):
        cloud.apply(prepared, {1: ORIGIN})
    with pytest.raises(BadConfiguration, match="pose ID 0"):
        cloud.apply(prepared, {0: ORIGIN})
    assert cloud.poses == poses
    assert cloud.apply(prepared)


def test_the_costmap_layers_count_as_changed_after_a_correction() -> None:
    cloud = new_map()
    step(cloud, 3)
    cloud.layers.take_changes()
    version = cloud.version
    cloud.correct({0: Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.3)})
    assert cloud.layers.take_changes() is None
    assert cloud.version > version


def test_a_restored_map_takes_no_corrections_of_its_poses() -> None:
    cloud, again = new_map(), new_map()
    step(cloud, 3)
    again.restore(cloud.state())
    with pytest.raises(BadConfiguration, match="pose ID 0 belongs to the loaded map"):
        again.correct({0: ORIGIN})
    assert_same_maps(cloud, again)


def test_small_corrections_of_a_drive_lose_no_point() -> None:
    """Control: merging the points that meet in a voxel lost 45 % in four such corrections."""
    rng, cloud = np.random.default_rng(5), new_map()
    for number in range(8):
        step(cloud, number)
    count = len(cloud.points.class_ids)
    for _ in range(4):
        cloud.correct(
            {
                pose_id: dataclasses.replace(
                    pose, x_m=pose.x_m + rng.uniform(-0.02, 0.02), yaw_rad=pose.yaw_rad + 0.001
                )
                for pose_id, pose in enumerate(cloud.poses)
            }
        )
    assert len(cloud.points.class_ids) == count
    assert layer_grid(cloud, ALL, ()).geometric.any()


def test_a_patch_keeps_its_cells_when_it_is_turned_by_quarters() -> None:
    cloud = new_map()
    step(cloud, 3)
    before = cloud.explored.area_m2
    pose = cloud.poses[0]
    cloud.correct({0: dataclasses.replace(pose, yaw_rad=pose.yaw_rad + math.pi / 2)})
    assert 0.3 * before < cloud.explored.area_m2 < 1.1 * before
