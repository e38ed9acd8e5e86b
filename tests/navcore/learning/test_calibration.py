"""Class offsets undo a skew that is constant a class, and never make the split they are made for worse."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.learning.calibration import best_offsets
from navcore.learning.metrics import confusion_matrix, mean_iou


def score(logits: np.ndarray, classes: np.ndarray, weights: np.ndarray) -> float:
    repeated = np.repeat(np.arange(len(classes)), weights.astype(int))
    return mean_iou(confusion_matrix(classes[repeated] + 1, logits.argmax(axis=1)[repeated], logits.shape[1]))


@pytest.mark.parametrize("seed", range(6))
def test_a_skewed_network_is_put_right_again(seed: int) -> None:
    rng = np.random.default_rng(seed)
    classes = rng.choice(4, 4000, p=[0.85, 0.09, 0.04, 0.02])
    logits = rng.normal(0, 1, (4000, 4)).astype(np.float32)
    logits[np.arange(4000), classes] += 3.0
    logits += np.log([0.85, 0.09, 0.04, 0.02]).astype(np.float32)
    skewed = logits + np.array([0.0, 2.5, 3.5, 4.0], dtype=np.float32)
    weights = rng.integers(1, 4, 4000).astype(np.float64)
    offsets = best_offsets(skewed, classes, weights)
    assert offsets[0] == 0.0
    put_right = score(skewed + offsets.astype(np.float32), classes, weights)
    assert put_right > score(skewed, classes, weights) + 0.1
    assert put_right >= score(logits, classes, weights) - 0.005


def test_a_network_that_is_right_stays_as_it_is() -> None:
    classes = np.array([0, 1, 2, 0, 1])
    logits = np.eye(3, dtype=np.float32)[classes]
    np.testing.assert_array_equal(best_offsets(logits, classes, np.ones(5)), 0.0)
