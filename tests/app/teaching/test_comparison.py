"""Comparison of two networks: IoU, the interval of its change, and what is not found."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from app.teaching.training import comparison
from app.teaching.training.comparison import compared, not_found
from app.teaching.training.paired_counts import PairedCounts
from navcore.learning.data.card import Sample
from navcore.learning.training.evaluation import InferenceSettings
from navcore.perception.esanet import EsaNet
from navcore.perception.esanet.network.preprocess import NYUV2_DEPTH, Size
from navcore.perception.esanet.weights.weights_file import TrainedNetwork, WeightsCard
from web.interface.teaching import ClassFigures

CUP = 1


def images(share_lost: float, count: int = 20) -> PairedCounts:
    """Return images of a cup of which the new network loses a share of the pixels in each."""
    rng, pair = np.random.default_rng(0), PairedCounts(2)
    for _ in range(count):
        truth = np.ones((20, 20), dtype=np.uint8)
        truth[5:15, 5:15] = CUP + 1
        was = np.where(rng.random(truth.shape) < 0.1, 0, truth - 1).astype(np.uint8)
        now = np.where(rng.random(truth.shape) < share_lost, 0, was).astype(np.uint8)
        pair.add(truth, was, now)
    return pair


def test_a_class_that_is_lost_is_told_from_chance() -> None:
    low, high = images(0.2).interval(CUP) or (0.0, 0.0)
    assert -0.25 < low < high < -0.1
    old, new = images(0.2).ious(CUP) or (0.0, 0.0)
    assert low < new - old < high
    assert images(0.0).interval(CUP) == (0.0, 0.0)


def test_of_a_group_of_images_one_is_no_interval() -> None:
    grouped = PairedCounts(2)
    grouped.merge(images(0.2))
    assert grouped.ious(CUP) == images(0.2).ious(CUP)
    assert grouped.interval(CUP) is None
    grouped.merge(images(0.4))
    assert grouped.interval(CUP) is not None


def test_without_true_pixels_there_is_no_figure() -> None:
    pair = PairedCounts(2)
    assert pair.ious(CUP) is None and pair.interval(CUP) is None and pair.pixels(CUP) == 0


def network(*class_names: str) -> TrainedNetwork:
    """Return a card; what it finds is told by the test."""
    card = WeightsCard(
        variant="r18",
        num_classes=len(class_names),
        width=0.5,
        class_names=class_names,
        depth=NYUV2_DEPTH,
        source_sha256="0" * 64,
    )
    return TrainedNetwork(network=cast(EsaNet, card), card=card)


def test_what_the_old_network_found_falsely_is_no_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = network("background", "cup"), network("background", "cup", "shoe")
    labels = np.zeros((20, 20), dtype=np.uint8)
    labels[5:10, 5:10] = CUP + 1
    was = np.zeros_like(labels)
    was[12:] = CUP  # a cup where there is none, and not where there is one
    now = np.where(labels, CUP, 0).astype(np.uint8)
    now[0, :2] = CUP  # of background
    found = {id(old.network): was, id(new.network): now}
    monkeypatch.setattr(comparison, "predict", lambda one, *_: [found[id(one)]])
    sample = Sample(
        rgb=np.zeros((20, 20, 3), dtype=np.uint8), depth=labels.astype(np.uint16), labels=labels
    )
    inference = InferenceSettings(size=Size(height=32, width=32))
    figures, _ = compared(old, new, [sample], [], inference, NYUV2_DEPTH)
    (cup,) = (one for one in figures if one.name == "cup")
    assert cup.pixels == 25 and cup.new == round(25 / 27, 4)
    assert not_found(figures, ("cup",)) == ()


def test_a_pixel_without_a_colour_counts_neither_way(monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = network("background", "cup"), network("background", "cup")
    labels = np.zeros((20, 20), dtype=np.uint8)
    labels[:10] = CUP + 1
    was = np.zeros_like(labels)
    now = np.where(labels, CUP, 0).astype(np.uint8)
    uncoloured = np.zeros(labels.shape, dtype=np.bool_)
    uncoloured[:, 15:] = True
    now[uncoloured] = 0  # half a cup and half of what is none
    now[15:, 15:] = CUP
    found = {id(old.network): was, id(new.network): now}
    monkeypatch.setattr(comparison, "predict", lambda one, *_: [found[id(one)]])
    sample = Sample(
        rgb=np.zeros((20, 20, 3), dtype=np.uint8),
        depth=labels.astype(np.uint16),
        labels=labels,
        uncoloured=uncoloured,
    )
    inference = InferenceSettings(size=Size(height=32, width=32))
    figures, kept = compared(old, new, [sample], [], inference, NYUV2_DEPTH)
    assert (figures[CUP].pixels, figures[CUP].new, kept) == (150, 1.0, 1.0)


def test_a_taught_class_without_enough_of_its_pixels_is_not_found() -> None:
    figures = [
        ClassFigures(name="cup", pixels=10, old=0.1, new=0.1, images="rendered"),
        ClassFigures(name="shoe", pixels=10, new=0.85, images="captured"),
        ClassFigures(name="Bag", pixels=10, new=0.02, images="captured"),
        ClassFigures(name="lamp", pixels=0, images="captured"),
    ]
    assert not_found(figures, ("shoe", "bag", "lamp")) == ("Bag", "lamp")
