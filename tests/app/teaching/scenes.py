"""Frames of a floor with a coloured block, for the tests of teaching."""

from __future__ import annotations

import numpy as np

from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import STANDSTILL, Pose2, camera_mount
from navcore.robot.frame import Frame

HEIGHT, WIDTH = 60, 80
INTRINSICS = Intrinsics(width=WIDTH, height=HEIGHT, fx=60.0, fy=60.0, cx=40.0, cy=30.0)
T_BASE_CAMERA = camera_mount(x_m=0.4, y_m=0.0, z_m=0.6, pitch_down_rad=0.3)
BLOCK = (slice(30, 45), slice(20, 40))
"""Pixels of the block."""


def frame_at(x_m: float, *, yaw_rad: float = 0.0, brightness: int = 120) -> Frame:
    """Return a frame of a grey floor with a red block that stands before it."""
    rows = np.linspace(0, 30, HEIGHT)[:, None]
    grey = brightness + rows + np.linspace(0, 15, WIDTH)[None]
    rgb = np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)
    rgb[BLOCK] = (200, 30, 30)
    depth = np.repeat(np.linspace(4.0, 1.0, HEIGHT)[:, None], WIDTH, axis=1)
    depth[BLOCK] = 1.2
    return Frame(
        stamp_ns=int(x_m * 1e9),
        rgb=rgb,
        depth_m=depth.astype(np.float32),
        intrinsics=INTRINSICS,
        T_base_camera=T_BASE_CAMERA,
        pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=yaw_rad),
        twist=STANDSTILL,
    )
