"""Windows of images on the device that trains are those that `augmented` makes of one image."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from navcore.learning.data import photometry
from navcore.learning.data.card import Sample
from navcore.learning.training import augmentation, tensor_photometry
from navcore.learning.training.batches import as_batch
from navcore.learning.training.recipe import Augmentation
from navcore.learning.training.window_pool import PooledImages, WindowPool
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size
from tests.navcore.learning.made import sample, tiny_recipe

NO_CHANGE = Augmentation(scale=(1.0, 1.0), hsv=(1.0, 1.0), flip=0.0)
STATISTICS = DepthStatistics(mean=2000.0, std=500.0, units_per_m=1000.0)
SMALL, SMALL_WORK = Size(height=48, width=80), Size(height=64, width=96)


def pool_of(samples: list[Sample], capacity: int = 8) -> WindowPool:
    pool = WindowPool(SMALL, capacity, 2, torch.device("cpu"))
    pool.add(PooledImages.of(samples, 2, np.random.default_rng(0)))
    return pool


def images(count: int) -> list[Sample]:
    return [sample(seed, height=48, width=80) for seed in range(count)]


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def test_an_image_is_resized_and_normalised_as_in_a_batch_of_a_data_set() -> None:
    size = Size(height=96, width=128)
    recipe = tiny_recipe(size=size, augmentation=NO_CHANGE)
    one = sample(3, height=48, width=80)
    made = pool_of([one]).windows(2, recipe, STATISTICS, generator())
    expected = as_batch([augmentation.resized(one, size)] * 2, STATISTICS)
    level = 1 / 255 / 0.225
    assert float((made.rgb - expected.rgb).abs().max()) < 1.01 * level  # OpenCV rounds its weights
    torch.testing.assert_close(made.depth, expected.depth)
    assert torch.equal(made.labels, expected.labels)


def test_windows_are_laid_around_small_classes_and_mirrored() -> None:
    one = sample(5, height=48, width=80)
    labels = np.ones_like(one.labels)
    labels[40:43, 70:73] = 2
    pool = pool_of([dataclasses.replace(one, labels=labels)])
    shares = []
    for focus in (0.0, 1.0):
        recipe = tiny_recipe(
            size=Size(height=96, width=160),
            crop=Size(height=32, width=32),
            augmentation=dataclasses.replace(NO_CHANGE, focus=focus),
        )
        made = pool.windows(200, recipe, STATISTICS, generator())
        shares.append(float((made.labels == 2).flatten(1).any(dim=1).float().mean()))
    assert shares[0] < 0.3 < 0.7 < shares[1]
    mirrored = tiny_recipe(size=SMALL_WORK, augmentation=dataclasses.replace(NO_CHANGE, flip=1.0))
    plain = tiny_recipe(size=SMALL_WORK, augmentation=NO_CHANGE)
    first, second = (
        pool.windows(1, recipe, STATISTICS, generator()).labels for recipe in (mirrored, plain)
    )
    assert torch.equal(first, second.flip(2)) and not torch.equal(first, second)


def test_a_window_of_a_reduced_image_fits_and_shows_more_of_it() -> None:
    recipe = tiny_recipe(
        size=Size(height=96, width=160),
        crop=Size(height=64, width=64),
        augmentation=dataclasses.replace(NO_CHANGE, reduced=1.0),
    )
    one = sample(5, height=48, width=80)
    rows = np.arange(48, dtype=np.uint16)[:, None].repeat(80, axis=1) + 1
    made = pool_of([dataclasses.replace(one, depth=rows)]).windows(
        100, recipe, STATISTICS, generator()
    )
    depth = made.depth[:, 0, :, 0] * STATISTICS.std + STATISTICS.mean
    seen = depth[:, -1] - depth[:, 0]
    assert float(seen.min()) >= 31 and float(seen.max()) > 44  # 32 of 48 rows at full size
    numpy = np.random.default_rng(0)
    for _ in range(20):
        cut = augmentation.augmented(one, recipe.size, recipe.augmentation, numpy, crop=recipe.crop)
        assert cut.labels.shape == (64, 64)


def test_colours_change_as_those_of_a_single_image() -> None:
    random = np.random.default_rng(1)
    rgb = random.integers(0, 256, size=(3, 20, 30, 3), dtype=np.uint8)
    factors = random.uniform(0.9, 1.1, size=(3, 3))
    across, light, kelvin = (
        np.array([0.0, 3.3, 8.0]),
        np.array([0.5, 1.0, 1.6]),
        [4000.0, 5500.0, 7000.0],
    )
    strengths, normal = np.array([0.0, 0.4, 1.0]), random.standard_normal((3, 5, 5))
    levels = torch.from_numpy(rgb.astype(np.float32)).permute(0, 3, 1, 2)

    def off(
        made: torch.Tensor, expected: list[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]
    ) -> float:
        return float(
            (made.permute(0, 2, 3, 1) - torch.from_numpy(np.stack(expected)).float()).abs().max()
        )

    assert (
        off(
            tensor_photometry.tinted(levels, torch.from_numpy(factors).float()),
            [augmentation.tinted(rgb[i], factors[i]) for i in range(3)],
        )
        <= 1
    )
    assert (
        off(
            tensor_photometry.filtered(
                levels, torch.from_numpy(strengths).float(), torch.from_numpy(normal).float()
            ),
            [
                photometry.filtered(rgb[i], photometry.random_kernel(strengths[i], normal[i]))
                for i in range(3)
            ],
        )
        <= 1
    )
    assert (
        off(
            tensor_photometry.motion_blurred(levels, torch.from_numpy(across).float()),
            [photometry.motion_blurred(rgb[i], float(across[i])) for i in range(3)],
        )
        <= 1
    )
    assert (
        off(
            tensor_photometry.exposed(
                levels, torch.from_numpy(light).float(), torch.tensor(kelvin)
            ),
            [photometry.exposed(rgb[i], float(light[i]), kelvin[i]) for i in range(3)],
        )
        <= 1
    )


def test_a_full_pool_keeps_the_newest() -> None:
    many = images(5)
    pool = pool_of(many[:2], capacity=3)
    assert pool.count == 2
    pool.add(PooledImages.of(many[2:], 2, np.random.default_rng(0)))
    assert pool.count == 3
    recipe = tiny_recipe(size=Size(height=64, width=96), augmentation=NO_CHANGE)
    made = pool.windows(60, recipe, STATISTICS, generator()).labels
    expected = [torch.from_numpy(augmentation.resized(one, recipe.size).labels) for one in many[2:]]
    found = [any(torch.equal(labels, one) for labels in made) for one in expected]
    assert found == [True, True, True]
    assert all(any(torch.equal(labels, one) for one in expected) for labels in made)


def test_the_least_scale_is_that_at_which_the_window_fits() -> None:
    size, window = Size(height=480, width=832), Size(height=256, width=384)
    assert augmentation.least_scale(size, window) == pytest.approx(256 / 480)
