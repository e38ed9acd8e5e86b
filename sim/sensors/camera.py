"""The RealSense D455: registered RGB-D images, colour aligned to depth, from the mount in the robot
profile."""

from __future__ import annotations

import math

import numpy as np

from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix, Pose2
from navcore.robot.profile import HUSKY
from sim.models.ground import FLAT, Ground
from sim.rendering.lamps import LampLight
from sim.rendering.lighting import PLAIN, Lighting
from sim.rendering.visible_world import Image, VisibleWorld
from sim.sensors.exposure import expose
from sim.sensors.stereo_noise import Depth, Rgb, StereoErrors, degrade_colour, degrade_depth

FIELD_OF_VIEW_DEG = (87.0, 58.0)
"""Field of view of the depth imagers, horizontal and vertical, in images of 16:9."""
NARROW_FIELD_OF_VIEW_DEG = (75.0, 62.0)
"""Field of view in images of 4:3, which are cut out of the middle of the imager: fewer columns and
more rows of it than in 16:9."""
NARROW = 1.5
"""Ratio of the columns to the rows of an image below which it is one of 4:3."""
T_BASE_CAMERA: Matrix = HUSKY.camera.T_base_camera
"""T_base_camera of the Husky, optical frame."""


def d455_intrinsics(size: tuple[int, int]) -> Intrinsics:
    """Return the intrinsics at an image size (columns, rows); the optical axis passes between the
    middle pixels."""
    width, height = size
    view_deg = NARROW_FIELD_OF_VIEW_DEG if width / height < NARROW else FIELD_OF_VIEW_DEG
    across, along = (math.tan(math.radians(angle) / 2) for angle in view_deg)
    return Intrinsics(
        width=width,
        height=height,
        fx=width / 2 / across,
        fy=height / 2 / along,
        cx=(width - 1) / 2,
        cy=(height - 1) / 2,
    )


class Camera:
    """A depth camera in a simulated world."""

    def __init__(
        self,
        world: VisibleWorld,
        *,
        size: tuple[int, int],
        errors: StereoErrors,
        rng: np.random.Generator,
        mount: Matrix = T_BASE_CAMERA,
        ground: Ground = FLAT,
        lighting: Lighting = PLAIN,
    ) -> None:
        self.intrinsics = d455_intrinsics(size)
        self._world, self._errors, self._rng, self._ground = world, errors, rng, ground
        self._lamps = LampLight(world, lighting)
        self.mount = mount
        """T_base_camera, optical frame."""

    def capture(self, pose: Pose2, turn_radps: float = 0.0) -> tuple[Rgb, Depth]:
        """Return (H, W, 3) colours and (H, W) depth in metres, 0 where nothing is measured, from a
        true pose of the base that turns."""
        seen, lighting = self.image(pose), self._lamps.lighting
        rgb = self._lamps.relight(seen, self._T_map_camera(pose), self.intrinsics)
        rgb = expose(rgb, lighting, turn_radps * self.intrinsics.fx)
        return degrade_colour(rgb, self._errors, self._rng), degrade_depth(
            seen.depth_m, self.intrinsics.fx, self._errors, self._rng
        )

    def image(self, pose: Pose2) -> Image:
        """Return the image without camera errors from a true pose of the base."""
        return self._world.image(self._T_map_camera(pose), self.intrinsics)

    def _T_map_camera(self, pose: Pose2) -> Matrix:
        return np.asarray(self._ground.surface_pose(pose) @ self.mount)
