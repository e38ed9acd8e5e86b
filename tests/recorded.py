"""A small recording to play: a walk of eight pictures past a table before a wall."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Pose2, camera_mount
from navcore.learning.data.images import write_grey, write_rgb
from tests.navcore.scene import LENS, Box, picture

TABLE = Box(x=(2.0, 2.6), y=(-0.4, 0.4), z=(0.0, 0.6))
WALL = Box(x=(3.6, 3.8), y=(-4.0, 4.0), z=(0.0, 2.0))
HAND = camera_mount(x_m=0.0, y_m=0.0, z_m=1.2, pitch_down_rad=0.45)
PLACES = [
    Pose2(x_m=0.1 * step, y_m=0.15 * step - 0.5, yaw_rad=0.1 - 0.04 * step) for step in range(8)
]
TILTED = np.array(
    [
        [1.0, 0, 0, 0.7],
        [0, math.cos(2), -math.sin(2), -1.1],
        [0, math.sin(2), math.cos(2), 0.4],
        [0, 0, 0, 1],
    ]
)
"""T_world_map of a recording that knows nothing of its floor."""
RECORDING_GAP_NS = 5 * 1_000_000_000 // 30


def write_recording(folder: Path, T_world_map: npt.NDArray[np.float64]) -> Path:
    """A walk of eight pictures, every fifth of 30 a second, past a table before a wall."""
    folder.mkdir()
    matrix = np.array([[LENS.fx, 0, LENS.cx], [0, LENS.fy, LENS.cy], [0, 0, 1]])
    np.savetxt(folder / "camera-intrinsics.txt", matrix)
    lines = ["# number, camera to world"]
    for step, place in enumerate(PLACES):
        frame = picture(TABLE, WALL, pose=place, mount=HAND)
        depth = np.rint(np.minimum(frame.depth_m, 60.0) * 1000).astype(np.uint16)
        depth[0, :5] = 65535
        write_grey(folder / f"frame-{5 * step:06d}.depth.png", depth)
        noise = np.random.default_rng(step).integers(
            0, 3, frame.rgb.shape, dtype=np.uint8
        )  # no camera repeats itself
        write_rgb(folder / f"frame-{5 * step:06d}.color.png", frame.rgb // 2 + noise)
        pose = T_world_map @ frame.T_map_camera
        lines.append(" ".join(str(number) for number in (5 * step, *pose.ravel())))
    (folder / "poses.txt").write_text("\n".join(lines))
    return folder
