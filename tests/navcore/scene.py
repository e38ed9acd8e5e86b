"""Synthetic frames of boxes and painted floor, computed ray by ray, with known positions of all
pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.geometry.camera import Intrinsics, pixel_rays
from navcore.geometry.transform import STANDSTILL, Matrix, Pose2, Twist, camera_mount
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import BewareClass, BewareList, ColourRule
from navcore.robot.frame import Frame
from navcore.robot.laser_scan import LaserScan, ScannerMount

Colour = tuple[int, int, int]
Span = tuple[float, float]

GREY: Colour = (128, 128, 128)
RED: Colour = (220, 20, 20)
LENS = Intrinsics(width=160, height=120, fx=84.0, fy=84.0, cx=79.5, cy=59.5)
MOUNT = camera_mount(x_m=0.3, y_m=0.0, z_m=0.6, pitch_down_rad=0.25)
ORIGIN = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.1)
RED_ID = 5
RED_FLOOR = BewareClass(
    name="red floor", class_id=RED_ID, colour=ColourRule(hue_deg=(340.0, 20.0), max_height_m=0.05)
)
RED_LIST = BewareList(classes=(RED_FLOOR,))


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """Axis-parallel box in the map frame."""

    x: Span
    """First and last x in metres."""
    y: Span
    """First and last y in metres."""
    z: Span
    """Bottom and top in metres."""
    colour: Colour = GREY
    """Colour of every side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Paint:
    """Painted rectangle of the floor."""

    x: Span
    """First and last x in metres."""
    y: Span
    """First and last y in metres."""
    colour: Colour = RED
    """Colour of the paint."""


def picture(
    *things: Box | Paint,
    pose: Pose2 = ORIGIN,
    stamp_ns: int = 0,
    twist: Twist = STANDSTILL,
    mount: Matrix = MOUNT,
) -> Frame:
    """Return the frame of a robot at `pose` with the floor and the objects on it."""
    camera = pose.matrix() @ mount
    rows, cols = np.mgrid[0 : LENS.height, 0 : LENS.width]
    rays = pixel_rays(rows, cols, LENS) @ camera[:3, :3].T
    eye = camera[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[..., 2] < 0, -eye[2] / rays[..., 2], np.inf)
        rgb = np.full((*depth.shape, 3), GREY, dtype=np.uint8)
        floor_x, floor_y = eye[0] + rays[..., 0] * depth, eye[1] + rays[..., 1] * depth
        for thing in things:
            if isinstance(thing, Paint):
                on_x = (thing.x[0] <= floor_x) & (floor_x <= thing.x[1])
                rgb[
                    on_x & (thing.y[0] <= floor_y) & (floor_y <= thing.y[1]) & np.isfinite(depth)
                ] = thing.colour
        for thing in things:
            if isinstance(thing, Box):
                hit = _entry(thing, eye, rays)
                nearer = hit < depth
                depth[nearer], rgb[nearer] = hit[nearer], thing.colour
    depth[depth > 30.0] = 0.0
    return Frame(
        stamp_ns=stamp_ns,
        rgb=rgb,
        depth_m=depth.astype(np.float32),
        intrinsics=LENS,
        T_base_camera=mount,
        pose=pose,
        twist=twist,
    )


def scanned(*things: Box, pose: Pose2 = ORIGIN) -> LaserScan:
    """Return the scan of a robot at `pose`, without noise."""
    mount = ScannerMount(noise_m=0.0)
    # Off the axes by a hair: a ray along a side of a box would divide by zero.
    angles = 2 * np.pi * np.arange(mount.rays) / mount.rays + pose.yaw_rad + 1e-7
    rays = np.stack([np.cos(angles), np.sin(angles), np.full(mount.rays, 1e-9)], axis=-1)[None]
    eye = np.array([*pose.to_parent(np.array([mount.x_m, 0.0])), mount.z_m])
    ranges = np.full(mount.rays, np.inf)
    for thing in things:
        ranges = np.minimum(ranges, _entry(thing, eye, rays)[0])
    ranges[ranges > mount.max_range_m] = np.inf
    return LaserScan(
        ranges_m=ranges.astype(np.float32), x_m=mount.x_m, max_range_m=mount.max_range_m
    )


def _entry(
    box: Box, eye: npt.NDArray[np.float64], rays: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return (H, W) depths at which the rays enter the box; infinite for a miss."""
    near, far = np.full(rays.shape[:2], 1e-6), np.full(rays.shape[:2], np.inf)
    for axis, span in enumerate((box.x, box.y, box.z)):
        first, second = ((side - eye[axis]) / rays[..., axis] for side in span)
        near, far = (
            np.maximum(near, np.fmin(first, second)),
            np.minimum(far, np.fmax(first, second)),
        )
    return np.where(near < far, near, np.inf)
