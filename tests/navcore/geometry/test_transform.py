"""Laws of poses and rigid transforms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.geometry.transform import Pose2, camera_mount, invert, transform_points, wrap_angle
from tests.navcore.laws import law

metres = st.floats(-200, 200)
angles = st.floats(-20, 20)
poses = st.builds(lambda x, y, yaw: Pose2(x_m=x, y_m=y, yaw_rad=yaw), metres, metres, angles)


def assert_same(a: Pose2, b: Pose2) -> None:
    np.testing.assert_allclose(a.matrix(), b.matrix(), atol=1e-9)


@law(200)
@given(poses, poses, poses)
def test_composition_is_associative(a: Pose2, b: Pose2, c: Pose2) -> None:
    assert_same((a @ b) @ c, a @ (b @ c))


@law(200)
@given(poses)
def test_a_pose_and_its_inverse_cancel_on_both_sides(pose: Pose2) -> None:
    nothing = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    assert_same(pose @ pose.inverse(), nothing)
    assert_same(pose.inverse() @ pose, nothing)


@law(200)
@given(poses, poses)
def test_composing_poses_is_multiplying_their_matrices(a: Pose2, b: Pose2) -> None:
    np.testing.assert_allclose((a @ b).matrix(), a.matrix() @ b.matrix(), atol=1e-9)
    np.testing.assert_allclose(a.inverse().matrix(), invert(a.matrix()), atol=1e-9)


def test_composition_is_not_commutative() -> None:
    """Control: the laws above would also hold for a product that ignored the order, had it no
    meaning."""
    turn, step = Pose2(x_m=0, y_m=0, yaw_rad=math.pi / 2), Pose2(x_m=1, y_m=0, yaw_rad=0)
    assert (turn @ step).y_m == pytest.approx(1.0)
    assert (step @ turn).y_m == pytest.approx(0.0)


@law(300)
@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_is_the_same_direction_and_wrapping_it_again_changes_nothing(
    angle: float,
) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)
    assert wrap_angle(wrapped) == pytest.approx(wrapped, abs=1e-12)


@pytest.mark.parametrize(
    "angle",
    [math.pi, -math.pi, 3 * math.pi, math.nextafter(math.pi, 4), math.nextafter(-math.pi, -4)],
)
def test_half_a_turn_has_one_name_only(angle: float) -> None:
    assert -math.pi < wrap_angle(angle) <= math.pi


@law(100)
@given(metres, metres, st.floats(0, 2), st.floats(-1.5, 1.5), st.integers(0, 2**32 - 1))
def test_a_camera_mount_is_rigid_and_undone_by_its_inverse(
    x: float, y: float, z: float, pitch: float, seed: int
) -> None:
    mount = camera_mount(x_m=x, y_m=y, z_m=z, pitch_down_rad=pitch)
    np.testing.assert_allclose(mount[:3, :3] @ mount[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(mount[:3, :3]) == pytest.approx(1.0)
    points = np.random.default_rng(seed).uniform(-5, 5, (20, 3))
    np.testing.assert_allclose(
        transform_points(invert(mount), transform_points(mount, points)), points, atol=1e-9
    )


def test_a_level_camera_looks_along_x_and_a_tilted_one_down() -> None:
    level = camera_mount(x_m=0.1, y_m=0.2, z_m=0.6, pitch_down_rad=0.0)
    np.testing.assert_allclose(
        transform_points(level, np.array([[1.0, 2.0, 3.0]])), [[3.1, -0.8, -1.4]]
    )
    tilted = camera_mount(x_m=0.0, y_m=0.0, z_m=0.6, pitch_down_rad=math.pi / 4)
    np.testing.assert_allclose(
        transform_points(tilted, np.array([[0.0, 0.0, math.sqrt(2)]])),
        [[1.0, 0.0, -0.4]],
        atol=1e-12,
    )
