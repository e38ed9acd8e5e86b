"""Compile everything that is compiled, before a robot waits for it."""

from __future__ import annotations

import dataclasses

import numpy as np

from navcore import dodging
from navcore.beware import default_beware_list
from navcore.config import NavigatorConfig
from navcore.frame import Frame, Intrinsics
from navcore.grid import GridSpec
from navcore.navigator import Navigator, Order
from navcore.overhung import without_overhung
from navcore.relief import heights_above_floor
from navcore.robot import HUSKY, STANDSTILL
from navcore.segment import ColourSegmenter, Segmenter
from navcore.transform import Pose2, camera_mount
from navcore.yielding import NOBODY, free_of


def warm_up(segmenter: Segmenter | None = None) -> None:
    """Run two ticks over a made-up picture of a red wall: loads the compiled code from its cache, or compiles it.

    The segmenter that is to drive runs too, by default the colour rules: a network's first pictures take longest.
    """
    intrinsics = Intrinsics(width=32, height=24, fx=16.0, fy=16.0, cx=15.5, cy=11.5)
    depth_m, rgb = np.full((24, 32), 2.0, dtype=np.float32), np.zeros((24, 32, 3), dtype=np.uint8)
    rgb[..., 0] = 200
    # Read-only as the real ones are: to the compiler that is a type of its own.
    depth_m.flags.writeable = rgb.flags.writeable = False
    navigator = Navigator(
        spec=GridSpec.centred(size_m=(10.0, 10.0), resolution_m=0.05),
        profile=HUSKY,
        segmenter=segmenter or ColourSegmenter(),
        config=NavigatorConfig(),
    )
    for stamp_ns, x_m in ((0, 0.0), (1, 0.5)):
        frame = Frame(
            stamp_ns=stamp_ns,
            rgb=rgb,
            depth_m=depth_m,
            intrinsics=intrinsics,
            T_base_camera=camera_mount(x_m=0.3, y_m=0.0, z_m=0.6, pitch_down_rad=0.2),
            pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0),
            twist=STANDSTILL,
        )
        navigator.tick(frame, Order(goal=(1.0, 1.0), beware=default_beware_list(), zones=()))
    # No network called anything there low, and nobody walks before the wall; what looks at such is compiled all the same.
    low = np.full(depth_m.shape, max(entry.class_id for entry in default_beware_list().classes if entry.max_height_m), np.uint8)
    without_overhung(low, frame, heights_above_floor(frame), default_beware_list())
    poses = np.zeros((1, 2, 3))
    somebody = dataclasses.replace(NOBODY, walking=np.array([[3.0, 0.0, 0.0, 1.0, 0.3]]))
    free_of(somebody, poses, poses[..., 0].copy(), HUSKY, NavigatorConfig().people)
    dodging.warm(HUSKY)
