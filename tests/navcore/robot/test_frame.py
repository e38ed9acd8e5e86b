"""Frames that must not enter the map are refused with the reason."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadFrame
from navcore.geometry.transform import Pose2, Twist
from navcore.robot.fix import FixSource, PositionFix
from navcore.robot.frame import Frame, check_frame
from tests.navcore.scene import LENS, MOUNT, ORIGIN, Box, picture

GOOD = picture(Box(x=(2, 3), y=(-1, 1), z=(0, 1)))


def with_depth(value: float, *, share: float = 0.0) -> Frame:
    depth = GOOD.depth_m.copy()
    depth.reshape(-1)[: max(1, int(depth.size * share))] = value
    return dataclasses.replace(GOOD, depth_m=depth)


def test_a_good_frame_passes() -> None:
    """Control for every refusal below."""
    check_frame(GOOD)
    check_frame(with_depth(0.0, share=0.3))


def a_fix(**changes: Any) -> PositionFix:
    fix = PositionFix(stamp_ns=0, x_m=0.0, y_m=0.0, covariance=np.eye(2), source=FixSource.GNSS)
    return dataclasses.replace(fix, **changes)


BAD = {
    "a NaN": (with_depth(math.nan), "1 non-finite"),
    "an infinity": (with_depth(math.inf), "1 non-finite"),
    "a negative depth": (with_depth(-0.5), "negative values, minimum -0.5"),
    "depth of another shape": (
        dataclasses.replace(GOOD, depth_m=GOOD.depth_m[:-1]),
        "depth has shape",
    ),
    "depth with a third axis": (
        dataclasses.replace(GOOD, depth_m=GOOD.depth_m[..., None]),
        "depth has shape",
    ),
    "depth in millimetres": (
        dataclasses.replace(GOOD, depth_m=GOOD.depth_m.astype(np.uint16)),
        "depth is uint16",
    ),
    "depth of double precision": (
        dataclasses.replace(GOOD, depth_m=GOOD.depth_m.astype(np.float64)),
        "depth is float64",
    ),
    "rgb of another shape": (dataclasses.replace(GOOD, rgb=GOOD.rgb[:, :-1]), "rgb is uint8"),
    "rgb with alpha": (
        dataclasses.replace(GOOD, rgb=np.dstack([GOOD.rgb, GOOD.rgb[..., 0]])),
        "rgb is uint8",
    ),
    "rgb of floats": (dataclasses.replace(GOOD, rgb=GOOD.rgb.astype(np.float32)), "rgb is float32"),
    "a covered lens": (with_depth(0.0, share=1.0), "missing in 100%"),
    "an almost covered lens": (with_depth(0.0, share=0.985), "missing in"),
    "a pose of NaN": (
        dataclasses.replace(GOOD, pose=Pose2(x_m=math.nan, y_m=0, yaw_rad=0)),
        "pose",
    ),
    "a heading without end": (
        dataclasses.replace(GOOD, pose=Pose2(x_m=0, y_m=0, yaw_rad=math.inf)),
        "pose",
    ),
    "a speed of NaN": (
        dataclasses.replace(GOOD, twist=Twist(v_mps=math.nan, w_radps=0)),
        "velocity",
    ),
    "a mount of NaN": (
        dataclasses.replace(GOOD, T_base_camera=np.full_like(MOUNT, np.nan)),
        "mount",
    ),
    "a roll of NaN": (dataclasses.replace(GOOD, roll_rad=math.nan), "roll"),
    "a robot on its nose": (dataclasses.replace(GOOD, pitch_rad=1.6), "pitch"),
    "a fix of NaN": (dataclasses.replace(GOOD, fixes=(a_fix(x_m=math.nan),)), "fix by gnss"),
    "a fix with yaw and no covariance of it": (
        dataclasses.replace(GOOD, fixes=(a_fix(yaw_rad=0.0),)),
        r"expected \(3, 3\) with yaw",
    ),
    "a fix that is certain": (
        dataclasses.replace(GOOD, fixes=(a_fix(covariance=np.zeros((2, 2))),)),
        "positive definite",
    ),
    "a lens without focal length": (
        dataclasses.replace(GOOD, intrinsics=dataclasses.replace(LENS, fx=0.0)),
        "intrinsics|focal",
    ),
    "a lens of NaN": (
        dataclasses.replace(GOOD, intrinsics=dataclasses.replace(LENS, cx=math.nan)),
        "intrinsics|axis",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_frame_is_refused_by_name(name: str) -> None:
    frame, words = BAD[name]
    with pytest.raises(BadFrame, match=words):
        check_frame(frame)


def test_the_camera_is_where_robot_and_mount_put_it() -> None:
    turned = dataclasses.replace(GOOD, pose=Pose2(x_m=1.0, y_m=2.0, yaw_rad=math.pi / 2))
    np.testing.assert_allclose(turned.T_map_camera[:3, 3], [1.0, 2.3, 0.6], atol=1e-12)
    np.testing.assert_allclose(dataclasses.replace(GOOD, pose=ORIGIN).T_map_camera, MOUNT)


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_a_level_frame_has_its_z_axis_along_gravity(roll_rad: float, pitch_rad: float) -> None:
    """A body that is pitched front down looks at the floor; rolled with its left side up, its left
    rises."""
    tilted = dataclasses.replace(GOOD, roll_rad=roll_rad, pitch_rad=pitch_rad)
    rotation = tilted.T_level_base[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert rotation[2, 0] == pytest.approx(-math.sin(pitch_rad))
    assert rotation[2, 1] == pytest.approx(math.cos(pitch_rad) * math.sin(roll_rad))
    assert rotation[1, 0] == 0.0  # the heading stays
    np.testing.assert_allclose(tilted.T_map_camera, GOOD.T_map_camera)
    np.testing.assert_allclose(tilted.T_level_camera, tilted.T_level_base @ MOUNT)
