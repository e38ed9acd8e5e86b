"""Renders random worlds, one after the other, each in one physics client."""

from __future__ import annotations

import math
from types import TracebackType
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Matrix, Pose2, camera_mount
from navcore.learning.data.class_names import BEWARE_CLASSES
from sim.bullet import pybullet
from sim.dataset import palette
from sim.dataset.patterns import pattern
from sim.dataset.scene import Decal, Scene
from sim.models.items import ITEM_SIZES, item_shapes, item_solids
from sim.models.person import Appearance, person_solids
from sim.models.solids import quaternion
from sim.models.textures import GLOSS, PRINT_PX, Texture, print_texture, spill_texture
from sim.physics.bodies import (
    NO_SHAPE,
    apply_texture,
    load_texture,
    polygon_visual,
    solids_visual,
    square_visual,
)
from sim.quiet import quiet_output
from sim.sensors.camera import DAYLIGHT, FAR_M, Camera, d455_intrinsics
from sim.sensors.stereo_noise import PERFECT, Depth, Rgb

PATTERNS = (24, 8)
"""Number of patterns of indoor floors and of the ground outside."""
GLOSSES = tuple(GLOSS.values())
"""Gloss of water, mud and chemicals; each has four textures."""
PRINTS_OF_EACH = 5
"""Number of rendered prints of each kind of item."""
FIRST_DECAL_M = 0.003
"""Height of the first decal above the ground."""
DECAL_STEP_M = 0.0004
"""Height by which each decal lies above the one before."""
Labels = npt.NDArray[np.uint8]
"""(H, W) class index + 1."""
LABELS = {name: i + 1 for i, name in enumerate(BEWARE_CLASSES)}


class SceneRenderer:
    """Floor patterns and prints, made from `seed`, and one world at a time; use it in a `with`."""

    def __init__(
        self, *, seed: int, size: tuple[int, int], renderer: Literal["auto", "tiny", "egl"]
    ) -> None:
        rng = np.random.default_rng((seed, 1))
        self.intrinsics = d455_intrinsics(size)
        self._size, self._renderer = size, renderer
        self._client = -1
        self._camera: Camera | None = None
        self._labels = np.full(2, LABELS["background"], dtype=np.uint8)
        self._patterns = [pattern(rng, outdoor=i >= PATTERNS[0]) for i in range(sum(PATTERNS))]
        self._patterns += [
            _gloss(GLOSSES[i // 4], int(rng.integers(1 << 30))) for i in range(4 * len(GLOSSES))
        ]
        self._prints = [
            self._render_print(rng, kind)
            for kind in (*ITEM_SIZES, "person")
            for _ in range(PRINTS_OF_EACH)
        ]
        self._prints += [print_texture(kind) for kind in ITEM_SIZES]

    @property
    def prints(self) -> int:
        """Number of prints."""
        return len(self._prints)

    def build(self, scene: Scene) -> None:
        """Replace the present world by this one."""
        self._restart(self._renderer)
        labels: dict[int, str] = {}
        for i, decal in enumerate(scene.decals):
            labels[self._put_decal(decal, 0.0 if i == 0 else FIRST_DECAL_M + i * DECAL_STEP_M)] = (
                decal.label
            )
        for i, poster in enumerate(scene.posters):
            x, y, z = poster.at_m
            height_m = FIRST_DECAL_M + (len(scene.decals) + i) * DECAL_STEP_M if z == 0.0 else z
            body = self._put(
                square_visual(self._client, poster.size_m), (x, y, height_m), list(poster.turn)
            )
            apply_texture(
                self._client, body, load_texture(self._client, self._prints[poster.texture])
            )
            labels[body] = "background"
        for solid_object in scene.objects:
            shape, pose = solids_visual(self._client, solid_object.solids), solid_object.pose
            labels[self._put(shape, (pose.x_m, pose.y_m, 0.0), quaternion(pose.yaw_rad))] = (
                solid_object.label
            )
        self._labels = np.full(max(labels) + 2, LABELS["background"], dtype=np.uint8)
        for body, name in labels.items():
            self._labels[body + 1] = LABELS[name]

    def render(self, T_map_camera: Matrix, scene: Scene) -> tuple[Rgb, Depth, Labels]:
        """Return colours, depth in metres and labels, all without errors."""
        if self._camera is None:
            raise RuntimeError("no world was built, expected `build` before `render`")
        rgb, depth, bodies = self._camera.render(T_map_camera, scene.light)
        rgb = rgb.copy()
        if scene.sky is not None:
            rgb[depth > 0.98 * FAR_M] = scene.sky
        return rgb, depth, self._labels[bodies + 1]

    def close(self) -> None:
        """Release the physics client."""
        if self._client >= 0:
            with quiet_output():
                if self._camera is not None:
                    self._camera.close()
                pybullet.disconnect(physicsClientId=self._client)
            self._client, self._camera = -1, None

    def __enter__(self) -> SceneRenderer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _restart(self, renderer: Literal["auto", "tiny", "egl"]) -> Camera:
        """Start an empty client: EGL mixes up textures when a textured body is removed, or the
        world reset."""
        self.close()
        with quiet_output():
            self._client = pybullet.connect(
                pybullet.DIRECT, options="--width={} --height={}".format(*self._size)
            )
            rng = np.random.default_rng(0)  # unused without errors
            self._camera = Camera(
                self._client, size=self._size, renderer=renderer, errors=PERFECT, rng=rng
            )
        return self._camera

    def _put(self, shape: int, at: tuple[float, float, float], turn: list[float]) -> int:
        return int(
            pybullet.createMultiBody(0, NO_SHAPE, shape, at, turn, physicsClientId=self._client)
        )

    def _put_decal(self, decal: Decal, height_m: float) -> int:
        shape = polygon_visual(
            self._client, decal.polygon, decal.colour, side_m=decal.texture_side_m
        )
        body = self._put(shape, (0.0, 0.0, height_m), [0.0, 0.0, 0.0, 1.0])
        if decal.texture is not None:
            apply_texture(
                self._client, body, load_texture(self._client, self._patterns[decal.texture])
            )
        return body

    def _render_print(self, rng: np.random.Generator, kind: str) -> Texture:
        """Return a square image of one item on a floor of any colour, as a print shows it."""
        camera = self._restart("tiny")
        if kind == "person":
            solids = person_solids(
                0.1,
                Appearance(
                    shirt=palette.any_colour(rng),
                    trousers=palette.any_colour(rng),
                    hair=palette.hair(rng),
                ),
            )
            reach = 1.9
        else:
            solids = item_solids(
                kind, ITEM_SIZES[kind], palette.item(rng, kind), str(rng.choice(item_shapes(kind)))
            )
            reach = 1.3 * max(ITEM_SIZES[kind])
        ground = ((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0))
        self._put_decal(
            Decal(label="background", polygon=ground, colour=palette.any_colour(rng)), 0.0
        )
        body = self._put(
            solids_visual(self._client, solids),
            (0.0, 0.0, 0.0),
            quaternion(float(rng.uniform(-3, 3))),
        )
        down = float(rng.uniform(0.45, 1.2)) if kind != "person" else 0.1
        away = 1.6 * reach
        T_map_base = Pose2(x_m=-away * math.cos(down), y_m=0.0, yaw_rad=0.0).matrix()
        height = away * math.sin(down) + (0.9 if kind == "person" else 0.09 * reach)
        rgb, _, bodies = camera.render(
            T_map_base @ camera_mount(x_m=0.0, y_m=0.0, z_m=height, pitch_down_rad=down), DAYLIGHT
        )
        rows, columns = np.nonzero(bodies == body)
        return _crop(rgb, rows, columns)


def _crop(rgb: Rgb, rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]) -> Texture:
    """Return the square around these pixels, with a margin and a white frame."""
    if len(rows) == 0:
        return np.full((PRINT_PX, PRINT_PX, 3), 240, dtype=np.uint8)
    half = round(0.62 * max(np.ptp(rows), np.ptp(columns)) + 3)
    row, column = (
        (int(rows.min()) + int(rows.max())) // 2,
        (int(columns.min()) + int(columns.max())) // 2,
    )
    padded = np.pad(rgb, ((half, half), (half, half), (0, 0)), mode="edge")
    square = padded[row : row + 2 * half, column : column + 2 * half]
    image = cv2.resize(square, (PRINT_PX, PRINT_PX), interpolation=cv2.INTER_LINEAR)
    return np.asarray(
        cv2.rectangle(image, (0, 0), (PRINT_PX - 1, PRINT_PX - 1), (245, 245, 240), 5),
        dtype=np.uint8,
    )


def _gloss(gloss: float, seed: int) -> Texture:
    """Return the texture of a spill, to be multiplied by its colour: white highlights, and grey
    elsewhere."""
    dull = round(255 * (1.0 - 0.45 * gloss))
    return spill_texture((dull, dull, dull), gloss, seed)
