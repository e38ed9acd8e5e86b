"""Furnished worlds of the data sets: the same worlds but for what is added, things at the height of
their table, and a hand that looks at what it is meant to."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from navcore.geometry.transform import Pose2
from navcore.learning.data.class_names import BEWARE_CLASSES
from sim.dataset.generate import LabelledImage, render_images
from sim.dataset.interiors import COVERED_ITEMS, HIGHEST_M, hand_held_view, lived_in
from sim.dataset.materials import material_texture, package_texture
from sim.dataset.renderer import LABELS, MATERIALS, PACKAGES, PATTERNS, SceneRenderer
from sim.dataset.room_generator import random_scene
from sim.dataset.scene import BACKGROUND, Material, Scene, SolidObject
from sim.models.solids import box
from sim.models.textures import Texture
from sim.sensors.camera import T_BASE_CAMERA

SMALL = (212, 120)
WORLDS = range(40)


def scenes(seed: int) -> tuple[Scene, Scene]:
    """Return a random world, and the same with an interior."""
    plain = random_scene(np.random.default_rng((seed, 2)), patterns=PATTERNS, prints=50)
    return plain, lived_in(
        plain, np.random.default_rng((seed, 4)), materials=MATERIALS, packages=PACKAGES
    )


def test_an_interior_adds_to_the_world_and_takes_nothing_away() -> None:
    tables = 0
    for seed in WORLDS:
        plain, furnished = scenes(seed)
        kept = furnished.objects[: len(plain.objects)]
        assert [item.solids for item in kept] == [item.solids for item in plain.objects]
        assert [item.pose for item in kept] == [item.pose for item in plain.objects]
        assert furnished.targets == plain.targets
        assert furnished.decals == plain.decals
        if plain.like_simulator:
            assert furnished == plain
        tables += len(furnished.tops)
        assert all(
            0 <= item.material.texture < MATERIALS + PACKAGES
            for item in furnished.objects
            if item.material is not None
        )
    assert tables > len(WORLDS) / 2


def test_things_on_a_table_stand_on_its_top_and_within_its_edges() -> None:
    things = 0
    for seed in WORLDS:
        plain, furnished = scenes(seed)
        for item in furnished.objects[len(plain.objects) :]:
            bottom_m = min(solid.bottom_m for solid in item.solids)
            if bottom_m < 0.3:
                continue  # the table itself, or a chair
            things += 1
            heights = [
                top.height_m
                for top in furnished.tops
                if np.hypot(item.pose.x_m - top.x_m, item.pose.y_m - top.y_m) < 1.3
            ]
            assert min(abs(bottom_m - height) for height in heights) < 0.011
    assert things > 20


def test_items_of_most_kinds_stand_on_tables() -> None:
    on_tables = set()
    for seed in WORLDS:
        plain, furnished = scenes(seed)
        on_tables |= {item.label for item in furnished.objects[len(plain.objects) :]}
    assert {"cup", "book", "bottle", "keyboard", "box", BACKGROUND} <= on_tables


def test_a_hand_stays_in_the_room_and_looks_at_a_table_or_an_object() -> None:
    views = 0
    for seed in WORLDS:
        _, furnished = scenes(seed)
        view = hand_held_view(furnished, np.random.default_rng((seed, 5)))
        if furnished.like_simulator:
            assert view is None
        if view is None:
            continue
        views += 1
        eye, axis = view[:3, 3], view[:3, 2]
        assert abs(eye[0]) < furnished.reach_m[0]
        assert abs(eye[1]) < furnished.reach_m[1]
        assert eye[2] <= HIGHEST_M
        assert axis[2] < 0.3, "it looks down or ahead"
        aims = [np.array([top.x_m, top.y_m]) for top in furnished.tops]
        aims += [np.array([spot.x_m, spot.y_m]) for spot in furnished.targets]
        away = [aim - eye[:2] for aim in aims]
        ahead = axis[:2] / np.linalg.norm(axis[:2])
        beside = [abs(ahead[0] * a[1] - ahead[1] * a[0]) for a in away if a @ ahead > 0]
        assert min(beside) < 1.5
    assert views > 5


def test_the_same_seed_gives_the_same_furnished_images_of_all_classes() -> None:
    def rendered() -> list[LabelledImage]:
        return list(render_images(seed=7, worlds=3, poses_per_world=3, size=SMALL, furnished=True))

    for one, two in zip(rendered(), rendered(), strict=True):
        np.testing.assert_array_equal(one.rgb, two.rgb)
        np.testing.assert_array_equal(one.depth_mm, two.depth_mm)
        np.testing.assert_array_equal(one.labels, two.labels)
        assert one.labels.min() >= 1
        assert one.labels.max() <= len(BEWARE_CLASSES)


def test_worlds_that_look_like_the_simulator_are_not_furnished() -> None:
    def rendered(*, furnished: bool) -> list[LabelledImage]:
        return list(
            render_images(seed=4, worlds=12, poses_per_world=1, size=SMALL, furnished=furnished)
        )

    plain, furnished = rendered(furnished=False), rendered(furnished=True)
    same = [bool((one.rgb == two.rgb).all()) for one, two in zip(plain, furnished, strict=True)]
    assert 0 < sum(same) < len(same)


@pytest.mark.parametrize("share", [0, 1])
def test_a_material_covers_the_solids_of_its_colour_alone(share: int) -> None:
    renderer = SceneRenderer(seed=1, size=SMALL)
    left, right = (230, 20, 20), (20, 20, 230)
    item = SolidObject(
        label=BACKGROUND,
        solids=(
            box((0.3, 0.4, 0.4), (0.0, 0.2), left),
            box((0.3, 0.4, 0.4), (0.0, -0.2), right),
        ),
        pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0),
        material=Material(texture=3, side_m=0.5, covers=(left, right)[share], tint=(255,) * 3),
    )
    scene = Scene(
        objects=(item,), decals=(), posters=(), targets=(), blocked=(), reach_m=(1.0, 1.0)
    )
    renderer.build(scene)
    ahead = Pose2(x_m=-1.6, y_m=0.0, yaw_rad=0.0).matrix() @ T_BASE_CAMERA
    rgb, _, labels = renderer.render(ahead, scene)
    assert (labels == LABELS[BACKGROUND]).all()
    red = (rgb[..., 0] > 3 * rgb[..., 1].astype(int)) & (rgb[..., 0] > rgb[..., 2])
    blue = (rgb[..., 2] > 3 * rgb[..., 1].astype(int)) & (rgb[..., 2] > rgb[..., 0])
    covered, plain = (red, blue) if share == 0 else (blue, red)
    assert plain.sum() > 500
    assert covered.sum() < 100


@pytest.mark.parametrize("made", [material_texture, package_texture])
def test_materials_and_prints_differ_and_are_textures(
    made: Callable[[np.random.Generator], Texture],
) -> None:
    rng = np.random.default_rng(3)
    textures = [made(rng) for _ in range(30)]
    assert all(t.dtype == np.uint8 and t.ndim == 3 and t.shape[2] == 3 for t in textures)
    assert len({t.tobytes() for t in textures}) == len(textures)
    assert sum(t.std() > 5 for t in textures) > len(textures) / 2


def test_a_third_of_the_books_boxes_bottles_and_cups_of_furnished_worlds_are_printed() -> None:
    printed, plain = Counter[str](), Counter[str]()
    for seed in WORLDS:
        _, furnished = scenes(seed)
        for item in () if furnished.like_simulator else furnished.objects:
            of = printed if item.material and item.material.texture >= MATERIALS else plain
            of[item.label] += 1
    assert set(printed) == set(COVERED_ITEMS)
    share = printed.total() / sum(printed[kind] + plain[kind] for kind in COVERED_ITEMS)
    assert 0.25 < share < 0.5
