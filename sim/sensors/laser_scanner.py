"""The laser scanner: distances all round at one height, of the surfaces that the camera sees too.

Each quarter of the turn is an image of one row, from which the rays are taken.
"""

from __future__ import annotations

import math

import numpy as np

from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix, Pose2, camera_mount
from navcore.robot.laser_scan import LaserScan, ScannerMount
from sim.models.ground import FLAT, Ground
from sim.rendering.visible_world import FAR_M, VisibleWorld

_COLUMNS = 721
"""Columns of the image of a quarter: finer than the rays, whose angles lie between them."""
_NEAREST_M = 0.05
"""Least distance that is reported, whatever the noise."""


class LaserScanner:
    """A scanner in a simulated world; it does not see the robot itself."""

    def __init__(
        self,
        world: VisibleWorld,
        mount: ScannerMount,
        rng: np.random.Generator,
        ground: Ground = FLAT,
    ) -> None:
        self._world, self._mount, self._rng, self._ground = world, mount, rng, ground
        half = _COLUMNS // 2
        self._lens = Intrinsics(
            width=_COLUMNS, height=1, fx=float(half), fy=float(half), cx=float(half), cy=0.0
        )
        angles = 2 * math.pi * np.arange(mount.rays) / mount.rays
        self._quarter = np.round(angles / (math.pi / 2)).astype(np.int64)
        # Bearings of the optical frame grow to the right, those of the base frame to the left.
        off = self._quarter * (math.pi / 2) - angles
        self._column = np.round(half * (1 + np.tan(off))).astype(np.int64)
        self._stretch = np.hypot(1.0, (self._column - half) / half)

    def scan(self, pose: Pose2) -> LaserScan:
        """Return a scan from a true pose of the base."""
        T_map_base, mount = self._ground.surface_pose(pose), self._mount
        depths = np.stack(
            [
                self._world.image(T_map_base @ self._T_base_view(quarter), self._lens).depth_m[0]
                for quarter in range(4)
            ]
        )
        across = depths[self._quarter % 4, self._column].astype(np.float64)
        ranges = across * self._stretch
        ranges += mount.noise_m * self._rng.standard_normal(mount.rays)
        nothing = (across >= FAR_M) | (ranges > mount.max_range_m)
        ranges_m = np.where(nothing, np.inf, np.maximum(ranges, _NEAREST_M)).astype(np.float32)
        ranges_m.flags.writeable = False
        return LaserScan(ranges_m=ranges_m, x_m=mount.x_m, max_range_m=mount.max_range_m)

    def _T_base_view(self, quarter: int) -> Matrix:
        """(4, 4) pose of the optical frame of a quarter of the turn in the base frame."""
        turned = Pose2(x_m=self._mount.x_m, y_m=0.0, yaw_rad=quarter * math.pi / 2).matrix()
        level = camera_mount(x_m=0.0, y_m=0.0, z_m=self._mount.z_m, pitch_down_rad=0.0)
        return np.asarray(turned @ level)
