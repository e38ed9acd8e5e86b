"""Renders random worlds, one after the other."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
import numpy.typing as npt

from navcore.geometry.arrays import Bools
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix, Pose2, camera_mount
from navcore.learning.data.class_names import BEWARE_CLASSES
from sim.dataset import palette
from sim.dataset.materials import material_texture, package_texture
from sim.dataset.patterns import pattern
from sim.dataset.prints import PRINT_KINDS, RenderedPrint, cropped, thing_solids
from sim.dataset.scene import UNSEEN, Decal, Poster, Scene, SolidObject
from sim.models.items import ITEM_SIZES
from sim.models.mesh import merge_solids
from sim.models.person import PERSON
from sim.models.textures import GLOSS, Texture, print_texture, spill_texture
from sim.physics.bodies import pose_matrix
from sim.rendering.lamps import LampLight
from sim.rendering.lighting import PLAIN, Lighting
from sim.rendering.visible_world import FAR_M, VisibleWorld
from sim.rendering.visual import Visual, cut_out, flat_polygon, patterned, rectangle, solid_visuals
from sim.sensors.camera import d455_intrinsics
from sim.sensors.stereo_noise import Depth, Rgb

PATTERNS = (24, 8)
"""Number of patterns of indoor floors and of the ground outside."""
GLOSSES = tuple(GLOSS.values())
"""Gloss of water, mud and chemicals; each has four textures."""
MATERIALS, PACKAGES = 40, 24
"""Number of materials of furniture, and of prints of packages; their numbers follow each other."""
PRINTS_OF_EACH = 5
"""Number of rendered prints of each kind."""
FIRST_DECAL_M = 0.003
"""Height of the first decal above the ground."""
DECAL_STEP_M = 0.0004
"""Height by which each decal lies above the one before."""
Labels = npt.NDArray[np.uint8]
"""(H, W) class index + 1."""
UNSEEN_LABEL = 255
"""Label of objects of a kind that no network was trained on; no data set holds one."""
LABELS = {name: i + 1 for i, name in enumerate(BEWARE_CLASSES)} | {UNSEEN: UNSEEN_LABEL}


class SceneRenderer:
    """Floor patterns and prints, made from `seed`, and one world at a time."""

    def __init__(self, *, seed: int, size: tuple[int, int]) -> None:
        self._seed, rng = seed, np.random.default_rng((seed, 1))
        self.intrinsics = d455_intrinsics(size)
        self._world = VisibleWorld()
        self._lamps: LampLight | None = None
        self._labels = np.full(2, LABELS["background"], dtype=np.uint8)
        self._patterns = [pattern(rng, outdoor=i >= PATTERNS[0]) for i in range(sum(PATTERNS))]
        self._patterns += [
            _gloss(GLOSSES[i // 4], int(rng.integers(1 << 30))) for i in range(4 * len(GLOSSES))
        ]
        rendered = [
            self._render_print(rng, kind) for kind in PRINT_KINDS for _ in range(PRINTS_OF_EACH)
        ]
        self._outlines = [outline for _, outline in rendered]
        self._prints = [image for image, _ in rendered]
        self._prints += [print_texture(kind) for kind in ITEM_SIZES]
        self._outlines += [
            np.ones(image.shape[:2], dtype=np.bool_) for image in self._prints[-len(ITEM_SIZES) :]
        ]
        self.prints = len(self._prints)
        """Number of prints for random worlds; those that are added have larger numbers."""

    def print_of(self, kind: str, number: int) -> RenderedPrint:
        """Return a rendered print of one of the `PRINT_KINDS`; `number` is below
        `PRINTS_OF_EACH`."""
        i = PRINT_KINDS.index(kind) * PRINTS_OF_EACH + number
        return RenderedPrint(number=i, image=self._prints[i], outline=self._outlines[i])

    def add_print(self, image: Texture, outline: Bools) -> RenderedPrint:
        """Add a print: its (H, W, 3) colours and the (H, W) pixels of the thing on it."""
        self._prints.append(image)
        self._outlines.append(outline)
        return RenderedPrint(number=len(self._prints) - 1, image=image, outline=outline)

    def build(self, scene: Scene) -> None:
        """Replace the present world by this one."""
        world, labels = VisibleWorld(), []
        for i, decal in enumerate(scene.decals):
            self._put_decal(world, decal, 0.0 if i == 0 else FIRST_DECAL_M + i * DECAL_STEP_M)
            labels.append(decal.label)
        for i, poster in enumerate(scene.posters):
            x, y, z = poster.at_m
            height_m = FIRST_DECAL_M + (len(scene.decals) + i) * DECAL_STEP_M if z == 0.0 else z
            world.add([self._sheet(poster)], pose_matrix([x, y, height_m], list(poster.turn)))
            labels.append("background")
        for solid_object in scene.objects:
            world.add(self._visuals(solid_object), solid_object.pose.matrix())
            labels.append(solid_object.label)
        # The last entry belongs to `NO_OBJECT`.
        self._labels = np.array([LABELS[name] for name in (*labels, "background")], dtype=np.uint8)
        self._world, self._lamps = world, None

    def render(
        self,
        T_map_camera: Matrix,
        scene: Scene,
        lighting: Lighting = PLAIN,
        *,
        lens: Intrinsics | None = None,
    ) -> tuple[Rgb, Depth, Labels]:
        """Return colours under a light, depth in metres and labels, all without errors of the
        camera; `lens` is None for that of the renderer."""
        lens = lens or self.intrinsics
        seen = self._world.image(T_map_camera, lens, scene.light)
        if self._lamps is None or self._lamps.lighting != lighting:
            self._lamps = LampLight(self._world, lighting)
        rgb = self._lamps.relight(seen, T_map_camera, lens, scene.light)
        if scene.sky is not None:
            rgb[seen.depth_m > 0.98 * FAR_M] = scene.sky
        return rgb, seen.depth_m, self._labels[seen.objects]

    def _visuals(self, solid_object: SolidObject) -> tuple[Visual, ...]:
        """Return the solids of an object, of its material where they have one."""
        material, solids = solid_object.material, solid_object.solids
        if material is None:
            return solid_visuals(solids)
        covered = [solid for solid in solids if solid.colour == material.covers]
        others = [solid for solid in solids if solid.colour != material.covers]
        return (
            patterned(
                merge_solids(covered),
                material.tint,
                self._materials[material.texture],
                material.side_m,
            ),
            *solid_visuals(others),
        )

    def _sheet(self, poster: Poster) -> Visual:
        """Return the paper of a poster with its print."""
        image = self._prints[poster.texture]
        if poster.cut_out:
            return cut_out(poster.size_m, image, self._outlines[poster.texture])
        return rectangle(poster.size_m, image)

    @cached_property
    def _materials(self) -> list[Texture]:
        rng = np.random.default_rng((self._seed, 4))
        return [material_texture(rng) for _ in range(MATERIALS)] + [
            package_texture(rng) for _ in range(PACKAGES)
        ]

    def _put_decal(self, world: VisibleWorld, decal: Decal, height_m: float) -> None:
        texture = None if decal.texture is None else self._patterns[decal.texture]
        world.add(
            [flat_polygon(decal.polygon, decal.colour, texture, side_m=decal.texture_side_m)],
            pose_matrix([0.0, 0.0, height_m], [0.0, 0.0, 0.0, 1.0]),
        )

    def _render_print(self, rng: np.random.Generator, kind: str) -> tuple[Texture, Bools]:
        """Return a square image of one item on a floor of any colour, as a print shows it, and the
        pixels of the item."""
        world = VisibleWorld()
        solids = thing_solids(rng, kind)
        reach = 1.9 if kind == PERSON else 1.3 * max(ITEM_SIZES[kind])
        ground = ((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0))
        self._put_decal(
            world,
            Decal(label="background", polygon=ground, colour=palette.any_colour(rng)),
            0.0,
        )
        turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=float(rng.uniform(-3, 3)))
        item = world.add(solid_visuals(solids), turn.matrix())
        down = float(rng.uniform(0.45, 1.2)) if kind != PERSON else 0.1
        away = 1.6 * reach
        T_map_base = Pose2(x_m=-away * math.cos(down), y_m=0.0, yaw_rad=0.0).matrix()
        height = away * math.sin(down) + (0.9 if kind == PERSON else 0.09 * reach)
        seen = world.image(
            T_map_base @ camera_mount(x_m=0.0, y_m=0.0, z_m=height, pitch_down_rad=down),
            self.intrinsics,
        )
        return cropped(seen.rgb, seen.objects == item)


def _gloss(gloss: float, seed: int) -> Texture:
    """Return the texture of a spill, to be multiplied by its colour: white highlights, and grey
    elsewhere."""
    dull = round(255 * (1.0 - 0.45 * gloss))
    return spill_texture((dull, dull, dull), gloss, seed)
