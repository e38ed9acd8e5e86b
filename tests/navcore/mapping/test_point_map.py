"""Point map: incremental equals rebuilt; points are replaced, cleared and kept."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.errors import BadConfiguration
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.observation import Observation, observe
from navcore.mapping.views.voxels import BIN_M, LOWEST_M
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.mission.zone import Zone
from navcore.mission.zone_cells import rasterise
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from tests.navcore.laws import law
from tests.navcore.scene import (
    MOUNT,
    ORIGIN,
    RED_FLOOR,
    RED_ID,
    RED_LIST,
    SPEC,
    Box,
    Paint,
    picture,
)

SMALL = GridSpec.centred(size_m=(6.0, 6.0), resolution_m=0.1)
TINY_LENS = Intrinsics(width=16, height=12, fx=8.0, fy=8.0, cx=7.5, cy=5.5)
FIRST = BewareClass(name="first", class_id=1, min_confidence=0.0)
SECOND = BewareClass(name="second", class_id=2, min_confidence=0.0)
ALL = BewareList(classes=(FIRST, SECOND))
SURE = BewareList(
    classes=(
        dataclasses.replace(FIRST, min_confidence=0.5),
        dataclasses.replace(SECOND, min_confidence=0.8),
    )
)
Layers = dict[int, BoolGrid]


def random_step(rng: np.random.Generator, *, confident: bool) -> tuple[Frame, Observation]:
    """Return a random frame from a random pose, often the pose before."""
    frame, labels = random_frame(rng, confident=confident)
    return frame, observe(frame, labels, ALL, SMALL, ObservationConfig(min_support=1))


def random_frame(rng: np.random.Generator, *, confident: bool) -> tuple[Frame, Labels]:
    """Return a random frame from a random pose, often the pose before, and random labels."""
    pose = Pose2(
        x_m=float(rng.choice([0.0, 0.1, 1.0])),
        y_m=float(rng.choice([0.0, -1.0])),
        yaw_rad=float(rng.choice([0.0, 0.05, 1.5, math.pi])),
    )
    flat = rng.random() < 0.5
    depth = np.full((12, 16), rng.uniform(0.3, 4.0)) if flat else rng.uniform(0.0, 4.0, (12, 16))
    depth[rng.random(depth.shape) < 0.1] = 0.0
    frame = Frame(
        stamp_ns=0,
        rgb=rng.integers(0, 255, (12, 16, 3), dtype=np.uint8),
        depth_m=depth.astype(np.float32),
        intrinsics=TINY_LENS,
        T_base_camera=MOUNT,
        pose=pose,
        twist=STANDSTILL,
    )
    labels = Labels(
        class_ids=rng.choice([0, 0, 1, 2], (12, 16)).astype(np.uint8),
        confidence=(np.ones((12, 16)) if confident else rng.random((12, 16))).astype(np.float32),
    )
    return frame, labels


def layers(cloud: PointMap, beware: BewareList) -> Layers:
    grid = layer_grid(cloud, beware, ())
    return {NOTHING: grid.geometric, **grid.beware}


def rebuilt(cloud: PointMap, beware: BewareList) -> Layers:
    """Return the same layers, rebuilt from the public points alone."""
    points, spec = cloud.points, cloud.spec
    xyz = points.points_map.astype(np.float64)
    low = np.array([spec.origin_x_m, spec.origin_y_m])
    size = np.array([spec.cols, spec.rows]) * spec.resolution_m
    on_grid = ((xyz[:, :2] >= low - 1e-3) & (xyz[:, :2] <= low + size + 1e-3)).all(axis=1)
    cells = np.floor((xyz[:, :2] - low) / spec.resolution_m).astype(int)
    cols, rows = np.clip(cells, 0, [spec.cols - 1, spec.rows - 1]).T
    made = {}
    for class_id, least in [
        (NOTHING, 0.0),
        *((entry.class_id, entry.min_confidence) for entry in beware.enabled),
    ]:
        mask = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
        chosen = on_grid & (points.class_ids == class_id)
        chosen &= np.greater_equal(points.confidence, np.float32(least))
        mask[rows[chosen], cols[chosen]] = True
        made[class_id] = mask
    return made


def assert_same(first: Layers, second: Layers) -> None:
    assert first.keys() == second.keys()
    for class_id, layer in first.items():
        np.testing.assert_array_equal(layer, second[class_id], err_msg=f"class {class_id}")


@law(40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_the_incremental_layers_equal_those_rebuilt_from_the_points(seed: int, steps: int) -> None:
    rng, cloud = np.random.default_rng(seed), PointMap(SMALL, MappingConfig())
    for _ in range(steps):
        frame, observation = random_step(rng, confident=False)
        cloud.insert(observation, frame)
        assert_same(layers(cloud, ALL), rebuilt(cloud, ALL))
        assert_same(layers(cloud, SURE), rebuilt(cloud, SURE))


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


def seen(
    *points: tuple[float, float, float], class_id: int = 1, confidence: float = 1.0
) -> Observation:
    """Return an observation of the given points, as if each was measured a metre away."""
    return Observation(
        points_map=np.array(points, dtype=np.float32).reshape(-1, 3),
        class_ids=np.full(len(points), class_id, dtype=np.uint8),
        confidence=np.full(len(points), confidence, dtype=np.float32),
        rgb=np.zeros((len(points), 3), dtype=np.uint8),
        range_m=np.ones(len(points), dtype=np.float32),
        max_range_m=5.0,
        spec=SMALL,
        box=(0, 0, SMALL.rows, SMALL.cols),
        cells_seen=np.empty(0, dtype=np.int64),
        heights_seen=np.empty(0, dtype=np.uint64),
    )


def test_an_observation_of_another_grid_is_refused_and_changes_nothing() -> None:
    cloud = PointMap(SMALL, MappingConfig())
    larger = dataclasses.replace(SMALL, cols=SMALL.cols + 256)
    with pytest.raises(ValueError, match="60 × 316 cells, the map has 60 × 60"):
        cloud.insert(dataclasses.replace(seen(SPOT), spec=larger), BLIND)
    assert not len(cloud.points.points_map) and not len(cloud.poses)


BLIND = dataclasses.replace(picture(), depth_m=np.zeros_like(picture().depth_m))
"""Frame that measures nothing, so that it clears nothing."""
SPOT = (2.05, 0.05, 0.0)


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


def drive(*frames: Frame, cloud: PointMap | None = None, beware: BewareList = RED_LIST) -> PointMap:
    cloud = cloud or PointMap(SPEC, MappingConfig())
    for frame in frames:
        cloud.insert(
            observe(
                frame, ColourSegmenter().segment(frame, beware), beware, SPEC, ObservationConfig()
            ),
            frame,
        )
    return cloud


TALL = Box(x=(2.0, 2.6), y=(-0.3, 0.3), z=(0.0, 0.5))
WALL = Box(x=(4.0, 4.2), y=(-3, 3), z=(0.0, 1.0))
PATCH = Paint(x=(1.6, 2.4), y=(-0.2, 0.2))


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


AWAY = tuple(Pose2(x_m=-0.6 * k, y_m=0.0, yaw_rad=2.5) for k in range(1, 5))


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


def test_what_left_while_the_robot_was_away_is_cleared_at_the_known_pose() -> None:
    cloud = drive(picture(TALL, WALL), *(picture(WALL, pose=pose) for pose in AWAY))
    drive(picture(WALL), cloud=cloud)
    assert layer_grid(cloud, RED_LIST, ()).geometric[:, : SPEC.cell(3.0, 0.0)[1]].sum() == 0


def test_at_a_known_pose_a_hidden_point_and_a_floor_marking_stay() -> None:
    cloud = drive(picture(WALL, PATCH), *(picture(pose=pose) for pose in AWAY))
    before = layer_grid(cloud, RED_LIST, ())
    drive(picture(Box(x=(1.0, 1.1), y=(-2, 2), z=(0, 2))), cloud=cloud)
    after = layer_grid(cloud, RED_LIST, ())
    assert not (before.geometric & ~after.geometric).any()
    np.testing.assert_array_equal(before.beware[RED_ID], after.beware[RED_ID])


@pytest.mark.parametrize("then", [(WALL,), ()], ids=["a wall behind", "bare floor behind"])
@pytest.mark.parametrize("yaw", [0.0, 0.2], ids=["same pose", "another pose"])
def test_what_is_seen_through_is_cleared(then: tuple[Box, ...], yaw: float) -> None:
    cloud = drive(picture(TALL))
    before, version = layer_grid(cloud, RED_LIST, ()).geometric.sum(), cloud.version
    drive(picture(*then, pose=dataclasses.replace(ORIGIN, yaw_rad=yaw)), cloud=cloud)
    left = layer_grid(cloud, RED_LIST, ()).geometric[:, : SPEC.cell(3.0, 0.0)[1]]
    assert before > 5
    assert left.sum() == 0
    assert cloud.version > version


@pytest.mark.parametrize(
    "look_away",
    [
        lambda: picture(pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi)),
        lambda: picture(Box(x=(1.0, 1.1), y=(-2, 2), z=(0, 2))),
        lambda: BLIND,
        lambda: picture(pose=Pose2(x_m=-6.0, y_m=0.0, yaw_rad=0.0)),
    ],
    ids=["behind the robot", "hidden", "nothing measured", "too far"],
)
def test_points_out_of_view_stay(look_away: Callable[[], Frame]) -> None:
    cloud = drive(picture(TALL, PATCH))
    before = layer_grid(cloud, RED_LIST, ()).occupied()
    drive(look_away(), cloud=cloud)
    assert not (before & ~layer_grid(cloud, RED_LIST, ()).occupied()).any()
    assert before.any()


def test_an_object_that_is_still_there_is_kept_while_driving_past() -> None:
    path = [Pose2(x_m=0.1 * k, y_m=0.05 * k, yaw_rad=0.02 * k) for k in range(10)]
    cloud = drive(*(picture(TALL, WALL, PATCH, pose=pose) for pose in path))
    first = layer_grid(drive(picture(TALL, PATCH)), RED_LIST, ())
    now = layer_grid(cloud, RED_LIST, ())
    assert (first.geometric & ~now.geometric).sum() <= 0.1 * first.geometric.sum()
    assert not (first.beware[RED_ID] & ~now.beware[RED_ID]).any()


def test_a_floor_marking_is_not_lost_when_its_label_flickers() -> None:
    def marked(cloud: PointMap) -> npt.NDArray[np.bool_]:
        return layer_grid(cloud, RED_LIST, ()).beware[RED_ID]

    cloud = drive(picture(PATCH))
    before = marked(cloud)
    for yaw in (0.0, 0.0, 0.1, 0.4):
        drive(picture(pose=dataclasses.replace(ORIGIN, yaw_rad=yaw)), cloud=cloud)
    assert before.sum() > 10
    np.testing.assert_array_equal(marked(cloud), before)


def test_a_beware_object_that_is_carried_away_is_cleared() -> None:
    """Control of the flicker rule: an object with a height is seen through, unlike a marking."""
    cup = BewareList(
        classes=(
            BewareClass(
                name="cup", class_id=3, colour=dataclasses.replace(RED_COLOUR, max_height_m=1.0)
            ),
        )
    )
    red_box = dataclasses.replace(TALL, colour=(220, 20, 20))
    cloud = drive(picture(red_box), beware=cup)
    assert layer_grid(cloud, cup, ()).beware[3].sum() > 5
    drive(picture(WALL), cloud=cloud, beware=cup)
    high = cloud.points.points_map[cloud.points.class_ids == 3]
    assert np.count_nonzero(np.greater(high[:, 2], 0.2)) == 0


assert RED_FLOOR.colour is not None
RED_COLOUR = RED_FLOOR.colour


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
