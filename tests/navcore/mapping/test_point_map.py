"""Point map: points are replaced, kept and thinned, and poses corrected."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.costmap.costmap import layer_grid
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.voxels import BIN_M, LOWEST_M
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import (
    ALL,
    AWAY,
    BLIND,
    PATCH,
    SMALL,
    SPOT,
    TALL,
    WALL,
    assert_same,
    drive,
    layers,
    random_step,
    rebuilt,
    seen,
)
from tests.navcore.scene import ORIGIN, RED_LIST, SPEC, Box, picture


@law(25)
@given(st.integers(0, 2**32 - 1))
def test_a_voxel_holds_at_most_one_point_of_a_class(seed: int) -> None:
    rng, cloud = np.random.default_rng(seed), PointMap(SMALL, MappingConfig())
    for _ in range(8):
        frame, observation = random_step(rng, confident=True)
        cloud.insert(observation, frame)
    points = cloud.points
    xyz = points.points_map.astype(np.float64)
    voxels = np.floor((xyz - [SMALL.origin_x_m, SMALL.origin_y_m, LOWEST_M]) / [0.1, 0.1, BIN_M])
    keys = np.column_stack([voxels, points.class_ids.astype(np.float64)])
    assert len(np.unique(keys, axis=0)) == len(keys)


def test_an_observation_of_another_grid_is_refused_and_changes_nothing() -> None:
    cloud = PointMap(SMALL, MappingConfig())
    larger = dataclasses.replace(SMALL, cols=SMALL.cols + 256)
    with pytest.raises(ValueError, match="60 × 316 cells, the map has 60 × 60"):
        cloud.insert(dataclasses.replace(seen(SPOT), spec=larger), BLIND)
    assert not len(cloud.points.points_map) and not len(cloud.poses)


def test_standing_still_does_not_grow_the_map() -> None:
    cloud = drive(picture(TALL, PATCH))
    count = len(cloud.points.class_ids)
    drive(*[picture(TALL, PATCH)] * 5, cloud=cloud)
    assert len(cloud.points.class_ids) == count
    assert set(cloud.points.pose_ids.tolist()) == {0}


def test_a_noisy_camera_that_stands_still_does_not_grow_the_map_for_ever() -> None:
    rng, counts, cloud = np.random.default_rng(5), list[int](), PointMap(SPEC, MappingConfig())
    for _ in range(30):
        frame = picture(TALL, WALL)
        noise = rng.normal(0, 0.01, frame.depth_m.shape) * frame.depth_m
        drive(
            dataclasses.replace(
                frame, depth_m=np.maximum(frame.depth_m + noise, 0).astype(np.float32)
            ),
            cloud=cloud,
        )
        counts.append(len(cloud.points.class_ids))
    assert counts[-1] < 1.3 * counts[9]


def test_the_same_pose_id_replaces_its_points_and_a_new_one_appends() -> None:
    near, far = Pose2(x_m=0.1, y_m=0.0, yaw_rad=0.05), Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.3)
    assert set(drive(picture(TALL), picture(TALL, pose=near)).points.pose_ids.tolist()) == {0}
    other = Box(x=(2.0, 2.3), y=(1.0, 1.5), z=(0.0, 0.4))
    assert set(drive(picture(TALL), picture(TALL, other, pose=far)).points.pose_ids.tolist()) == {
        0,
        1,
    }


def test_a_place_seen_again_much_later_is_the_pose_id_it_was_and_its_points_are_replaced() -> None:
    cloud = drive(picture(TALL, WALL), *(picture(WALL, pose=pose) for pose in AWAY))
    known, before = len(cloud.poses), cloud.points
    near = Pose2(x_m=0.1, y_m=0.0, yaw_rad=-0.05)
    drive(picture(TALL, WALL, pose=near), cloud=cloud)
    assert len(cloud.poses) == known
    after = cloud.points
    assert np.count_nonzero(after.pose_ids == 0) > 0.7 * np.count_nonzero(before.pose_ids == 0)
    assert len(after.pose_ids) < 1.2 * len(before.pose_ids)
    for other in range(1, known):  # what other poses measured stays theirs
        np.testing.assert_array_equal(
            after.points_map[after.pose_ids == other], before.points_map[before.pose_ids == other]
        )


def test_driving_to_and_fro_grows_neither_the_pose_ids_nor_the_points() -> None:
    path = [Pose2(x_m=0.2 * k, y_m=0.0, yaw_rad=0.0) for k in range(6)]
    path += [dataclasses.replace(pose, yaw_rad=math.pi) for pose in reversed(path)]
    cloud, sizes = PointMap(SPEC, MappingConfig()), list[tuple[int, int]]()
    for _ in range(5):
        drive(*(picture(TALL, WALL, PATCH, pose=pose) for pose in path), cloud=cloud)
        sizes.append((len(cloud.poses), len(cloud.points.class_ids)))
    assert len({poses for poses, _ in sizes}) == 1
    assert sizes[-1][1] <= 1.05 * sizes[0][1]


def test_exploring_only_grows_and_points_are_copies() -> None:
    cloud = drive(picture(TALL))
    area, volume = cloud.explored.area_m2, cloud.explored.volume_m3
    assert area == pytest.approx(float(cloud.explored.seen.bools.sum()) * 0.01)
    assert volume > 0
    drive(picture(TALL, pose=Pose2(x_m=0, y_m=0, yaw_rad=2.0)), cloud=cloud)
    assert cloud.explored.area_m2 > area
    assert cloud.explored.volume_m3 > volume
    cloud.points.points_map[:] = 0
    assert not cloud.explored.seen.bools.flags.writeable
    assert np.any(np.not_equal(cloud.points.points_map, 0))


def test_a_corrected_pose_takes_what_was_seen_from_it_along_and_nothing_else() -> None:
    cloud = drive(picture(TALL))
    cloud = drive(picture(TALL, pose=Pose2(x_m=0, y_m=0, yaw_rad=2.0)), cloud=cloud)
    before = cloud.points
    first = before.pose_ids == 0
    cloud.correct({0: Pose2(x_m=0.5, y_m=0.0, yaw_rad=0.0)})
    after = cloud.points
    moved = after.points_map[after.pose_ids == 0]
    np.testing.assert_allclose(
        np.sort(moved[:, 0]), np.sort(before.points_map[first][:, 0] + 0.5), atol=1e-5
    )
    stayed = after.points_map[after.pose_ids == 1]
    np.testing.assert_array_equal(np.sort(stayed[:, 0]), np.sort(before.points_map[~first][:, 0]))


def test_a_correction_of_an_unknown_pose_is_refused_and_moves_nothing() -> None:
    cloud = drive(picture(TALL))
    before = cloud.points.points_map
    with pytest.raises(BadConfiguration, match="pose ID 7"):
        cloud.correct({0: ORIGIN, 7: ORIGIN})
    np.testing.assert_array_equal(before, cloud.points.points_map)


def test_over_its_budget_the_map_drops_detail_but_no_obstacle() -> None:
    rng = np.random.default_rng(3)
    steps = [random_step(rng, confident=True) for _ in range(12)]
    rich, poor = PointMap(SMALL, MappingConfig()), PointMap(SMALL, MappingConfig(budget_mb=0.02))
    for frame, observation in steps:
        rich.insert(observation, frame)
        poor.insert(observation, frame)
        assert_same(layers(poor, ALL), rebuilt(poor, ALL))
    assert rich.memory_mb > 0.02
    assert 0 < poor.memory_mb < rich.memory_mb


def test_a_prior_map_is_occupied_until_the_camera_sees_its_floor_free() -> None:
    cloud = PointMap(SPEC, MappingConfig())
    prior = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    ahead, behind = SPEC.cell(1.5, 0.0), SPEC.cell(-3.0, 0.0)
    prior[ahead] = prior[behind] = True
    cloud.load_prior(prior)
    np.testing.assert_array_equal(layer_grid(cloud, RED_LIST, ()).geometric, prior)
    drive(picture(), cloud=cloud)
    now = layer_grid(cloud, RED_LIST, ()).geometric
    assert not now[ahead]
    assert now[behind]


def test_a_prior_map_of_another_size_and_a_map_that_is_too_large_are_refused() -> None:
    with pytest.raises(BadConfiguration, match="prior map: expected"):
        PointMap(SPEC, MappingConfig()).load_prior(np.zeros((3, 3), dtype=np.bool_))
    with pytest.raises(BadConfiguration, match="coarser resolution"):
        PointMap(GridSpec.centred(size_m=(2000.0, 2000.0), resolution_m=0.05), MappingConfig())
