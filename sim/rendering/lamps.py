"""Ceiling lamps with their shadows, and what a polished floor mirrors, laid over an image of a
world.

Sources: Williams, "Casting curved shadows on curved surfaces" (1978), for the depth images of the
lamps; Schlick, "An inexpensive BRDF model for physically-based rendering" (1994), for how the
mirrored share grows towards a grazing angle, here with a lower power, as of a floor that is not
quite smooth.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, nested
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix
from sim.rendering.light import DAYLIGHT, Light
from sim.rendering.lighting import Lighting
from sim.rendering.visible_world import FAR_M, Image, VisibleWorld

NEAREST_LAMPS = 4
"""Number of lamps that light what a camera sees: those nearest to a point ahead of it."""
AHEAD_M = 2.0
"""Distance of that point from the camera."""
MAP_PX, MAP_HALF_DEG = 512, 68.0
"""Side of the depth image of a lamp, and half its field of view, which is its cone of light."""
BIAS_M = 0.05
"""By how much nearer to the lamp something must be to cast a shadow; lower things cast none."""
BRIGHTEST = 1.2
"""Largest brightness, relative to the floor below a lamp."""
FLOOR_M = 0.02
"""Height up to which a pixel shows the floor, which mirrors."""
FRESNEL = 3.0
"""Power with which the mirrored share falls from a grazing to a steep angle."""
GLARE_RAD = 0.07
"""Width of the reflection of a lamp on the floor."""
F64 = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]
U8 = npt.NDArray[np.uint8]


class LampLight:
    """The lamps of a world, and its floor as a mirror. The depth image of a lamp is kept until
    something in the world moves."""

    def __init__(self, world: VisibleWorld, lighting: Lighting) -> None:
        self._world = world
        self.lighting = lighting
        """The light."""
        self._shadows: dict[tuple[int, int], F32] = {}
        self._changes = world.changes
        focal = MAP_PX / 2 / math.tan(math.radians(MAP_HALF_DEG))
        middle = (MAP_PX - 1) / 2
        self._lens = Intrinsics(
            width=MAP_PX, height=MAP_PX, fx=focal, fy=focal, cx=middle, cy=middle
        )

    def relight(
        self, seen: Image, T_map_camera: Matrix, lens: Intrinsics, light: Light = DAYLIGHT
    ) -> U8:
        """Return the (H, W, 3) colours of an image from a pose under the lamps, above a floor that
        mirrors; those of the image itself where there are neither."""
        lighting = self.lighting
        if not lighting.lamp_spacing_m and not lighting.polish:
            return seen.rgb
        lamps, shadows = self._near_lamps(T_map_camera)
        mirrored = self._mirrored(T_map_camera, lens, light) if lighting.polish else seen.rgb
        rgb = np.empty_like(seen.rgb)
        _relight(
            seen.rgb,
            seen.depth_m,
            mirrored,
            T_map_camera.astype(np.float64),
            np.array([lens.fx, lens.fy, lens.cx, lens.cy], dtype=np.float64),
            lamps,
            shadows,
            self._lens.fx,
            np.array([lighting.shade if len(lamps) else 1.0, lighting.polish]),
            rgb,
        )
        return rgb

    def _near_lamps(self, T_map_camera: Matrix) -> tuple[F64, F32]:
        """Return (K, 3) positions of the lamps around, and (K, S, S) their depth images."""
        spacing, (x0, y0) = self.lighting.lamp_spacing_m, self.lighting.lamp_offset_m
        if not spacing:
            return np.empty((0, 3)), np.empty((0, 1, 1), dtype=np.float32)
        ahead = T_map_camera[:2, 2] / max(float(np.linalg.norm(T_map_camera[:2, 2])), 1e-9)
        x, y = T_map_camera[:2, 3] + AHEAD_M * ahead
        column, row = math.floor((x - x0) / spacing), math.floor((y - y0) / spacing)
        around = [(column + i, row + k) for i in range(-1, 3) for k in range(-1, 3)]
        around.sort(key=lambda at: math.hypot(x0 + at[0] * spacing - x, y0 + at[1] * spacing - y))
        near = around[:NEAREST_LAMPS]
        if self._changes != self._world.changes:
            self._shadows.clear()
            self._changes = self._world.changes
        for at in near:
            if at not in self._shadows:
                self._shadows[at] = self._world.image(self._pose(at), self._lens).depth_m
        return (
            np.array([self._pose(at)[:3, 3] for at in near]),
            np.stack([self._shadows[at] for at in near]),
        )

    def _pose(self, at: tuple[int, int]) -> Matrix:
        """Return T_map_lamp of a lamp, looking down: x along x of the map."""
        lighting = self.lighting
        pose = np.diag([1.0, -1.0, -1.0, 1.0])
        pose[0, 3] = lighting.lamp_offset_m[0] + at[0] * lighting.lamp_spacing_m
        pose[1, 3] = lighting.lamp_offset_m[1] + at[1] * lighting.lamp_spacing_m
        pose[2, 3] = lighting.lamp_height_m
        return pose

    def _mirrored(self, T_map_camera: Matrix, lens: Intrinsics, light: Light) -> U8:
        """Return the (H, W, 3) colours that each pixel shows in the mirror of the plane z = 0.

        The mirrored pose would be left-handed: rows are mirrored as well, and back in the image.
        """
        mirror, flip = np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([1.0, -1.0, 1.0, 1.0])
        upside_down = Intrinsics(
            width=lens.width,
            height=lens.height,
            fx=lens.fx,
            fy=lens.fy,
            cx=lens.cx,
            cy=lens.height - 1 - lens.cy,
        )
        seen = self._world.image(mirror @ T_map_camera @ flip, upside_down, light)
        return np.ascontiguousarray(seen.rgb[::-1])


@compiled
def _relight(
    rgb: U8,
    depth_m: F32,
    mirrored: U8,
    t: F64,
    lens: F64,
    lamps: F64,
    shadows: F32,
    focal_px: float,
    shares: F64,
    relit: U8,
) -> None:
    """Write (H, W, 3) relit colours. `t`: T_map_camera; `shares`: brightness of what no lamp
    reaches, and mirrored share at a grazing angle."""
    height, width = depth_m.shape
    shade, polish = shares
    for v in range(height):
        for u in range(width):
            z = float(depth_m[v, u])
            if z > 0.98 * FAR_M:
                relit[v, u] = rgb[v, u]
                continue
            a, b = (u - lens[2]) / lens[0], (v - lens[3]) / lens[1]
            dx = t[0, 0] * a + t[0, 1] * b + t[0, 2]
            dy = t[1, 0] * a + t[1, 1] * b + t[1, 2]
            dz = t[2, 0] * a + t[2, 1] * b + t[2, 2]
            x, y, high = t[0, 3] + dx * z, t[1, 3] + dy * z, t[2, 3] + dz * z
            received = _received(x, y, high, lamps, shadows, focal_px)
            tone = shade + (1.0 - shade) * min(received, BRIGHTEST)
            share, glare = 0.0, 0.0
            if polish > 0.0 and abs(high) < FLOOR_M and dz < 0.0:
                norm = math.sqrt(dx * dx + dy * dy + dz * dz)
                share = polish * (1.0 + dz / norm) ** FRESNEL
                glare = polish * _glare(x, y, dx / norm, dy / norm, -dz / norm, lamps)
            for k in range(3):
                own = tone * rgb[v, u, k]
                level = own + share * (mirrored[v, u, k] - own) + 255.0 * glare
                relit[v, u, k] = np.uint8(min(max(level, 0.0), 255.0))


@nested
def _received(x: float, y: float, high: float, lamps: F64, shadows: F32, focal_px: float) -> float:
    """Return the light of all lamps at a point, that directly below a lamp on the floor as 1."""
    total = 0.0
    size = shadows.shape[1]
    middle = (size - 1) / 2.0
    for k in range(len(lamps)):
        below = lamps[k, 2] - high
        if below < BIAS_M:
            continue
        aside_x, aside_y = x - lamps[k, 0], y - lamps[k, 1]
        u, v = focal_px * aside_x / below + middle, -focal_px * aside_y / below + middle
        if u < 0.0 or v < 0.0 or u >= size - 1.0 or v >= size - 1.0:
            continue
        first_u, first_v = int(u), int(v)
        share_u, share_v = u - first_u, v - first_v
        lit = 0.0
        for i in range(2):
            for j in range(2):
                weight = (share_u if i else 1.0 - share_u) * (share_v if j else 1.0 - share_v)
                if shadows[k, first_v + j, first_u + i] > below - BIAS_M:
                    lit += weight
        square = aside_x * aside_x + aside_y * aside_y + below * below
        total += lit * lamps[k, 2] ** 2 / square * (below / math.sqrt(square))
    return total


@nested
def _glare(x: float, y: float, dx: float, dy: float, dz: float, lamps: F64) -> float:
    """Return the strength, 0 to 1, of the reflections of the lamps at a point of the floor; (dx,
    dy, dz) is the unit direction of the mirrored line of sight."""
    total = 0.0
    for k in range(len(lamps)):
        to_x, to_y, to_z = lamps[k, 0] - x, lamps[k, 1] - y, lamps[k, 2]
        norm = math.sqrt(to_x * to_x + to_y * to_y + to_z * to_z)
        cosine = min((dx * to_x + dy * to_y + dz * to_z) / norm, 1.0)
        total += math.exp(-2.0 * (1.0 - cosine) / (GLARE_RAD * GLARE_RAD))
    return min(total, 1.0)
