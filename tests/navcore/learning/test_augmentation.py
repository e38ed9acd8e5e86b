"""Random variations: colours, depth and labels stay on top of each other, and the same seed draws
the same."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadConfiguration
from navcore.learning.data.card import Sample
from navcore.learning.training.augmentation import augmented, flipped, resized, tinted
from navcore.learning.training.batches import epoch_batches
from navcore.learning.training.recipe import Augmentation
from navcore.perception.esanet.network.preprocess import Size
from tests.navcore.laws import law
from tests.navcore.learning.made import sample

SIZE = Size(height=64, width=96)
STILL = Augmentation(scale=(1.0, 1.0), hsv=(1.0, 1.0), flip=0.0)


@law(40)
@given(st.integers(0, 2**32 - 1))
def test_depth_and_labels_stay_on_top_of_each_other(seed: int) -> None:
    made = sample(seed, height=48, width=72)
    told = Sample(
        rgb=made.rgb, depth=(made.labels * np.uint16(700)).astype(np.uint16), labels=made.labels
    )
    varied = augmented(told, SIZE, Augmentation(), np.random.default_rng(seed))
    assert varied.rgb.shape == (64, 96, 3)
    np.testing.assert_array_equal(varied.depth, varied.labels * np.uint16(700))
    book = varied.labels == 2
    if book.any():
        redness = (
            varied.rgb[..., 0].astype(int) - varied.rgb[..., 1]
        )  # hue may turn red to pink, not to green
        assert redness[book].mean() > 100
        assert (np.abs(redness[varied.labels == 1]) < 60).mean() > 0.8


@law(20)
@given(st.integers(0, 2**32 - 1))
def test_the_same_seed_draws_the_same_variation(seed: int) -> None:
    first, second = (
        augmented(sample(1), SIZE, Augmentation(), np.random.default_rng(seed)) for _ in range(2)
    )
    for name in ("rgb", "depth", "labels"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_without_changes_a_picture_is_only_resized() -> None:
    made = sample(3, height=100, width=90)
    varied, plain = augmented(made, SIZE, STILL, np.random.default_rng(0)), resized(made, SIZE)
    np.testing.assert_array_equal(varied.rgb, plain.rgb)
    np.testing.assert_array_equal(varied.labels, plain.labels)
    again = augmented(plain, SIZE, STILL, np.random.default_rng(0))
    np.testing.assert_array_equal(again.rgb, plain.rgb)


def test_mirrored_twice_is_the_picture_itself() -> None:
    made = sample(4)
    np.testing.assert_array_equal(flipped(flipped(made)).depth, made.depth)
    always = augmented(
        made,
        Size(height=64, width=64),
        Augmentation(scale=(1, 1), hsv=(1, 1), flip=1.0),
        np.random.default_rng(0),
    )
    np.testing.assert_array_equal(always.labels, made.labels[:, ::-1])


def test_tinting_by_one_changes_nothing_and_value_brightens() -> None:
    rgb = sample(5).rgb
    assert np.abs(tinted(rgb, np.ones(3)).astype(int) - rgb).max() <= 1
    brighter = tinted(rgb, np.array([1.0, 1.0, 1.1]))
    np.testing.assert_allclose(
        brighter.max(axis=2), np.minimum(255, rgb.max(axis=2) * 1.1), atol=1.5
    )
    assert tinted(np.full((1, 1, 3), 255, np.uint8), np.array([1.1, 1.1, 1.1])).tolist() == [
        [[255, 255, 255]]
    ]


@law(60)
@given(st.integers(1, 200), st.sampled_from([4, 8]), st.sampled_from([1, 2]), st.integers(0, 100))
def test_every_picture_is_seen_at_most_once_an_epoch_whatever_the_ranks(
    count: int, batch: int, ranks: int, epoch: int
) -> None:
    if count < batch:
        with pytest.raises(BadConfiguration, match="do not fill"):
            epoch_batches(count, batch, seed=1, epoch=epoch)
        return
    parts = [
        epoch_batches(count, batch, seed=1, epoch=epoch, rank=rank, ranks=ranks)
        for rank in range(ranks)
    ]
    together = [np.concatenate(step) for step in zip(*parts, strict=True)]
    alone = epoch_batches(count, batch, seed=1, epoch=epoch)
    assert len(alone) == count // batch
    np.testing.assert_array_equal(together, alone)
    seen = np.concatenate(alone)
    assert len(set(seen.tolist())) == len(seen) == count // batch * batch


def test_a_batch_that_cannot_be_split_is_refused() -> None:
    with pytest.raises(BadConfiguration, match="cannot be split"):
        epoch_batches(10, 5, seed=0, epoch=1, ranks=2)


def test_another_epoch_has_another_order() -> None:
    orders = {
        tuple(np.concatenate(epoch_batches(64, 8, seed=0, epoch=epoch)).tolist())
        for epoch in range(5)
    }
    assert len(orders) == 5


@law(30)
@given(st.integers(0, 2**32 - 1))
def test_a_focused_crop_shows_a_small_thing_that_a_plain_crop_mostly_misses(seed: int) -> None:
    labels = np.ones((128, 192), dtype=np.uint8)
    random = np.random.default_rng(seed)
    row, col = random.integers(0, 126), random.integers(0, 190)
    labels[row : row + 2, col : col + 2] = (
        2  # four pixels: 1/√4 against 1/√24572, so 98.7 % of the crops are around them
    )
    told = Sample(
        rgb=np.zeros((128, 192, 3), np.uint8), depth=np.zeros((128, 192), np.uint16), labels=labels
    )
    shown = {}
    for focus in (0.0, 1.0):
        changes = Augmentation(scale=(1.0, 1.6), hsv=(1.0, 1.0), focus=focus)
        crops = [
            augmented(
                told, Size(height=128, width=192), changes, random, crop=Size(height=32, width=32)
            )
            for _ in range(40)
        ]
        assert all(
            crop.labels.shape == crop.depth.shape == crop.rgb.shape[:2] == (32, 32)
            for crop in crops
        )
        shown[focus] = sum(bool((crop.labels == 2).any()) for crop in crops)
    assert shown[1.0] >= 30
    assert shown[0.0] <= 20


def test_a_focus_on_a_picture_without_labels_is_any_crop() -> None:
    void = Sample(
        rgb=np.zeros((64, 64, 3), np.uint8),
        depth=np.zeros((64, 64), np.uint16),
        labels=np.zeros((64, 64), np.uint8),
    )
    crop = augmented(
        void,
        SIZE,
        Augmentation(focus=1.0),
        np.random.default_rng(0),
        crop=Size(height=32, width=32),
    )
    assert crop.labels.shape == (32, 32)


@pytest.mark.parametrize(
    "other",
    [
        Augmentation(scale=(1.0, 1.0), hsv=(1.0, 1.0), flip=0.0, exposure=(0.2, 0.5)),
        Augmentation(scale=(1.0, 1.0), hsv=(1.0, 1.0), flip=0.0, white_k=(2800.0, 3500.0)),
        Augmentation(scale=(1.0, 1.0), hsv=(1.0, 1.0), flip=0.0, blur=(0.03, 0.05)),
    ],
    ids=["exposure", "white balance", "blur"],
)
def test_other_light_changes_the_colours_alone(other: Augmentation) -> None:
    made = sample(3, height=100, width=90)
    plain = augmented(made, SIZE, STILL, np.random.default_rng(0))
    lit, again = (augmented(made, SIZE, other, np.random.default_rng(0)) for _ in range(2))
    np.testing.assert_array_equal(lit.rgb, again.rgb)
    assert (np.abs(lit.rgb.astype(int) - plain.rgb).max(axis=2) > 3).mean() > 0.2
    np.testing.assert_array_equal(lit.depth, plain.depth)
    np.testing.assert_array_equal(lit.labels, plain.labels)
