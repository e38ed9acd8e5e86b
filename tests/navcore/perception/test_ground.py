"""Heights are measured from the ground: slopes are ground, steps and drops are not, and flat ground
is the robot's plane."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from navcore.config.perception.perception import GroundConfig, ObservationConfig
from navcore.geometry.arrays import FloatImage
from navcore.geometry.camera import pixel_rays
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.ground import cell_centres, ground_heights
from navcore.perception.ground_memory import GroundMemory
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.collision_monitor import RecentObstacles, time_to_contact
from tests.navcore.scene import LENS, MOUNT, ORIGIN, RED_LIST, SPEC, Box, picture

Floats = npt.NDArray[np.float64]
Surface = Callable[[Floats, Floats], Floats]
RULES, GROUND = ObservationConfig(), GroundConfig()
NOTHING = BewareList(classes=())
FAR_M = 12.0


def seen(surface: Surface) -> Frame:
    """Return the frame of a surface z(x, y) in the robot's plane: the depth is that of the first
    point of a ray below it."""
    rows, cols = np.mgrid[0 : LENS.height, 0 : LENS.width]
    rays, eye = pixel_rays(rows, cols, LENS) @ MOUNT[:3, :3].T, MOUNT[:3, 3]

    def above(depth: Floats) -> Floats:
        at = eye + rays * depth[..., None]
        return np.asarray(at[..., 2] - surface(at[..., 0], at[..., 1]))

    depths = np.arange(0.1, FAR_M, 0.02)
    low = np.full(rows.shape, np.nan)
    for depth in depths[::-1]:
        low = np.where(above(np.full(rows.shape, depth)) < 0, depth - 0.02, low)
    high = low + 0.02
    for _ in range(12):
        middle = (low + high) / 2
        below = above(middle) < 0
        low, high = np.where(below, low, middle), np.where(below, middle, high)
    return Frame(
        stamp_ns=0,
        rgb=np.full((*rows.shape, 3), 128, dtype=np.uint8),
        depth_m=np.nan_to_num(high, nan=0.0).astype(np.float32),
        intrinsics=LENS,
        T_base_camera=MOUNT,
        pose=ORIGIN,
        twist=STANDSTILL,
    )


def obstacles(frame: Frame, *, terrain: bool = True) -> Floats:
    """Return (N, 2) positions where the map would have an obstacle or a drop."""
    labels = ColourSegmenter().segment(frame, NOTHING)
    ground = ground_heights(frame, RULES.max_slope) if terrain else None
    return observe(frame, labels, NOTHING, SPEC, RULES, ground).points_map[:, :2].astype(np.float64)


def ramp(slope: float, from_m: float = 1.2) -> Surface:
    return lambda x, y: slope * np.maximum(x - from_m, 0.0)


def step_at(lip_m: float, height_m: float) -> Surface:
    return lambda x, y: np.where(x > lip_m, height_m, 0.0)


def hills(x: Floats, y: Floats) -> Floats:
    """Ground that leaves the robot's plane by more than 10 cm in view."""
    return np.asarray(
        0.18 * (1 - np.cos(2 * math.pi * x / 12.0))
        + 0.08 * np.sin(2 * math.pi * y / 9.0) * np.minimum(x, 1.0)
    )


@pytest.mark.parametrize("surface", [ramp(0.12), ramp(-0.12), hills])
def test_a_slope_that_the_robot_can_drive_is_ground_and_no_obstacle(surface: Surface) -> None:
    frame = seen(surface)
    assert (
        len(obstacles(frame, terrain=False)) > 50
    )  # the control: above or below the robot's plane by too much
    assert len(obstacles(frame)) == 0


@pytest.mark.parametrize("surface", [ramp(0.12), ramp(-0.12), hills])
def test_an_object_on_a_slope_is_an_obstacle_by_its_height_above_the_ground(
    surface: Surface,
) -> None:
    def with_box(height_m: float) -> Surface:
        def lifted(x: Floats, y: Floats) -> Floats:
            on = (np.abs(x - 2.6) < 0.15) & (np.abs(y) < 0.15)
            return np.asarray(surface(x, y) + height_m * on)

        return lifted

    found = obstacles(seen(with_box(0.25)))
    assert len(found) > 5
    assert np.abs(found - [2.6, 0.0]).max() < 0.25
    assert len(obstacles(seen(with_box(0.06)))) == 0


@pytest.mark.parametrize("lip_m", [1.5, 2.0])
def test_a_step_up_and_a_step_down_are_no_slopes(lip_m: float) -> None:
    for step_m in (0.17, -0.17, -0.35):
        frame = seen(step_at(lip_m, step_m))
        found = obstacles(frame)
        assert len(found) > 20
        assert found[:, 0].min() > lip_m - 0.1


def test_a_steep_slope_is_an_obstacle_from_where_it_is_as_high_as_one() -> None:
    found = obstacles(seen(ramp(0.6, from_m=1.6)))
    assert len(found) > 20
    assert 1.6 < found[:, 0].min() < 2.0


def test_flat_ground_is_exactly_the_robots_plane_with_any_objects_on_it() -> None:
    """So that nothing changes indoors, to the last bit."""
    objects = (
        Box(x=(1.8, 2.6), y=(-0.9, 0.2), z=(0.70, 0.75)),  # a table top, with floor below it
        Box(x=(2.4, 2.9), y=(0.6, 1.4), z=(0.0, 0.5)),
        Box(x=(1.2, 1.5), y=(0.1, 0.4), z=(0.0, 0.05)),  # a book
        Box(x=(3.6, 3.7), y=(-4.0, 4.0), z=(0.0, 2.4)),
    )
    frame = picture(*objects)
    assert not ground_heights(frame, RULES.max_slope).any()
    np.testing.assert_array_equal(obstacles(frame), obstacles(frame, terrain=False))
    assert not ground_heights(seen(ramp(0.12)), 0.0).any()  # and a slope of 0 asks for just that


def test_noise_of_the_depth_makes_no_hills() -> None:
    frame = picture(Box(x=(3.6, 3.7), y=(-4.0, 4.0), z=(0.0, 2.4)))
    noise = np.random.default_rng(0).normal(0.0, 0.003, frame.depth_m.shape) * frame.depth_m**2
    noisy = Frame(
        stamp_ns=0,
        rgb=frame.rgb,
        depth_m=(frame.depth_m + noise).astype(np.float32),
        intrinsics=LENS,
        T_base_camera=MOUNT,
        pose=ORIGIN,
        twist=STANDSTILL,
    )
    assert np.abs(ground_heights(noisy, RULES.max_slope)).max() < 0.02


def test_a_depth_image_of_random_values_gives_finite_heights() -> None:
    rng = np.random.default_rng(1)
    frame = picture()
    depth = rng.choice(
        np.array([np.nan, np.inf, -1.0, 0.0, 1e30, 0.3, 4.0], dtype=np.float32), frame.depth_m.shape
    )
    random_frame = Frame(
        stamp_ns=0,
        rgb=frame.rgb,
        depth_m=depth,
        intrinsics=LENS,
        T_base_camera=MOUNT,
        pose=ORIGIN,
        twist=STANDSTILL,
    )
    assert np.isfinite(ground_heights(random_frame, RULES.max_slope)).all()


def test_the_gate_stops_at_the_edge_of_a_drop_and_not_where_the_floor_below_is_seen() -> None:
    lip_m = 1.4
    below = seen(lambda x, y: np.where(x > lip_m, -0.5, 0.0))
    points = RecentObstacles().after(below, HUSKY).points
    assert len(points) > 10
    assert lip_m - 0.15 < float(np.median(points[:, 0])) < lip_m + 0.05
    ahead = Twist(v_mps=1.0, w_radps=0.0)
    assert time_to_contact(points, ahead, HUSKY) == pytest.approx(
        lip_m - HUSKY.length_m / 2, abs=0.15
    )
    assert len(RecentObstacles().after(seen(ramp(-0.12)), HUSKY).points) == 0
    points = RecentObstacles().after(seen(hills), HUSKY).points
    assert math.isinf(time_to_contact(points, ahead, HUSKY))


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.15, -0.15])
def test_paint_on_a_slope_is_as_low_as_on_flat_ground_and_a_red_object_on_it_is_not(
    slope: float,
) -> None:
    frame = seen(ramp(slope))
    red = dataclasses.replace(frame, rgb=np.full_like(frame.rgb, (220, 20, 20)))
    rule = RED_LIST.classes[0]
    measured = (frame.depth_m > 0) & (frame.depth_m < 4.0)
    labels = ColourSegmenter().segment(red, RED_LIST).class_ids
    assert (labels[measured] == rule.class_id).mean() > 0.99

    if slope < 0:
        return  # below the robot's plane all that is red counts

    def stepped(x: Floats, y: Floats) -> Floats:
        return ramp(slope)(x, y) + 0.3 * (x > 2.0)

    box = seen(stepped)
    labels = (
        ColourSegmenter()
        .segment(dataclasses.replace(box, rgb=np.full_like(box.rgb, (220, 20, 20))), RED_LIST)
        .class_ids
    )
    assert (labels[(box.depth_m > 2.2) & (box.depth_m < 4.0)] == rule.class_id).mean() < 0.05


def test_behind_a_hidden_foot_of_a_ramp_its_surface_is_ground_if_it_was_seen_before() -> None:
    frame, slopes = seen(ramp(0.15, from_m=0.2)), np.zeros_like(cell_centres())
    slopes[cell_centres()[:, 0] > 0.2] = (0.15, 0.0)

    def heights(slopes: Floats | None) -> Floats:
        ground = ground_heights(frame, RULES.max_slope, slopes=slopes)
        labels = ColourSegmenter().segment(frame, NOTHING)
        points = observe(frame, labels, NOTHING, SPEC, RULES, ground).points_map
        return np.asarray(points[points[:, 0] < 3.0, 0], dtype=np.float64)

    assert len(heights(slopes)) == 0
    # Control: without memory a surface that rises from nowhere is an obstacle.
    assert len(heights(None)) > 10


def beside(x_m: float, y_m: float, yaw_rad: float) -> Surface:
    """A ramp of 15 % along x of the world, 1.6 m wide, as it is from a pose on the floor."""
    there = Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)

    def surface(x: Floats, y: Floats) -> Floats:
        at = there.to_parent(np.column_stack([x.ravel(), y.ravel()]))
        is_ramp = (at[:, 0] > 0.0) & (abs(at[:, 1]) < 0.8)
        return np.where(is_ramp, 0.15 * at[:, 0], 0.0).reshape(x.shape)

    return surface


def views_of_a_ramp() -> list[Frame]:
    """From before its foot, and then from its side, where the foot is out of view."""
    poses = (Pose2(x_m=-1.6, y_m=-1.2, yaw_rad=0.5), Pose2(x_m=0.6, y_m=-2.4, yaw_rad=1.2))
    return [
        dataclasses.replace(seen(beside(pose.x_m, pose.y_m, pose.yaw_rad)), pose=pose)
        for pose in poses
    ]


def driven(memory: GroundMemory, poses: list[Pose2]) -> None:
    """Drive over poses with a camera that measures nothing."""
    blind = seen(lambda x, y: np.full_like(x, -np.inf))
    for pose in poses:
        memory.estimate(dataclasses.replace(blind, pose=pose), RULES.max_slope, GROUND, None)


def memory_of_the_ramp() -> GroundMemory:
    """Of the first view, after the way to the second."""
    memory = GroundMemory()
    memory.estimate(views_of_a_ramp()[0], RULES.max_slope, GROUND, None)
    x, y = (np.linspace(a, b, 5) for a, b in zip((-1.6, -1.2), (0.6, -2.4), strict=True))
    driven(memory, [Pose2(x_m=a, y_m=b, yaw_rad=0.0) for a, b in zip(x, y, strict=True)])
    return memory


def on_the_ramp(frame: Frame, ground: FloatImage) -> Floats:
    """Heights above the ground of the obstacles on the surface of the ramp."""
    labels = ColourSegmenter().segment(frame, NOTHING)
    points = observe(frame, labels, NOTHING, SPEC, RULES, ground).points_map
    inside = (points[:, 0] > 0.8) & (points[:, 0] < 2.6) & (abs(points[:, 1]) < 0.3)
    return np.asarray(points[inside, 2], dtype=np.float64)


def test_a_ramp_whose_foot_is_out_of_view_is_ground_if_it_was_seen_a_moment_before() -> None:
    memory, second = memory_of_the_ramp(), views_of_a_ramp()[1]
    ground = memory.estimate(second, RULES.max_slope, GROUND, None)
    assert len(on_the_ramp(second, ground)) == 0
    # Control: by this view alone it is an obstacle, and so it is once the memory has been left.
    assert len(on_the_ramp(second, ground_heights(second, RULES.max_slope))) > 10
    memory.forget()
    assert len(on_the_ramp(second, memory.estimate(second, RULES.max_slope, GROUND, None))) > 10


def test_remembered_ground_makes_nothing_else_ground() -> None:
    memory, second = memory_of_the_ramp(), views_of_a_ramp()[1]
    ramp_and_box = beside(second.pose.x_m, second.pose.y_m, second.pose.yaw_rad)

    def surface(x: Floats, y: Floats) -> Floats:
        at = second.pose.to_parent(np.column_stack([x.ravel(), y.ravel()])).T.reshape(2, *x.shape)
        box = (abs(at[0] - 1.3) < 0.2) & (abs(at[1]) < 0.2)
        return np.asarray(ramp_and_box(x, y) + 0.3 * box)

    frame = dataclasses.replace(seen(surface), pose=second.pose)
    assert len(on_the_ramp(frame, memory.estimate(frame, RULES.max_slope, GROUND, None))) > 5


def test_raised_ground_is_forgotten_after_some_metres_and_after_a_jump() -> None:
    def after(way: list[Pose2]) -> int:
        memory, second = memory_of_the_ramp(), views_of_a_ramp()[1]
        driven(memory, way)
        ground = memory.estimate(second, RULES.max_slope, GROUND, None)
        return len(on_the_ramp(second, ground))

    to_and_fro = [Pose2(x_m=0.6, y_m=-2.4 - 0.5 * (n % 2), yaw_rad=0.0) for n in range(1, 31)]
    assert after(to_and_fro[:10]) == 0
    assert after(to_and_fro) > 10
    assert after([Pose2(x_m=8.0, y_m=8.0, yaw_rad=0.0)]) > 10


def test_a_ramp_that_led_up_to_where_the_robot_stands_is_no_ground_beside_its_edge() -> None:
    """On a platform beside the ramp that it came up, the remembered ramp lies below it."""
    memory = GroundMemory()
    memory.estimate(views_of_a_ramp()[0], RULES.max_slope, GROUND, None)
    tilted = dataclasses.replace(views_of_a_ramp()[0], pitch_rad=-math.atan(0.15))
    blind = dataclasses.replace(tilted, depth_m=np.zeros_like(tilted.depth_m))
    for x_m in np.arange(-1.6, 2.5, 0.5):  # by the accelerometer 0.6 m up
        pose = Pose2(x_m=float(x_m), y_m=-1.2, yaw_rad=0.0)
        memory.estimate(dataclasses.replace(blind, pose=pose), RULES.max_slope, GROUND, None)
    above = Pose2(x_m=2.4, y_m=-1.2, yaw_rad=1.6)

    def edge(x: Floats, y: Floats) -> Floats:
        at = above.to_parent(np.column_stack([x.ravel(), y.ravel()]))
        return np.where(at[:, 1] > -0.1, -0.3, 0.0).reshape(x.shape)

    frame = dataclasses.replace(seen(edge), pose=above)
    ground = memory.estimate(frame, RULES.max_slope, GROUND, None)
    np.testing.assert_array_equal(ground, ground_heights(frame, RULES.max_slope))
    assert memory._cells is not None and np.isfinite(memory._cells["seen_m"]).any()  # control


def test_what_is_measured_elsewhere_than_remembered_ground_ends_the_memory_of_it() -> None:
    memory, second = memory_of_the_ramp(), views_of_a_ramp()[1]
    flat = dataclasses.replace(seen(lambda x, y: np.where(x > 3.5, 0.08, 0.0)), pose=second.pose)
    memory.estimate(flat, RULES.max_slope, GROUND, None)
    ground = memory.estimate(second, RULES.max_slope, GROUND, None)
    assert len(on_the_ramp(second, ground)) > 10


def test_ground_that_is_known_by_memory_alone_is_forgotten_all_the_same() -> None:
    memory, second = memory_of_the_ramp(), views_of_a_ramp()[1]
    beside_it = [Pose2(x_m=0.6, y_m=-2.4 - 0.5 * (n % 2), yaw_rad=0.0) for n in range(1, 31)]
    for pose in beside_it:
        driven(memory, [pose, second.pose])
        ground = memory.estimate(second, RULES.max_slope, GROUND, None)
    assert len(on_the_ramp(second, ground)) > 10


@pytest.mark.parametrize("slope", [0.0, 0.12])
def test_striped_tape_on_a_ramp_is_seen_as_on_flat_ground(slope: float) -> None:
    frame = seen(ramp(slope))
    rows, cols = np.mgrid[0 : LENS.height, 0 : LENS.width]
    rays, eye = pixel_rays(rows, cols, LENS) @ MOUNT[:3, :3].T, MOUNT[:3, 3]
    x, y, _ = np.moveaxis(eye + rays * frame.depth_m[..., None], -1, 0)
    tape = (x > 1.8) & (x < 2.1) & (np.abs(y) < 0.6)
    stripes = np.where((np.floor(y / 0.15) % 2 == 0)[..., None], (200, 25, 25), (240, 240, 240))
    rgb = np.where(tape[..., None], stripes, frame.rgb).astype(np.uint8)
    shipped = default_beware_list()
    tapes = BewareList(classes=tuple(e for e in shipped.classes if e.name == "red-white tape"))
    labels = ColourSegmenter().segment(dataclasses.replace(frame, rgb=rgb), tapes).class_ids
    assert (labels[tape] == tapes.classes[0].class_id).mean() > 0.7
    assert (labels[~tape] == 0).all()
