"""Labelled images of random worlds: the same from the same seed, labels exact, prints no items,
splits apart."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.learning.data.class_names import BEWARE_CLASSES
from sim.dataset.generate import (
    SHARDS_PER_SPLIT,
    SPLITS,
    WORLDS_PER_SHARD,
    LabelledImage,
    render_images,
    shard_seed,
)
from sim.dataset.renderer import LABELS, PATTERNS, SceneRenderer
from sim.dataset.room_generator import random_scene
from sim.dataset.scene import BACKGROUND, Decal, Poster, Scene, SolidObject
from sim.models.items import ITEM_COLOURS, ITEM_SIZES, item_shapes, item_solids
from sim.models.solids import Colour
from sim.rendering.light import Light
from sim.sensors.camera import T_BASE_CAMERA

SMALL = (212, 120)
MAGENTA: Colour = (255, 0, 255)
GREEN: Colour = (0, 255, 0)
GROUND = ((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0))
AHEAD = Pose2(x_m=-1.6, y_m=0.0, yaw_rad=0.0).matrix() @ T_BASE_CAMERA
"""T_map_camera of a robot that sees the origin 1.25 m before its camera."""


@pytest.fixture(scope="module")
def scene_renderer() -> SceneRenderer:
    return SceneRenderer(seed=1, size=SMALL)


def scene(
    *,
    objects: tuple[SolidObject, ...] = (),
    posters: tuple[Poster, ...] = (),
    texture: int | None = None,
) -> Scene:
    ground = Decal(label=BACKGROUND, polygon=GROUND, colour=(200, 200, 200), texture=texture)
    return Scene(
        objects=objects,
        decals=(ground,),
        posters=posters,
        targets=(),
        blocked=(),
        reach_m=(1.0, 1.0),
    )


def item(kind: str, x_m: float = 0.0, y_m: float = 0.0) -> SolidObject:
    solids = item_solids(kind, ITEM_SIZES[kind], ITEM_COLOURS[kind], item_shapes(kind)[0])
    return SolidObject(label=kind, solids=solids, pose=Pose2(x_m=x_m, y_m=y_m, yaw_rad=0.0))


def poster(texture: int) -> Poster:
    return Poster(
        texture=texture, at_m=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0, 1.0), size_m=(0.5, 0.5)
    )


def small_set(seed: int) -> list[LabelledImage]:
    return list(render_images(seed=seed, worlds=2, poses_per_world=1, size=SMALL))


def test_the_same_seed_gives_the_same_bits() -> None:
    first, again = small_set(4), small_set(4)
    assert [image.name for image in first] == [image.name for image in again]
    for one, two in zip(first, again, strict=True):
        assert (
            (one.rgb == two.rgb).all()
            and (one.depth_mm == two.depth_mm).all()
            and (one.labels == two.labels).all()
        )


def test_another_seed_gives_other_worlds() -> None:
    first, other = small_set(4), small_set(5)
    assert not {image.world_seed for image in first} & {image.world_seed for image in other}
    assert all((a.rgb != b.rgb).any() for a, b in zip(first, other, strict=True))


def test_no_world_is_in_two_splits() -> None:
    shards = (0, 1, SHARDS_PER_SPLIT - 1)
    seeds = [
        shard_seed(seed, split, shard) for seed in range(4) for split in SPLITS for shard in shards
    ]
    worlds = [WORLDS_PER_SHARD * seed + i for seed in seeds for i in (0, WORLDS_PER_SHARD - 1)]
    assert len(set(worlds)) == len(worlds)
    ranges = sorted((WORLDS_PER_SHARD * seed, WORLDS_PER_SHARD * (seed + 1)) for seed in seeds)
    assert all(end <= begin for (_, end), (begin, _) in pairwise(ranges))
    with pytest.raises(BadConfiguration, match="shard"):
        shard_seed(0, "train", SHARDS_PER_SPLIT)
    with pytest.raises(BadConfiguration, match="worlds"):
        next(render_images(seed=0, worlds=WORLDS_PER_SHARD + 1, poses_per_world=1))


def test_every_class_is_seen_within_some_tens_of_worlds_and_often_enough() -> None:
    images = list(render_images(seed=7, worlds=20, poses_per_world=2, size=SMALL))
    seen = {
        name: sum((p.labels == LABELS[name]).sum() >= 4 for p in images) / len(images)
        for name in BEWARE_CLASSES
    }
    assert min(seen.values()) > 0.1, seen
    assert all(p.labels.min() >= 1 and p.labels.max() <= len(BEWARE_CLASSES) for p in images)
    assert all(
        p.rgb.dtype == np.uint8 and p.depth_mm.dtype == np.uint16 and p.labels.dtype == np.uint8
        for p in images
    )
    assert all(
        p.rgb.shape == (120, 212, 3) and p.depth_mm.shape == p.labels.shape == (120, 212)
        for p in images
    )


def painted(world: Scene) -> Scene:
    """Return the same world in magenta for beware objects and green elsewhere, untextured."""

    def colour(label: str) -> Colour:
        return GREEN if label == BACKGROUND else MAGENTA

    objects = tuple(
        dataclasses.replace(
            p, solids=tuple(dataclasses.replace(s, colour=colour(p.label)) for s in p.solids)
        )
        for p in world.objects
    )
    decals = tuple(
        dataclasses.replace(p, colour=colour(p.label), texture=None) for p in world.decals
    )
    light = Light(ambient=0.9, diffuse=0.1)
    return dataclasses.replace(
        world, objects=objects, decals=decals, posters=(), light=light, sky=GREEN
    )


def test_labels_match_the_colours_exactly(scene_renderer: SceneRenderer) -> None:
    wrong = labelled = 0
    for seed in range(3):
        world = painted(
            random_scene(
                np.random.default_rng(seed), patterns=PATTERNS, prints=scene_renderer.prints
            )
        )
        scene_renderer.build(world)
        for x_m, y_m, turn in (
            (-1.0, 0.0, 0.0),
            (0.5, 0.5, 2.0),
            (1.0, -0.5, -2.5),
            (0.0, 0.0, 1.0),
        ):
            rgb, _, labels = scene_renderer.render(
                Pose2(x_m=x_m, y_m=y_m, yaw_rad=turn).matrix() @ T_BASE_CAMERA, world
            )
            magenta, beware = rgb[:, :, 0] > rgb[:, :, 1], labels > LABELS[BACKGROUND]
            wrong, labelled = wrong + int((magenta != beware).sum()), labelled + int(beware.sum())
    assert labelled > 10_000
    assert wrong == 0


def test_a_print_is_background_and_flat_and_a_real_item_is_neither(
    scene_renderer: SceneRenderer,
) -> None:
    worlds = (scene(), scene(posters=(poster(0),)), scene(objects=(item("cup"),)))
    views = []
    for world in worlds:
        scene_renderer.build(world)
        views.append(scene_renderer.render(AHEAD, world))
    (bare_rgb, bare_m, _), (print_rgb, print_m, print_labels), (_, cup_m, cup_labels) = views
    changed = (print_rgb.astype(int) - bare_rgb).any(axis=2)
    assert changed.sum() > 300  # it is visible
    assert (print_labels == LABELS[BACKGROUND]).all()
    assert (
        np.abs(print_m - bare_m)[changed].max() < 0.02
    )  # its 3.4 mm over the floor, along a flat ray
    cup = cup_labels == LABELS["cup"]
    assert cup.sum() > 50 and np.abs(cup_m - bare_m)[cup].max() > 0.1


def test_floors_have_their_patterns_and_prints_differ_among_many_objects(
    scene_renderer: SceneRenderer,
) -> None:
    crowd = tuple(
        dataclasses.replace(item(k, 3.0, 0.3 * i - 1.5), label=BACKGROUND)
        for i, k in enumerate(ITEM_SIZES)
    )
    near = slice(100, 120)

    def shot(world: Scene) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
        scene_renderer.build(world)
        return scene_renderer.render(AHEAD, world)[0]

    plain, patterned = (
        shot(scene(objects=crowd)),
        [shot(scene(objects=crowd, texture=i)) for i in range(4)],
    )
    assert plain[near].std() < 2
    assert max(image[near].astype(float).std(axis=(0, 1)).max() for image in patterned) > 4
    prints = [shot(scene(objects=crowd, posters=(poster(i),))) for i in (0, 30)]
    assert all((a != b).any(axis=2).sum() > 100 for a, b in pairwise(prints))


def test_a_random_light_changes_the_colours_of_the_same_worlds_alone() -> None:
    def rendered(*, disturbed: bool) -> list[LabelledImage]:
        return list(
            render_images(seed=4, worlds=6, poses_per_world=1, size=SMALL, disturbed=disturbed)
        )

    plain, lit, again = (rendered(disturbed=on) for on in (False, True, True))
    for one, two, three in zip(plain, lit, again, strict=True):
        assert one.name == two.name
        np.testing.assert_array_equal(one.labels, two.labels)
        np.testing.assert_array_equal(one.depth_mm, two.depth_mm)
        np.testing.assert_array_equal(two.rgb, three.rgb)
    changed = [
        (np.abs(one.rgb.astype(int) - two.rgb).max(axis=2) > 8).mean() > 0.1
        for one, two in zip(plain, lit, strict=True)
    ]
    assert sum(changed) >= len(changed) / 2, "each disturbance is in half of the worlds"
