"""The RealSense D455: registered RGB-D images, colour aligned to depth, from the mount in the robot
profile."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix, Pose2
from navcore.robot.profile import HUSKY
from sim.bullet import pybullet
from sim.models.ground import FLAT, Ground
from sim.sensors.egl import egl_works, load_egl, unload_egl
from sim.sensors.stereo_noise import Depth, Rgb, StereoErrors, degrade_colour, degrade_depth

Renderer = Literal["tiny", "egl"]
BodyIds = npt.NDArray[np.int32]

FIELD_OF_VIEW_DEG = (87.0, 58.0)
"""Field of view of the depth imagers, horizontal and vertical."""
T_BASE_CAMERA: Matrix = HUSKY.camera.T_base_camera
"""T_base_camera of the Husky, optical frame."""
NEAR_M, FAR_M = 0.1, 30.0
"""Near and far clipping planes of the renderer."""
TINY_SHIFT_PX = 0.5
"""Offset of the sample point: TINY samples at a corner of each pixel, EGL in its middle; measured
on the edges of a known box."""
NO_BODY = -1
"""Body id of a pixel that shows no body."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """A directional lamp and ambient light."""

    from_m: tuple[float, float, float] = (400.0, 300.0, 1000.0)
    """Position of the lamp, so far away that its light is parallel."""
    ambient: float = 0.75
    """Ambient share of the light."""
    diffuse: float = 0.3
    """Diffuse share of the light on a surface that faces the lamp."""


DAYLIGHT = Light()
"""The light of every scenario."""


def d455_intrinsics(size: tuple[int, int]) -> Intrinsics:
    """Return the intrinsics at an image size (columns, rows); the optical axis passes between the
    middle pixels."""
    width, height = size
    across, along = (math.tan(math.radians(angle) / 2) for angle in FIELD_OF_VIEW_DEG)
    return Intrinsics(
        width=width,
        height=height,
        fx=width / 2 / across,
        fy=height / 2 / along,
        cx=(width - 1) / 2,
        cy=(height - 1) / 2,
    )


def _start_renderer(client: int, wanted: Literal["auto", "tiny", "egl"]) -> int:
    """Return the handle of the EGL plugin, negative for the TINY renderer of PyBullet; "auto" takes
    EGL where it works and is free. Raises `BadConfiguration`."""
    if wanted == "tiny" or (wanted == "auto" and not egl_works()):
        return -1
    if not egl_works():
        raise BadConfiguration(
            "renderer is 'egl', which does not work on this machine; "
            "use 'auto', or: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"
        )
    plugin = load_egl(client)
    if plugin < 0 and wanted == "egl":
        raise BadConfiguration(
            "renderer is 'egl', which another simulator of this process uses; "
            "use 'auto', or close that simulator"
        )
    return plugin


class Camera:
    """A depth camera in one physics client; owns the renderer of that client."""

    def __init__(
        self,
        client: int,
        *,
        size: tuple[int, int],
        renderer: Literal["auto", "tiny", "egl"],
        errors: StereoErrors,
        rng: np.random.Generator,
        mount: Matrix = T_BASE_CAMERA,
        ground: Ground = FLAT,
    ) -> None:
        """Start the renderer; before any body is built, because the renderer learns of bodies as
        they are made. Raises `BadConfiguration`."""
        self.intrinsics = d455_intrinsics(size)
        self._client, self._errors, self._rng, self._ground = client, errors, rng, ground
        self.mount = mount
        """T_base_camera, optical frame."""
        self._plugin = _start_renderer(client, renderer)
        self.renderer: Renderer = "tiny" if self._plugin < 0 else "egl"
        """The renderer in use."""
        self._projection_matrix = _opengl_projection(
            self.intrinsics, shift_px=TINY_SHIFT_PX if self.renderer == "tiny" else 0.0
        )

    def capture(self, pose: Pose2) -> tuple[Rgb, Depth]:
        """Return (H, W, 3) colours and (H, W) depth in metres, 0 where nothing is measured, from a
        true pose of the base."""
        rgb, depth = self.render_ideal(pose)
        return degrade_colour(rgb, self._errors, self._rng), degrade_depth(
            depth, self.intrinsics.fx, self._errors, self._rng
        )

    def render_ideal(self, pose: Pose2) -> tuple[Rgb, Depth]:
        """Return colours and depth without camera errors; depth is that of the far plane where
        there is no body."""
        rgb, depth, _ = self.render(self._camera_pose(pose), flags=pybullet.ER_NO_SEGMENTATION_MASK)
        return rgb, depth

    def body_ids(self, pose: Pose2) -> BodyIds:
        """Return the (H, W) body ids seen from a true pose of the base, `NO_BODY` where there is
        none."""
        return self.render(self._camera_pose(pose))[2]

    def _camera_pose(self, pose: Pose2) -> Matrix:
        """Return T_map_camera."""
        return self._ground.surface_pose(pose) @ self.mount

    def render(
        self, T_map_camera: Matrix, light: Light = DAYLIGHT, *, flags: int = 0
    ) -> tuple[Rgb, Depth, BodyIds]:
        """Return colours, depth in metres and (H, W) body ids, `NO_BODY` where there is none,
        without errors."""
        width, height = self.intrinsics.width, self.intrinsics.height
        *_, rgba, buffer, body_ids = pybullet.getCameraImage(
            width,
            height,
            viewMatrix=_view_matrix(T_map_camera),
            projectionMatrix=self._projection_matrix,
            lightDirection=light.from_m,
            lightAmbientCoeff=light.ambient,
            lightDiffuseCoeff=light.diffuse,
            lightSpecularCoeff=0.0,
            shadow=0,
            flags=flags,
            renderer=pybullet.ER_TINY_RENDERER
            if self.renderer == "tiny"
            else pybullet.ER_BULLET_HARDWARE_OPENGL,
            physicsClientId=self._client,
        )
        rgb = np.asarray(rgba, dtype=np.uint8).reshape(height, width, 4)[:, :, :3]
        share = np.asarray(buffer, dtype=np.float64).reshape(height, width)
        # The depth buffer is 0 at the near and 1 at the far plane, and hyperbolic between them.
        depth = (FAR_M * NEAR_M / (FAR_M - (FAR_M - NEAR_M) * share)).astype(np.float32)
        return rgb, depth, np.asarray(body_ids, dtype=np.int32).reshape(height, width)

    def close(self) -> None:
        """Release the renderer, before its client disconnects."""
        if self._plugin >= 0:
            unload_egl(self._client, self._plugin)
            self._plugin = -1


def _opengl_projection(lens: Intrinsics, *, shift_px: float) -> list[float]:
    """Return OpenGL's projection matrix, column by column; the image is shifted by `shift_px` to
    the left and downwards."""
    depth = FAR_M - NEAR_M
    columns = (
        (2 * lens.fx / lens.width, 0.0, 0.0, 0.0),
        (0.0, 2 * lens.fy / lens.height, 0.0, 0.0),
        (2 * shift_px / lens.width, 2 * shift_px / lens.height, -(FAR_M + NEAR_M) / depth, -1.0),
        (0.0, 0.0, -2 * FAR_M * NEAR_M / depth, 0.0),
    )
    return [value for column in columns for value in column]


def _view_matrix(T_map_camera: Matrix) -> list[float]:
    """Return OpenGL's view matrix, column by column: its camera has y up and looks along −z."""
    rotation = T_map_camera[:3, :3] * (1.0, -1.0, -1.0)
    view = np.eye(4)
    view[:3, :3] = rotation.T
    view[:3, 3] = -rotation.T @ T_map_camera[:3, 3]
    return [float(value) for value in view.T.ravel()]
