"""A room of the simulator with a shoe on the floor, and frames of it from given poses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

from app.teaching.frames.frame_store import FrameStore
from app.teaching.frames.rules import CaptureRules
from navcore.geometry.transform import Pose2
from sim.scenario.load import load_scenario
from sim.simulator import Simulator
from web.interface.teaching import Annotation

SHOE = (-0.9, 0.0)
ROOM = """
name = "room with a shoe"
size_m = [8.0, 6.0]
start = [-3.0, 0.0, 0.0]
goals = [[2.2, 0.0]]
beware_off = ["bottle", "book", "box", "landmine"]
[map]
size_m = [9.0, 7.0]
[[walls]]
points = [[-3.94, -2.94], [3.94, -2.94], [3.94, 2.94], [-3.94, 2.94], [-3.94, -2.94]]
[[items]]
kind = "shoe"
at = [-0.9, 0.0]
yaw_deg = 60
size_m = [0.34, 0.16, 0.07]
colour = [30, 120, 130]
"""
"""The shoe is lower than what counts as an obstacle, and no class of the shipped network. What that
one mistakes it for is switched off: the robot has to know it for a shoe."""
VIEWPOINTS = (
    *((1.7, -0.5, 0.3), (1.7, 0.0, -0.25), (1.7, 0.5, 0.1), (2.1, -0.3, -0.35)),
    *((2.1, 0.25, 0.4), (2.25, -0.4, 0.15), (2.25, 0.05, -0.4), (2.25, 0.4, 0.3)),
)
"""Where the frames look at the shoe from: distance in metres, direction and the angle beside it."""


def room_file(folder: Path) -> Path:
    """Write the world into a folder and return its file."""
    path = folder / "room.toml"
    path.write_text(ROOM, encoding="utf-8")
    return path


def frames_of_the_shoe(folder: Path, world: Path) -> FrameStore:
    """Return a folder of frames from the poses of `VIEWPOINTS`."""
    store = FrameStore(folder, CaptureRules(alike=0.0, same=0.0))
    with Simulator(load_scenario(str(world)), seed=0) as simulator:
        for away_m, turn_rad, aside_rad in VIEWPOINTS:
            x_m = SHOE[0] - away_m * math.cos(turn_rad)
            y_m = SHOE[1] - away_m * math.sin(turn_rad)
            simulator.teleport(Pose2(x_m=x_m, y_m=y_m, yaw_rad=turn_rad + aside_rad))
            assert store.add_frame(simulator.capture(), "drive") is not None
    return store


def annotated_frames(folder: Path, world: Path) -> FrameStore:
    """Return these frames with the shoe annotated by its colour."""
    store = frames_of_the_shoe(folder, world)
    for one in store.all():
        labels = np.asarray(_is_shoe(store.images(one.id)[0]), dtype=np.uint8)
        store.annotate(one.id, Annotation(class_names=("shoe",), labels=labels))
    return store


def shoe_in(rgb: npt.NDArray[np.uint8]) -> tuple[int, int] | None:
    """Return row and column of the middle of the shoe in an image (H, W, 3); None where it does not
    show it."""
    rows, cols = np.nonzero(_is_shoe(rgb))
    if len(rows) < 150 or rows.max() > rgb.shape[0] - 3:
        return None
    return int(np.median(rows)), int(np.median(cols))


def _is_shoe(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    red, green, blue = (rgb[..., channel].astype(int) for channel in range(3))
    return np.asarray((green > red + 40) & (blue > red + 40))
