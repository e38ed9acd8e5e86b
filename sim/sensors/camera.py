"""The RealSense D455: registered RGB-D images, colour aligned to depth, from the mount in the robot
profile."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix, Pose2
from navcore.robot.profile import HUSKY
from sim.models.ground import FLAT, Ground
from sim.rendering.lamps import LampLight
from sim.rendering.lighting import PLAIN, Lighting
from sim.rendering.visible_world import Image, VisibleWorld
from sim.sensors.colour_lens import T_DEPTH_COLOUR, colour_intrinsics, register_colour
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RgbdImage:
    """What the camera reports."""

    rgb: Rgb
    """(H, W, 3) colours."""
    depth_m: Depth
    """(H, W) depth in metres, 0 where nothing is measured."""
    uncoloured: npt.NDArray[np.bool_] | None = None
    """(H, W) pixels whose colour is not known; None where all are."""


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
        colour_lens: bool = False,
    ) -> None:
        """`colour_lens`: colour comes from a lens of its own and is registered to depth."""
        self.intrinsics = d455_intrinsics(size)
        self._world, self._errors, self._rng, self._ground = world, errors, rng, ground
        self._lamps = LampLight(world, lighting)
        narrow = size[0] / size[1] < NARROW
        self.colour_lens = colour_intrinsics(size, narrow=narrow) if colour_lens else None
        """Intrinsics of the colour lens; None where it is that of depth."""
        self.mount = mount
        """T_base_camera, optical frame."""

    def capture(self, pose: Pose2, turn_radps: float = 0.0) -> RgbdImage:
        """Return what the camera reports from a true pose of the base that turns."""
        seen = self.image(pose)
        rgb = self.colour_image(pose, turn_radps, None if self.colour_lens else seen)
        depth_m = degrade_depth(seen.depth_m, self.intrinsics.fx, self._errors, self._rng)
        if self.colour_lens is None:
            return RgbdImage(rgb=rgb, depth_m=depth_m)
        registered, unseen = register_colour(rgb, self.colour_lens, depth_m, self.intrinsics)
        return RgbdImage(rgb=registered, depth_m=depth_m, uncoloured=unseen)

    def colour_image(self, pose: Pose2, turn_radps: float, seen: Image | None = None) -> Rgb:
        """Return (H, W, 3) colours as the colour lens reports them, not registered, from a true
        pose of the base that turns. `seen`: what the lens sees, where it is known."""
        T_map_camera, lens = self._T_map_camera(pose), self.intrinsics
        if self.colour_lens is not None:
            T_map_camera, lens = T_map_camera @ T_DEPTH_COLOUR, self.colour_lens
        shown = seen or self._world.image(T_map_camera, lens)
        rgb = self._lamps.relight(shown, T_map_camera, lens)
        rgb = expose(rgb, self._lamps.lighting, turn_radps * lens.fx)
        return degrade_colour(rgb, self._errors, self._rng)

    def image(self, pose: Pose2) -> Image:
        """Return the image without camera errors from a true pose of the base."""
        return self._world.image(self._T_map_camera(pose), self.intrinsics)

    def _T_map_camera(self, pose: Pose2) -> Matrix:
        return np.asarray(self._ground.surface_pose(pose) @ self.mount)
