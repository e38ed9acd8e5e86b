"""The layers of the map are those of its points, after whatever was seen or changed."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.transform import Pose2
from navcore.mapping.point_map import PointMap
from navcore.mission.zone import Zone
from navcore.mission.zone_cells import rasterise
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import (
    ALL,
    BLIND,
    PATCH,
    SMALL,
    SPOT,
    SURE,
    assert_same,
    drive,
    layers,
    random_step,
    rebuilt,
    seen,
)
from tests.navcore.scene import RED_ID, RED_LIST, SPEC, picture


@law(40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_the_incremental_layers_equal_those_rebuilt_from_the_points(seed: int, steps: int) -> None:
    rng, cloud = np.random.default_rng(seed), PointMap(SMALL, MappingConfig())
    for _ in range(steps):
        frame, observation = random_step(rng, confident=False)
        cloud.insert(observation, frame)
        assert_same(layers(cloud, ALL), rebuilt(cloud, ALL))
        assert_same(layers(cloud, SURE), rebuilt(cloud, SURE))


@law(40)
@given(st.integers(0, 2**32 - 1))
def test_the_version_grows_whenever_a_layer_changes(seed: int) -> None:
    rng, cloud = np.random.default_rng(seed), PointMap(SMALL, MappingConfig())
    for _ in range(10):
        before, version = layers(cloud, ALL), cloud.version
        frame, observation = random_step(rng, confident=True)
        cloud.insert(observation, frame)
        after = layers(cloud, ALL)
        if any((before[k] != after[k]).any() for k in after):
            assert cloud.version > version
        assert cloud.version >= version


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_the_version_grows_whenever_a_layer_of_certain_points_changes(seed: int) -> None:
    """Few points in few cells, so that a step often changes nothing but a confidence."""
    rng, cloud = np.random.default_rng(seed), PointMap(SMALL, MappingConfig())
    for _ in range(8):
        before, version = layers(cloud, SURE), cloud.version
        point = (float(rng.choice([1.05, 1.15])), 0.05, float(rng.choice([0.0, 0.12])))
        cloud.insert(
            seen(point, class_id=int(rng.integers(1, 3)), confidence=float(rng.random())), BLIND
        )
        after = layers(cloud, SURE)
        if any((before[k] != after[k]).any() for k in after):
            assert cloud.version > version


def test_the_version_grows_when_a_certain_point_joins_an_uncertain_one_in_its_cell() -> None:
    cloud = PointMap(SMALL, MappingConfig())
    cloud.insert(seen(SPOT, confidence=0.2), BLIND)
    before, version = layers(cloud, SURE)[1].sum(), cloud.version
    cloud.insert(seen((2.05, 0.05, 0.12), confidence=0.9), BLIND)
    assert (before, layers(cloud, SURE)[1].sum()) == (0, 1)
    assert cloud.version > version


def test_an_object_detected_with_low_confidence_first_and_high_later_is_an_obstacle() -> None:
    cloud = PointMap(SMALL, MappingConfig())
    cloud.insert(seen(SPOT, confidence=0.2), BLIND)
    version = cloud.version
    assert not layers(cloud, SURE)[1].any()
    cloud.insert(seen(SPOT, confidence=1.0), BLIND)
    assert layers(cloud, SURE)[1].sum() == 1
    assert cloud.version > version


def test_a_less_confident_second_detection_does_not_free_a_confident_one() -> None:
    cloud = PointMap(SMALL, MappingConfig())
    cloud.insert(seen(SPOT, confidence=1.0), BLIND)
    cloud.insert(seen(SPOT, confidence=0.2), BLIND)
    assert layers(cloud, SURE)[1].sum() == 1


def test_an_edit_of_the_least_confidence_acts_on_what_was_seen_before() -> None:
    cloud = PointMap(SMALL, MappingConfig())
    cloud.insert(seen(SPOT, confidence=0.6), BLIND)
    cloud.insert(seen((1.05, 0.05, 0.0), confidence=0.9), BLIND)
    counts = [
        int(layers(cloud, ALL.edited("first", min_confidence=least))[1].sum())
        for least in (0.0, 0.5, 0.7, 0.95, 0.3)
    ]
    assert counts == [2, 2, 1, 0, 2]


def test_switching_a_class_off_frees_its_cells_and_on_brings_them_back() -> None:
    cloud = drive(picture(PATCH))
    on, off = (
        layer_grid(cloud, RED_LIST, ()),
        layer_grid(cloud, RED_LIST.edited("red floor", enabled=False), ()),
    )
    assert on.occupied().sum() > 10
    assert off.occupied().sum() == 0
    assert RED_ID not in off.beware
    np.testing.assert_array_equal(layer_grid(cloud, RED_LIST, ()).occupied(), on.occupied())


def test_a_class_switched_on_later_counts_what_was_seen_while_it_was_off() -> None:
    off = RED_LIST.edited("red floor", enabled=False)
    late, early = drive(picture(PATCH), beware=off), drive(picture(PATCH))
    np.testing.assert_array_equal(
        layer_grid(late, RED_LIST, ()).occupied(), layer_grid(early, RED_LIST, ()).occupied()
    )


def test_only_enabled_zones_are_on_the_grid_and_those_with_a_margin_by_themselves() -> None:
    corners = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    plain = Zone(id="a", name="a", polygon=corners)
    off = dataclasses.replace(plain, id="b", enabled=False)
    wide = dataclasses.replace(plain, id="c", margin_m=0.3)
    cloud = PointMap(SPEC, MappingConfig())
    grid = layer_grid(cloud, RED_LIST, (plain, off, wide))
    np.testing.assert_array_equal(grid.zones, rasterise(corners, SPEC))
    assert [margin for margin, _ in grid.wide_zones] == [0.3]
    assert not layer_grid(cloud, RED_LIST, (off,)).zones.any()


@law(25)
@given(st.integers(0, 2**32 - 1))
def test_after_a_correction_of_poses_the_layers_equal_those_rebuilt_from_the_points(
    seed: int,
) -> None:
    rng, cloud = np.random.default_rng(seed), PointMap(SMALL, MappingConfig())
    for _ in range(6):
        frame, observation = random_step(rng, confident=False)
        cloud.insert(observation, frame)
        if rng.random() < 0.4:
            moved = {
                int(pose_id): Pose2(
                    x_m=rng.uniform(-1, 1), y_m=rng.uniform(-1, 1), yaw_rad=rng.uniform(-3, 3)
                )
                for pose_id in rng.choice(
                    len(cloud.poses), size=rng.integers(1, len(cloud.poses) + 1), replace=False
                )
            }
            cloud.correct(moved)
            assert all(cloud.poses[pose_id] == pose for pose_id, pose in moved.items())
        assert_same(layers(cloud, ALL), rebuilt(cloud, ALL))
        assert_same(layers(cloud, SURE), rebuilt(cloud, SURE))


def test_thinning_changes_no_layer() -> None:
    rng = np.random.default_rng(4)
    rich, poor = PointMap(SMALL, MappingConfig()), PointMap(SMALL, MappingConfig(budget_mb=0.01))
    # From one pose each, and nothing sees through anything: what the two hold differs by the
    # thinning alone.
    for index in range(3):
        frame, observation = random_step(rng, confident=True)
        blind = dataclasses.replace(
            frame, depth_m=np.zeros_like(frame.depth_m), pose=Pose2(x_m=index, y_m=0.0, yaw_rad=0.0)
        )
        rich.insert(observation, blind)
        poor.insert(observation, blind)
    assert poor.memory_mb < rich.memory_mb
    assert_same(layers(poor, ALL), layers(rich, ALL))
