"""Labelled images of random worlds, to train and to evaluate the segmentation of beware objects.

The seed of world `i` of `render_images(seed=s)` is `1000 · s + i`, and from it alone come the
world, its poses and the camera errors; floor patterns and prints come from `s`. `shard_seed` gives
every shard of every split of a data set its own `s`, so no world of one split can be in another.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Matrix, Pose2, camera_mount
from sim.dataset.camera_effects import apply_camera_effects
from sim.dataset.interiors import hand_held_view, lived_in
from sim.dataset.renderer import MATERIALS, PACKAGES, PATTERNS, Labels, SceneRenderer
from sim.dataset.room_generator import random_scene
from sim.dataset.scene import Scene
from sim.rendering.lighting import PLAIN, random_lighting
from sim.sensors.stereo_noise import Rgb

Split = Literal["train", "valid", "test"]
SPLITS: tuple[Split, ...] = get_args(Split)
WORLDS_PER_SHARD = 1000
"""Largest number of worlds of a shard; more would overlap with those of the next shard."""
WORLDS_PER_JOB, POSES_PER_WORLD = 25, 8
"""Number of worlds that a process renders with the same floor patterns and prints, and of images of
each world, for training."""
FASTEST_TURN_RADPS = 1.5
"""Largest yaw rate in images with motion blur."""
SHARDS_PER_SPLIT = 1000
"""Largest number of shards of a split."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LabelledImage:
    """One labelled RGB-D image."""

    world_seed: int
    """Seed of the world that it shows."""
    name: str
    """Name, unique over all worlds and poses."""
    rgb: Rgb
    """(H, W, 3) colours."""
    depth_mm: npt.NDArray[np.uint16]
    """(H, W) depth in millimetres along the optical axis, 0 where nothing is measured."""
    labels: Labels
    """(H, W) index of the class in `BEWARE_CLASSES`, plus 1."""


def shard_seed(seed: int, split: Split, shard: int) -> int:
    """Return the seed of one shard of a split of a data set, different for all (seed, split,
    shard); raises `BadConfiguration`."""
    if not 0 <= shard < SHARDS_PER_SPLIT:
        raise BadConfiguration(f"shard is {shard}, allowed 0 to {SHARDS_PER_SPLIT - 1}")
    return (seed * len(SPLITS) + SPLITS.index(split)) * SHARDS_PER_SPLIT + shard


def render_images(
    *,
    seed: int,
    worlds: int,
    poses_per_world: int,
    size: tuple[int, int] = (424, 240),
    disturbed: bool = False,
    furnished: bool = False,
) -> Iterator[LabelledImage]:
    """Yield images of random worlds, from `poses_per_world` poses each; the same seed
    gives the same bits. Raises `BadConfiguration`.

    `disturbed`: each world has a random light and each pose a random turn, drawn beside everything
    else, so that worlds, poses and labels are the same without. `furnished`: furniture has
    materials, there are tables and chairs on legs with things on them, and some images are from a
    camera in a hand (`sim.dataset.interiors`); all else of the worlds is the same without.
    """
    if seed < 0 or not 0 <= worlds <= WORLDS_PER_SHARD or poses_per_world < 1:
        raise BadConfiguration(
            f"seed {seed}, {worlds} worlds, {poses_per_world} poses: "
            f"expected 0 or more, 0 to {WORLDS_PER_SHARD}, 1 or more"
        )
    scene_renderer = SceneRenderer(seed=seed, size=size)
    for i in range(worlds):
        world_seed = WORLDS_PER_SHARD * seed + i
        yield from _render_world(
            scene_renderer, world_seed, poses_per_world, disturbed=disturbed, furnished=furnished
        )


def _render_world(
    scene_renderer: SceneRenderer,
    world_seed: int,
    poses: int,
    *,
    disturbed: bool,
    furnished: bool,
) -> Iterator[LabelledImage]:
    rng = np.random.default_rng((world_seed, 2))
    scene = random_scene(rng, patterns=PATTERNS, prints=scene_renderer.prints)
    furniture_rng = np.random.default_rng((world_seed, 4))
    if furnished:
        scene = lived_in(scene, furniture_rng, materials=MATERIALS, packages=PACKAGES)
    scene_renderer.build(scene)
    light_rng = np.random.default_rng((world_seed, 3))
    lighting = random_lighting(light_rng) if disturbed else PLAIN
    turns_radps = light_rng.uniform(-FASTEST_TURN_RADPS, FASTEST_TURN_RADPS, poses)
    for k in range(poses):
        viewpoint = _viewpoint(scene, rng, k)
        in_hand = hand_held_view(scene, furniture_rng) if furnished else None
        viewpoint = viewpoint if in_hand is None else in_hand
        rgb, depth_m, labels = scene_renderer.render(viewpoint, scene, lighting)
        rgb, depth_m = apply_camera_effects(
            rgb,
            depth_m,
            scene_renderer.intrinsics.fx,
            rng,
            like_simulator=scene.like_simulator,
            lighting=lighting,
            turn_radps=float(turns_radps[k]),
        )
        depth_mm = np.round(depth_m * 1000).astype(np.uint16)
        yield LabelledImage(
            world_seed=world_seed,
            name=f"{world_seed:09d}_{k:02d}",
            rgb=rgb,
            depth_mm=depth_mm,
            labels=labels,
        )


def _viewpoint(scene: Scene, rng: np.random.Generator, k: int) -> Matrix:
    """Return T_map_camera of a robot that observes the k-th target or its surroundings, from near
    or from far."""
    target = scene.targets[k % len(scene.targets)] if scene.targets else None
    x_to, y_to = (target.x_m, target.y_m) if target else (0.0, 0.0)
    best = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    for _ in range(40):
        away, turn = (
            math.exp(rng.uniform(math.log(0.8), math.log(5.5))),
            float(rng.uniform(-math.pi, math.pi)),
        )
        x, y = x_to - away * math.cos(turn), y_to - away * math.sin(turn)
        best = Pose2(x_m=x, y_m=y, yaw_rad=turn + float(rng.normal(0, 0.3)))
        if abs(x) < scene.reach_m[0] and abs(y) < scene.reach_m[1] and _free(scene, x, y):
            break
    else:
        best = Pose2(x_m=0.0, y_m=0.0, yaw_rad=float(rng.uniform(-math.pi, math.pi)))
    pitch, roll = math.radians(12.0 + rng.uniform(-4, 4)), rng.normal(0, math.radians(0.7))
    mount = camera_mount(
        x_m=0.0, y_m=0.0, z_m=float(0.65 + rng.uniform(-0.08, 0.08)), pitch_down_rad=pitch
    )
    tilt = np.eye(4)
    tilt[:2, :2] = [[math.cos(roll), -math.sin(roll)], [math.sin(roll), math.cos(roll)]]
    return best.matrix() @ mount @ tilt


def _free(scene: Scene, x_m: float, y_m: float) -> bool:
    return all(math.hypot(x_m - s.x_m, y_m - s.y_m) > s.radius_m + 0.3 for s in scene.blocked)
