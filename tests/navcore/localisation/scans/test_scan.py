"""A scan shows upright surfaces between two heights, and nothing else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from navcore.config.localisation.localisation import ScanConfig
from navcore.geometry.arrays import FloatImage
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import STANDSTILL, Pose2, camera_mount, tilt_matrix
from navcore.localisation.scans.scan import scan_of
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from sim.sensors.stereo_noise import StereoErrors

LENS = Intrinsics(width=212, height=120, fx=112.0, fy=112.0, cx=105.5, cy=59.5)
MOUNT = camera_mount(x_m=0.35, y_m=0.0, z_m=0.65, pitch_down_rad=math.radians(12.0))


def frame_of(depth_m: FloatImage) -> Frame:
    """A frame with a depth image, at the origin."""
    return Frame(
        stamp_ns=0,
        rgb=np.zeros((LENS.height, LENS.width, 3), dtype=np.uint8),
        depth_m=depth_m.astype(np.float32),
        intrinsics=LENS,
        T_base_camera=MOUNT,
        pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0),
        twist=STANDSTILL,
    )


def room(wall_x_m: float, *, tilt: np.ndarray | None = None) -> FloatImage:
    """Depth of a floor and a wall across the x axis, 3 m high, seen from a body with a tilt."""
    camera = (np.eye(4) if tilt is None else tilt) @ MOUNT
    rows, cols = np.mgrid[: LENS.height, : LENS.width]
    rays = np.stack(
        [(cols - LENS.cx) / LENS.fx, (rows - LENS.cy) / LENS.fy, np.ones(rows.shape)], axis=-1
    )
    directions, origin = rays @ camera[:3, :3].T, camera[:3, 3]
    with np.errstate(divide="ignore"):
        floor = np.where(directions[..., 2] < 0, -origin[2] / directions[..., 2], np.inf)
        wall = np.where(directions[..., 0] > 0, (wall_x_m - origin[0]) / directions[..., 0], np.inf)
    wall = np.where(origin[2] + wall * directions[..., 2] < 3.0, wall, np.inf)
    depth = np.minimum(floor, wall)
    return np.where(depth < 6.0, depth, 0.0)


def test_a_wall_is_a_line_of_points_and_the_floor_is_none() -> None:
    scan = scan_of(frame_of(room(2.5)), HUSKY.depth_sensor)

    assert len(scan) > 90
    assert np.allclose(scan.points_base[:, 0], 2.5, atol=0.01)
    assert np.allclose(scan.normals[np.any(scan.normals != 0, axis=1)], (-1.0, 0.0), atol=0.02)
    assert len(scan_of(frame_of(room(50.0)), HUSKY.depth_sensor)) == 0


def test_noise_of_the_disparity_brings_a_wall_neither_nearer_nor_farther() -> None:
    rng, found = np.random.default_rng(4), []
    true_m = room(5.0)
    strength = LENS.fx * StereoErrors().baseline_m
    for _ in range(30):
        disparity = strength / np.maximum(true_m, 0.1) + 0.04 * rng.standard_normal(true_m.shape)
        noisy = np.where(true_m > 0.0, strength / np.maximum(disparity, 0.1), 0.0)
        found.append(np.median(scan_of(frame_of(noisy), HUSKY.depth_sensor).points_base[:, 0]))

    assert abs(np.mean(found) - 5.0) < 0.004


def test_excluded_pixels_are_left_out() -> None:
    excluded = np.zeros((LENS.height, LENS.width), dtype=np.bool_)
    excluded[:, : LENS.width // 2] = True  # the left half, y > 0

    scan = scan_of(frame_of(room(2.5)), HUSKY.depth_sensor, excluded)

    assert len(scan) > 40
    assert (scan.points_base[:, 1] < 0.05).all()


def test_noise_is_averaged_along_the_vertical_and_weighted_by_depth() -> None:
    rng = np.random.default_rng(1)
    depth = room(4.0)
    noisy = depth + np.where(depth > 0, 0.006 * depth**2 * rng.standard_normal(depth.shape), 0.0)

    scan = scan_of(frame_of(noisy), HUSKY.depth_sensor)
    near = scan_of(frame_of(room(1.5)), HUSKY.depth_sensor)

    single_m = 0.006 * 3.65**2
    assert np.std(scan.points_base[:, 0]) < 0.5 * single_m
    assert scan.variance_m2.mean() > near.variance_m2.mean()


def test_a_table_top_is_no_upright_surface() -> None:
    # A plane 0.3 m high from 1 to 2 m ahead, without an edge that the camera could see.
    depth = room(50.0)
    rows = np.arange(LENS.height)
    down = (rows - LENS.cy) / LENS.fy
    fall = -(MOUNT[2, 1] * down + MOUNT[2, 2])
    with np.errstate(divide="ignore"):
        top = np.where(fall > 0, (0.65 - 0.3) / fall, 0.0)
    ahead = 0.35 + top * (MOUNT[0, 1] * down + MOUNT[0, 2])
    depth[:] = np.where((ahead > 1.0) & (ahead < 2.0), top, 0.0)[:, None]

    assert len(scan_of(frame_of(depth), HUSKY.depth_sensor)) == 0


def test_on_a_slope_the_measured_tilt_puts_upright_surfaces_in_place() -> None:
    pitch = 0.12
    tilted = replace(frame_of(room(3.0, tilt=tilt_matrix(0.0, pitch))), pitch_rad=pitch)
    everything = ScanConfig(low_m=0.5, high_m=2.0)

    scan = scan_of(tilted, HUSKY.depth_sensor, config=everything)
    flat = scan_of(replace(tilted, pitch_rad=0.0), HUSKY.depth_sensor, config=everything)

    assert np.allclose(scan.points_base[:, 0], 3.0, atol=0.03)
    assert abs(flat.points_base[:, 0].mean() - 3.0) > 0.05  # the control


def test_the_arrays_are_read_only() -> None:
    scan = scan_of(frame_of(room(2.5)), HUSKY.depth_sensor)

    assert not any(
        array.flags.writeable
        for array in (scan.points_base, scan.variance_m2, scan.normals, scan.origin)
    )


def test_a_camera_that_looks_down_sees_an_upright_wall_as_one_surface() -> None:
    """Up the wall its depth changes, and it runs across the columns of the image."""
    for wall_x_m, aside_rad in ((1.3, 0.0), (1.6, 0.0), (1.3, 0.6)):
        turned = Pose2(x_m=0.0, y_m=0.0, yaw_rad=-aside_rad).matrix()
        scan = scan_of(frame_of(room(wall_x_m, tilt=turned)), HUSKY.depth_sensor)
        directions = LENS.width // ScanConfig().column_step
        assert 0.9 * directions <= len(scan) <= directions
        assert (np.hypot(*scan.normals.T) > 0.5).mean() > 0.9
        along = scan.normals[np.hypot(*scan.normals.T) > 0.5] @ (
            math.cos(aside_rad), math.sin(aside_rad)
        )  # fmt: skip
        assert (along < -0.99).all()
