"""Terrain: slopes and steps are what they are, whatever the order of looks and corrections."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig, TerrainConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.costmap.live_costmap import LiveCostmap
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.grid.growth import growth_to
from navcore.mapping.point_map import PointMap
from navcore.mapping.terrain.looks import TerrainLooks, terrain_looks
from navcore.mapping.terrain.terrain_map import TerrainMap
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.perception.ground import flat_ground, ground_heights
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.laws import law
from tests.navcore.perception.test_ground import ramp, seen
from tests.navcore.scene import ORIGIN

SPEC = GridSpec.centred(size_m=(12.8, 12.8), resolution_m=0.05)
RULES, CELL_M = TerrainConfig(min_looks=1), 0.1
CONFIG = MappingConfig(terrain=RULES)
OBJECT_M = ObservationConfig().obstacle_height_m
NO_CLASSES = BewareList(classes=())


def looks_at(frame: Frame) -> TerrainLooks:
    ground_m = ground_heights(frame, ObservationConfig().max_slope)
    return terrain_looks(frame, ground_m, OBJECT_M, RULES, CELL_M)


def new_map() -> PointMap:
    return PointMap(SPEC, CONFIG)


@cache
def with_kerb(height_m: float) -> Frame:
    return seen(lambda x, y: np.where((x > 1.8) & (x < 2.1), height_m, 0.0))


def looked(point_map: PointMap, frame: Frame) -> None:
    """Let the terrain see a frame from a pose ID of its own."""
    point_map.terrain.add(looks_at(frame), point_map.pose_ids.id_of(frame.pose))


def random_looks(rng: np.random.Generator) -> tuple[TerrainLooks, Pose2]:
    cells = np.unique(rng.integers(-30, 30, size=(40, 2)), axis=0)
    values = np.column_stack(
        [np.ones(len(cells)), *rng.normal(0.0, 0.2, (2, len(cells))), rng.random(len(cells)) / 1e3]
    )
    steps = rng.integers(0, 2, len(cells))
    values = np.column_stack([values, steps, steps * rng.random(len(cells)) * 0.12])
    pose = Pose2(x_m=rng.uniform(-2, 2), y_m=rng.uniform(-2, 2), yaw_rad=rng.uniform(-3, 3))
    return TerrainLooks(cells, values), pose


def at_many_places(terrain: TerrainMap) -> list[tuple[float, float, float] | None]:
    steps = np.arange(-3.0, 3.0, 0.1) + 0.05
    return [terrain.ground(float(x), float(y)) for x in steps for y in steps]


def assert_same_ground(one: TerrainMap, other: TerrainMap) -> None:
    pairs = list(zip(at_many_places(one), at_many_places(other), strict=True))
    assert any(ground is not None for ground, _ in pairs)
    for ground, same in pairs:
        assert (ground is None) == (same is None)
        assert ground is None or ground == pytest.approx(same, abs=1e-5)
    assert (one.bools == other.bools).all()


@pytest.fixture(scope="module")
def flat() -> Frame:
    return seen(lambda x, y: 0 * x)


@pytest.mark.parametrize("slope", [0.0, 0.05, 0.15, -0.1])
@pytest.mark.parametrize("yaw_rad", [0.0, 2.0])
def test_the_slope_of_a_plane_is_its_slope_whatever_the_heading(
    flat: Frame, slope: float, yaw_rad: float
) -> None:
    pose = Pose2(x_m=0.3, y_m=-0.2, yaw_rad=yaw_rad)
    looks = looks_at(dataclasses.replace(flat, pose=pose, pitch_rad=-math.atan(slope)))
    uphill = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
    assert len(looks.cells) > 100
    assert np.abs(looks.values[:, 1:3] - slope * uphill).max() < 0.01
    assert np.sqrt(looks.values[:, 3]).max() < 0.003


def test_a_ramp_within_the_limit_is_ground_and_a_steeper_one_an_obstacle() -> None:
    for slope, is_beyond in ((0.17, False), (0.24, True)):
        terrain = new_map()
        looked(terrain, seen(ramp(slope)))
        ground = terrain.terrain.ground(2.05, 0.05)
        assert ground is not None and ground[0] == pytest.approx(slope, abs=0.02)
        assert terrain.terrain.bools.any() == is_beyond


def test_a_kerb_is_an_obstacle_where_it_is_higher_than_the_robot_takes() -> None:
    for height_m, is_beyond in ((0.03, False), (0.08, True)):
        terrain = new_map()
        looked(terrain, with_kerb(height_m))
        beyond = SPEC.centres(np.argwhere(terrain.terrain.bools))
        assert (len(beyond) > 0) == is_beyond
        assert not is_beyond or (np.abs(beyond[:, 0] - 1.85) < 0.35).all()


@given(st.integers(0, 2**32 - 1))
@law(20)
def test_the_order_of_looks_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    looks = [random_looks(rng) for _ in range(5)]
    maps = []
    for order in (range(5), reversed(range(5))):
        point_map = new_map()
        ids = {k: point_map.pose_ids.id_of(looks[k][1]) for k in range(5)}
        for k in order:
            point_map.terrain.add(looks[k][0], ids[k])
        maps.append(point_map.terrain)
    assert_same_ground(*maps)


@given(st.integers(0, 2**32 - 1))
@law(20)
def test_corrections_to_and_fro_lose_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corrected, untouched = new_map(), new_map()
    for _ in range(4):
        looks, pose = random_looks(rng)
        for point_map in (corrected, untouched):
            point_map.terrain.add(looks, point_map.pose_ids.id_of(pose))
    poses = dict(enumerate(corrected.poses))
    corrected.correct(
        {
            pose_id: Pose2(x_m=pose.x_m + 0.7, y_m=pose.y_m - 0.4, yaw_rad=pose.yaw_rad + 1.0)
            for pose_id, pose in poses.items()
        }
    )
    corrected.correct(poses)
    assert_same_ground(corrected.terrain, untouched.terrain)


def test_a_correction_moves_and_turns_what_was_seen_from_a_pose() -> None:
    point_map = new_map()
    looked(point_map, with_kerb(0.08))
    before = SPEC.centres(np.argwhere(point_map.terrain.bools))
    turned = Pose2(x_m=0.5, y_m=0.2, yaw_rad=math.pi / 2)
    point_map.correct({0: turned})
    after = SPEC.centres(np.argwhere(point_map.terrain.bools))
    assert len(after) == len(before) > 0
    assert np.abs(np.sort(turned.to_parent(before), axis=0) - np.sort(after, axis=0)).max() < 0.11
    # A further look from the moved pose is added to what the pose has seen.
    looked(point_map, dataclasses.replace(with_kerb(0.08), pose=turned))
    assert len(np.argwhere(point_map.terrain.bools)) == pytest.approx(len(before), rel=0.3)


def test_the_costmap_follows_the_terrain_as_it_grows_and_is_corrected() -> None:
    point_map = new_map()
    live = LiveCostmap(point_map, vehicle_width_m=0.7, safety_margin_m=0.1)
    assert not live.follow(NO_CLASSES, ()).grid.geometric.any()
    looked(point_map, with_kerb(0.08))
    for corrected in (False, True):
        if corrected:
            point_map.correct({0: Pose2(x_m=1.0, y_m=0.0, yaw_rad=1.0)})
        costmap = live.follow(NO_CLASSES, ())
        expected = layer_grid(point_map, NO_CLASSES, ())
        assert costmap.grid.geometric.any()
        assert (costmap.grid.geometric == expected.geometric).all()
        rebuilt = LiveCostmap(point_map, vehicle_width_m=0.7, safety_margin_m=0.1)
        assert (rebuilt.follow(NO_CLASSES, ()).blocked == costmap.blocked).all()
        live = rebuilt
    growth = growth_to(SPEC, (-10, -10, SPEC.rows, SPEC.cols))
    assert growth is not None
    cells = len(np.argwhere(point_map.terrain.bools))
    point_map.grow(growth)
    live.grow(growth)
    assert len(np.argwhere(point_map.terrain.bools)) == cells
    assert live.follow(NO_CLASSES, ()).grid.geometric.sum() == cells


def test_a_false_step_is_erased_and_comes_back_with_the_undo_where_a_correction_has_it() -> None:
    point_map = new_map()
    live = LiveCostmap(point_map, vehicle_width_m=0.7, safety_margin_m=0.1)
    looked(point_map, with_kerb(0.08))
    kerb = np.flatnonzero(point_map.terrain.bools)
    assert live.follow(NO_CLASSES, ()).grid.geometric.sum() == len(kerb) > 0
    left = kerb[SPEC.centres(np.column_stack(np.divmod(kerb, SPEC.cols)))[:, 1] > 0.0]
    erased = point_map.edits.erase(left, [NOTHING])
    assert erased.cells == len(left) < len(kerb)
    assert not point_map.terrain.bools.ravel()[left].any()
    assert live.follow(NO_CLASSES, ()).grid.geometric.sum() == point_map.terrain.bools.sum() > 0
    point_map.correct({0: Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0)})
    point_map.edits.put_back(erased)
    assert point_map.terrain.bools.sum() == pytest.approx(len(kerb), rel=0.05)
    # What is seen again after it was erased is there again.
    point_map.edits.erase(np.flatnonzero(point_map.terrain.bools), [NOTHING])
    assert not point_map.terrain.bools.any()
    looked(point_map, dataclasses.replace(with_kerb(0.08), pose=point_map.pose_ids[0]))
    assert point_map.terrain.bools.any()


def test_a_robot_that_stands_adds_no_looks(flat: Frame) -> None:
    terrain, ground_m = new_map().terrain, flat_ground(flat.intrinsics.width)
    terrain.observe(flat, ground_m, OBJECT_M)
    held = terrain.memory_mb, at_many_places(terrain)
    terrain.observe(flat, ground_m, OBJECT_M)
    assert held == (terrain.memory_mb, at_many_places(terrain))


def test_switched_off_it_sees_nothing() -> None:
    """Control: what makes a kerb an obstacle is this layer."""
    frame = with_kerb(0.08)
    ground_m = ground_heights(frame, ObservationConfig().max_slope)
    for enabled in (True, False):
        config = dataclasses.replace(CONFIG, terrain=dataclasses.replace(RULES, enabled=enabled))
        terrain = PointMap(SPEC, config, HUSKY).terrain
        terrain._pose_ids.id_of(ORIGIN)
        assert terrain.observe(frame, ground_m, OBJECT_M) == enabled


@pytest.mark.parametrize("cells_off", [0.0, 0.25, 0.5])
@pytest.mark.parametrize("resolution_m", [0.05, 0.1])
def test_steep_ground_is_all_blocked_wherever_the_origin_of_the_grid_lies_in_a_cell(
    cells_off: float, resolution_m: float
) -> None:
    origin_m, side = -10.0 + cells_off * resolution_m, round(20.0 / resolution_m)
    spec = GridSpec(
        resolution_m=resolution_m,
        rows=side,
        cols=side,
        origin_x_m=origin_m,
        origin_y_m=origin_m,
    )
    point_map = PointMap(spec, CONFIG)
    terrain, pose_id = point_map.terrain, point_map.pose_ids.id_of(ORIGIN)
    cells = np.argwhere(np.ones((30, 30))) + 3
    values = np.tile([1.0, 1.0, 0.0, 0.0, 0.0, 0.0], (len(cells), 1))
    assert terrain.add(TerrainLooks(cells, values), pose_id)
    rows, cols = np.nonzero(terrain.bools)
    assert len(rows) == (3.0 / resolution_m) ** 2 == (np.ptp(rows) + 1) * (np.ptp(cols) + 1)
    assert origin_m + resolution_m * rows.min() == pytest.approx(0.3, abs=resolution_m / 2 + 1e-9)
