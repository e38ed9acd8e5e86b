"""World of rectangles in which the small robot behind the console drives."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from app.console.mission.path_preview import with_zones
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import camera_mount
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid, inflate_layers
from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone
from navcore.mission.zone_cells import rasterise
from navcore.robot.profile import HUSKY

SPEC = GridSpec.centred(size_m=(16.0, 12.0), resolution_m=0.1)
INTRINSICS = Intrinsics(width=320, height=180, fx=200.0, fy=200.0, cx=160.0, cy=90.0)
T_BASE_CAMERA = camera_mount(x_m=0.4, y_m=0.0, z_m=0.6, pitch_down_rad=0.3)
MARGIN_M = 0.1
RED_FLOOR = 1
BOX_PIXELS = (slice(60, 90), slice(20, 70))
"""Unlabelled box in the camera image."""


def box(left: float, right: float, low: float, high: float) -> BoolGrid:
    return rasterise(((left, low), (right, low), (right, high), (left, high)), SPEC)


def walls() -> BoolGrid:
    outer = box(-7.9, 7.9, -5.9, 5.9) & ~box(-7.7, 7.7, -5.7, 5.7)
    return outer | box(1.5, 2.0, -5.9, -2.0) | box(3.5, 4.5, 2.0, 3.0)


def layered(
    world: Mapping[int, BoolGrid], beware: BewareList, zones: Iterable[Zone]
) -> OccupancyGrid:
    nothing = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    open_floor = OccupancyGrid(
        spec=SPEC,
        geometric=world[0],
        beware={entry.class_id: world.get(entry.class_id, nothing) for entry in beware.enabled},
        margins_m={entry.class_id: entry.margin_m for entry in beware.enabled},
        zones=nothing,
    )
    return with_zones(open_floor, tuple(zones))


def inflated(grid: OccupancyGrid) -> BoolGrid:
    return inflate_layers(grid, vehicle_width_m=HUSKY.width_m, safety_margin_m=MARGIN_M)


def camera_image() -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    rgb = np.full((INTRINSICS.height, INTRINSICS.width, 3), 120, dtype=np.uint8)
    rgb[:90] = (170, 180, 190)
    rgb[110:150, 120:220] = (200, 30, 30)
    labels = np.zeros(rgb.shape[:2], dtype=np.uint8)
    labels[110:150, 120:220] = RED_FLOOR
    rgb[BOX_PIXELS] = (60, 110, 60)
    return rgb, labels


def depth_image() -> npt.NDArray[np.float32]:
    """Return the depth of an empty floor with a box."""
    rows = np.arange(INTRINSICS.height)
    down = (rows - INTRINSICS.cy) / INTRINSICS.fy
    falls = math.cos(0.3) * down + math.sin(0.3)
    floor = np.where(falls > 0.02, T_BASE_CAMERA[2, 3] / np.maximum(falls, 0.02), 0.0)
    depth = np.repeat(floor[:, None], INTRINSICS.width, axis=1).astype(np.float32)
    depth[BOX_PIXELS] = 1.9
    return depth
