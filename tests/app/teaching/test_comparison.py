"""Comparison of two networks: IoU, the interval of its change, and what is not found."""

from __future__ import annotations

import numpy as np

from app.teaching.training.comparison import not_found
from app.teaching.training.paired_counts import PairedCounts
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


def test_a_taught_class_without_enough_of_its_pixels_is_not_found() -> None:
    figures = [
        ClassFigures(name="cup", pixels=10, old=0.1, new=0.1, images="rendered"),
        ClassFigures(name="shoe", pixels=10, new=0.85, images="captured"),
        ClassFigures(name="Bag", pixels=10, new=0.02, images="captured"),
        ClassFigures(name="lamp", pixels=0, images="captured"),
    ]
    assert not_found(figures, ("shoe", "bag", "lamp")) == ("Bag", "lamp")
