"""Class offsets undo a skew that is constant a class and never make their split worse; a
temperature undoes false certainty."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest
import torch

from navcore.errors import BadConfiguration
from navcore.learning.data.card import Sample
from navcore.learning.data.dataset import DatasetWriter, load_dataset
from navcore.learning.training import calibration
from navcore.learning.training.batches import CachedSplit, plain_batch
from navcore.learning.training.calibration import best_offsets, best_temperature, calibrate
from navcore.learning.training.evaluation import InferenceSettings, logits_of
from navcore.learning.training.metrics import confusion_matrix, mean_iou
from navcore.perception.esanet import build
from navcore.perception.esanet.network.preprocess import Size
from tests.navcore.learning.made import NAMES, data_set, sample


def score(logits: np.ndarray, classes: np.ndarray, weights: np.ndarray) -> float:
    repeated = np.repeat(np.arange(len(classes)), weights.astype(int))
    return mean_iou(
        confusion_matrix(classes[repeated] + 1, logits.argmax(axis=1)[repeated], logits.shape[1])
    )


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


def test_a_class_that_no_image_shows_is_not_suppressed() -> None:
    classes = np.array([0, 1, 0, 1, 0, 1])
    logits = np.eye(3, dtype=np.float32)[[0, 1, 2, 1, 0, 2]]
    assert best_offsets(logits, classes, np.ones(6))[2] == 0.0


@pytest.mark.parametrize("temperature", [0.5, 1.0, 3.0])
def test_a_network_that_is_too_sure_becomes_as_sure_as_it_is_right(temperature: float) -> None:
    rng = np.random.default_rng(3)
    honest = rng.normal(0, 1.5, (20_000, 3)).astype(np.float32)
    likely = np.exp(honest) / np.exp(honest).sum(axis=1, keepdims=True)
    classes = (rng.random((20_000, 1)) > likely.cumsum(axis=1)).sum(axis=1).clip(0, 2)
    found = best_temperature(temperature * honest, classes, np.ones(20_000))
    assert found == pytest.approx(temperature, rel=0.05)


def test_so_many_pixels_are_kept_of_a_class_and_their_weights_count_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibration, "MEMORY_BYTES", 1 << 14)
    data_set(tmp_path)
    images = CachedSplit(load_dataset(tmp_path), "train", cache_mb=0)
    network = build("r18-nbt1d", 2, width=0.125).eval()
    inference = InferenceSettings(size=Size(height=64, width=64))
    logits, classes, weights = calibration._collected(network, images, inference, lambda _: None)
    assert logits.nbytes <= 1 << 14
    labels = np.concatenate([images[index].labels.ravel() for index in range(len(images))])
    for number in (0, 1):
        assert weights[classes == number].sum() == pytest.approx((labels == number + 1).sum())


def test_pixels_of_images_with_few_and_with_many_of_a_class_are_as_likely_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    few, many = (np.ones((1, count), np.uint8) for count in (5, 5000))
    images = MagicMock()
    images.__len__.return_value = 1001
    images.__getitem__.side_effect = lambda index: MagicMock(labels=few if index else many)

    def logits_by_size(_: object, samples: list[Sample], *_more: object) -> torch.Tensor:
        (labels,) = (one.labels for one in samples)
        return torch.eye(4)[:, 0, None, None].expand(1, 4, *labels.shape) * labels.size

    monkeypatch.setattr(calibration, "MEMORY_BYTES", 1 << 15)  # 256 rows for each share of 2 × 4
    monkeypatch.setattr(calibration, "plain_batch", lambda samples, *_: samples)
    monkeypatch.setattr(calibration, "logits_of", logits_by_size)
    inference = InferenceSettings(size=Size(height=64, width=64), batch=1)
    rows, _, weights = calibration._collected(MagicMock(), images, inference, lambda _: None)
    assert len(rows) > 128 and weights.sum() == pytest.approx(10_000)
    assert (rows[:, 0] == 5.0).mean() == pytest.approx(0.5, abs=0.02)


def test_the_kept_pixels_are_in_memory_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration, "MEMORY_BYTES", 1 << 24)
    logits = np.zeros((20_000, 4), np.float32)
    tracemalloc.start()
    try:
        kept = calibration._KeptPixels(4)
        for number in range(40):
            kept.add(number % 4, number % 3 == 0, logits, np.arange(20_000))
        rows, *_ = kept.joined()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert rows.nbytes > 1 << 22 and peak < 1.5 * (1 << 24)


@pytest.mark.filterwarnings("error")
def test_a_split_without_labels_leaves_the_network_as_it_is(tmp_path: Path) -> None:
    writer = DatasetWriter(tmp_path, class_names=NAMES)
    one = sample(1)
    writer.add("valid", "0", one.rgb, one.depth, np.zeros_like(one.labels))
    writer.finish()
    images = CachedSplit(load_dataset(tmp_path), "valid", cache_mb=0)
    network = build("r18-nbt1d", 2, width=0.125).eval()
    before = {key: value.clone() for key, value in network.state_dict().items()}
    with pytest.raises(BadConfiguration, match="nothing is labelled in the valid images"):
        calibrate(network, images, InferenceSettings(size=Size(height=64, width=64)))
    assert all(torch.equal(value, before[key]) for key, value in network.state_dict().items())


def test_what_is_calibrated_names_the_same_classes_less_surely(tmp_path: Path) -> None:
    dataset = data_set(tmp_path)
    network = build("r18-nbt1d", 2, width=0.125).eval()
    with torch.no_grad():
        network.decoder.upsample2.conv.weight *= 50.0  # wrong as often as right, and sure of it
    images, inference = (
        CachedSplit(dataset, "valid", cache_mb=1),
        InferenceSettings(size=Size(height=64, width=64)),
    )
    batch = plain_batch([images[0]], inference.size, dataset.card.depth)
    before = logits_of(network, batch, inference)
    made = calibrate(network, images, inference)
    assert made.temperature > 1.5
    assert made.shown.all()
    shifted = before + torch.from_numpy(made.offsets).float()[None, :, None, None]
    torch.testing.assert_close(
        logits_of(network, batch, inference), shifted / made.temperature, rtol=1e-4, atol=1e-4
    )
