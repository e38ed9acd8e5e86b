"""The depth camera: exact geometry, stereo errors."""

from __future__ import annotations

import dataclasses
import itertools
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from navcore.errors import BadConfiguration
from navcore.geometry.camera import back_project
from navcore.geometry.transform import Matrix, Pose2, transform_points
from navcore.robot.camera_stream import SIZES, CameraStream
from navcore.robot.frame import check_frame
from navcore.robot.profile import HUSKY, RobotProfile, load_profile
from sim.bullet import pybullet
from sim.rendering.lighting import Lighting
from sim.scenario.load import WORLDS, load_scenario
from sim.scenario.schema import Furniture, Marking
from sim.sensors.camera import T_BASE_CAMERA, d455_intrinsics
from sim.sensors.stereo_noise import PERFECT, StereoErrors, degrade_depth
from sim.simulator import Simulator
from tests.sim.worlds import open_floor, seeing, shifted

BOX = Furniture(kind="box", at=(3.0, 0.5), size_m=(1.0, 1.0, 1.0))
RED = Marking(name="red", polygon=shifted(2.0, 0.0))


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_the_lens_has_the_d455s_field_of_view() -> None:
    lens = d455_intrinsics((424, 240))
    assert 2 * math.degrees(math.atan(212 / lens.fx)) == pytest.approx(87)
    assert 2 * math.degrees(math.atan(120 / lens.fy)) == pytest.approx(58)
    assert (lens.cx, lens.cy) == (211.5, 119.5)


@pytest.mark.parametrize("size", SIZES)
def test_pixels_are_nearly_square_and_thresholds_those_of_the_smallest_image(
    size: tuple[int, int],
) -> None:
    lens = d455_intrinsics(size)
    assert lens.fx == pytest.approx(lens.fy, rel=0.05), "4:3 is cut out of the imager, not pressed"
    assert lens.length_px(8) == round(8 * lens.fx / d455_intrinsics(SIZES[0]).fx)


def test_the_camera_takes_images_of_the_profiles_size_and_rate() -> None:
    stream = CameraStream(width=640, height=480, rate_hz=30.0)
    robot = dataclasses.replace(HUSKY, stream=stream)
    stamps = set()
    with Simulator(open_floor(), seed=0, robot=robot) as simulator:
        while simulator.now_ns() < 0.2e9:
            simulator.step()
            frame = simulator.newest_frame()
            stamps.add(None if frame is None else frame.stamp_ns)
    assert frame is not None
    assert frame.rgb.shape == (480, 640, 3) and frame.depth_m.shape == (480, 640)
    assert len(stamps) == 7


def test_back_projected_pixels_lie_where_the_world_is() -> None:
    with Simulator(open_floor(furniture=(BOX,)), seed=0, errors=PERFECT) as simulator:
        frame = simulator.capture()
        check_frame(frame)
        T_map_camera = simulator.true_pose().matrix() @ frame.T_base_camera
        points = transform_points(T_map_camera, back_project(frame.depth_m, frame.intrinsics))
    face = points[(np.abs(points[:, 0] - 2.5) < 0.1) & (points[:, 2] > 0.1)]
    floor = points[(points[:, 2] < 0.1) & (points[:, 0] < 2.3)]
    assert len(face) > 1000 and len(floor) > 10000
    assert np.abs(face[:, 0] - 2.5).max() < 0.005
    assert np.abs(floor[:, 2]).max() < 0.002
    # Its edges, to within a pixel: 2.5 m away a pixel is 11 mm wide.
    assert face[:, 1].min() == pytest.approx(0.0, abs=0.02) and face[:, 1].max() == pytest.approx(
        1.0, abs=0.02
    )
    assert face[:, 2].max() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("robot", [HUSKY, load_profile("jackal")], ids=["husky", "jackal"])
def test_the_body_of_the_robot_is_out_of_view_and_therefore_not_drawn(robot: RobotProfile) -> None:
    world = open_floor()
    with Simulator(world, seed=0, camera_rate_hz=0.001, robot=robot) as simulator:
        links = range(-1, pybullet.getNumJoints(simulator.body, physicsClientId=simulator.client))
        bounds = [
            pybullet.getAABB(simulator.body, link, physicsClientId=simulator.client)
            for link in links
        ]
        T_map_camera = simulator.true_pose().matrix() @ robot.camera.T_base_camera
        lens = simulator.camera.intrinsics
    corners = np.array(
        [[(low, high)[bit][axis] for axis, bit in enumerate(bits)]
         for low, high in bounds for bits in itertools.product((0, 1), repeat=3)]
    )  # fmt: skip
    x, y, z = transform_points(np.asarray(np.linalg.inv(T_map_camera), dtype=np.float64), corners).T
    in_front = z > 0.01
    u, v = (lens.fx * x / z + lens.cx)[in_front], (lens.fy * y / z + lens.cy)[in_front]
    assert in_front.any()
    assert not ((np.abs(u - lens.cx) < lens.width / 2) & (v < lens.height)).any()


def test_the_red_floor_looks_red_from_near_and_far() -> None:
    with Simulator(
        open_floor(markings=(RED,), start=(-8.0, 8.0, 0.0)),
        seed=0,
        camera_size=(212, 120),
        errors=PERFECT,
    ) as simulator:
        for x_m in (-3.0, -1.0, 0.0, 0.8):
            rgb = simulator.camera.image(Pose2(x_m=x_m, y_m=0.1, yaw_rad=0.05)).rgb
            red = (rgb[..., 0] > 120) & (rgb[..., 1] < 60) & (rgb[..., 2] < 60)
            reddish = rgb[..., 0].astype(int) > rgb[..., 1].astype(int) + 30
            assert red.sum() > 50
            assert (red == reddish).mean() > 0.999  # nothing flickers between paint and floor


def test_an_l_shaped_marking_is_painted_exactly_and_not_as_its_hull() -> None:
    corner = Marking(
        name="L", polygon=((1.5, -1.0), (3.5, -1.0), (3.5, 0.0), (2.5, 0.0), (2.5, 1.0), (1.5, 1.0))
    )
    with seeing(open_floor(markings=(corner,))) as simulator:
        frame = simulator.capture()
        red = frame.rgb[..., 0] > frame.rgb[..., 1].astype(int) + 60
        only_red = np.where(red, frame.depth_m, np.float32(0))
        painted = transform_points(T_BASE_CAMERA, back_project(only_red, frame.intrinsics))
    notch = (painted[:, 0] > 2.56) & (painted[:, 1] > 0.06)
    assert len(painted) > 2000 and not notch.any()


def at(depth_m: float, errors: StereoErrors) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    return degrade_depth(np.full((200, 200), depth_m, dtype=np.float32), 223.4, errors, rng())


def test_depth_noise_grows_with_the_square_of_the_distance() -> None:
    errors = StereoErrors(speckle=0.0, disparity_step_px=0.0)
    for z in (1.0, 2.0, 4.0):
        expected = z**2 * 0.08 / (223.4 * 0.095)
        assert at(z, errors).std() == pytest.approx(expected, rel=0.05)


def test_depth_out_of_range_is_a_hole() -> None:
    nearest = 223.4 * 0.095 / 126
    assert (at(0.99 * nearest, PERFECT) == 0).all() and (at(6.01, PERFECT) == 0).all()
    assert (at(1.01 * nearest, PERFECT) > 0).all() and (at(5.99, PERFECT) > 0).all()


def test_speckle_makes_the_share_of_holes_it_says() -> None:
    assert (at(2.0, StereoErrors()) == 0).mean() == pytest.approx(0.01, abs=0.003)


def test_a_near_object_casts_a_shadow_to_its_left_as_wide_as_the_difference_of_disparities() -> (
    None
):
    depth = np.full((40, 200), 4.0, dtype=np.float32)
    depth[:, 100:150] = 1.0
    seen = degrade_depth(
        depth, 223.4, StereoErrors(speckle=0, disparity_noise_px=0, edge_px=0), rng()
    )
    width = 223.4 * 0.095 * (1 / 1.0 - 1 / 4.0)
    missing = np.flatnonzero((seen == 0).any(axis=0))
    assert missing.max() == 99 and len(missing) == pytest.approx(width, abs=1.0)


def test_frames_come_at_their_rate_and_cannot_be_changed() -> None:
    with Simulator(load_scenario("empty_room"), seed=0, camera_size=(64, 36)) as simulator:
        assert simulator.newest_frame() is None
        stamps = set()
        for _ in range(239):  # the last frame of a second is the first of the next
            simulator.step()
            frame = simulator.newest_frame()
            assert frame is not None
            stamps.add(frame.stamp_ns)
        assert len(stamps) == 10
        last = simulator.capture()
        with pytest.raises(ValueError, match="read-only"):
            last.depth_m[0, 0] = 1.0


def test_the_mount_is_that_of_the_documentation() -> None:
    mount: Matrix = T_BASE_CAMERA
    assert tuple(mount[:3, 3]) == (0.35, 0.0, 0.65)
    assert math.degrees(math.asin(-mount[2, 2])) == pytest.approx(12.0)


def test_a_second_simulator_in_the_process_takes_the_same_images() -> None:
    scenario = open_floor(furniture=(BOX,))
    with Simulator(scenario, seed=0) as first, Simulator(scenario, seed=0) as second:
        one, other = first.capture(), second.capture()
    assert np.array_equal(one.depth_m, other.depth_m) and np.array_equal(one.rgb, other.rgb)


def test_nothing_in_the_office_but_floor_book_and_cup_is_saturated() -> None:
    bare = dataclasses.replace(load_scenario("office"), markings=(), items=())
    with seeing(bare, size=(106, 60)) as simulator:
        for x_m, y_m in (
            (-12.5, -6.0),
            (-8.0, 0.0),
            (0.0, 0.0),
            (0.0, 7.0),
            (2.0, -4.0),
            (10.0, 5.0),
            (10.0, -6.0),
            (-9.0, 3.5),
        ):
            for quarter in range(4):
                pose = Pose2(x_m=x_m, y_m=y_m, yaw_rad=quarter * math.pi / 2)
                rgb = simulator.camera.image(pose).rgb
                hsv = np.asarray(cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2HSV))
                assert hsv[..., 1].max() < 0.52 * 255


@pytest.mark.parametrize(
    ("lighting", "blurs"),
    [
        (Lighting(lamp_spacing_m=3.0, polish=0.5), False),
        (Lighting(exposure=0.3, white_k=3000.0), False),
        (Lighting(exposure_ms=40.0), True),
    ],
    ids=["lamps", "exposure", "blur"],
)
def test_the_light_of_a_world_changes_colours_alone_and_blur_needs_a_turn(
    lighting: Lighting, blurs: bool
) -> None:
    plain = open_floor(furniture=(BOX,))
    lit = dataclasses.replace(plain, lighting=lighting)
    for turn_radps in (0.0, 1.0):
        frames = []
        for scenario in (plain, lit):
            with seeing(scenario) as simulator:
                frames.append(simulator.camera.capture(simulator.true_pose(), turn_radps))
        own, other = frames
        np.testing.assert_array_equal(own.depth_m, other.depth_m)
        changed = (np.abs(own.rgb.astype(int) - other.rgb).max(axis=2) > 8).mean()
        assert (changed > 0.005) == (turn_radps > 0.0 or not blurs)


def test_a_world_file_names_its_light(tmp_path: Path) -> None:
    file = tmp_path / "dim.toml"
    text = (WORLDS / "empty_room.toml").read_text(encoding="utf-8")
    file.write_text(text + "\n[lighting]\nexposure = 0.4\npolish = 0.3\n", encoding="utf-8")
    assert load_scenario(str(file)).lighting == Lighting(exposure=0.4, polish=0.3)
    file.write_text(text + "\n[lighting]\nexposure = 0\n", encoding="utf-8")
    with pytest.raises(BadConfiguration, match="exposure"):
        load_scenario(str(file))
