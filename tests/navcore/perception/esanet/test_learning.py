"""Losses, gradients, metrics and class weights: the official numbers, and laws of our own."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadFrame
from navcore.learning.training.losses import jaccard_loss, pyramid_losses, weighted_cross_entropy
from navcore.learning.training.metrics import (
    confusion_matrix,
    count_pixels,
    ious,
    logarithmic_weights,
    mean_iou,
    median_frequency_weights,
)
from tests.navcore.laws import law
from tests.navcore.perception.esanet.goldens import (
    OFFICIAL,
    SEED,
    arrays,
    class_weights,
    fresh,
    inputs,
    labels,
    uniform,
)


@pytest.mark.long
@pytest.mark.parametrize("variant", ["r18", "r18-nbt1d"])
@pytest.mark.parametrize(
    ("dtype", "suffix", "loss_rtol", "gradient_rtol"),
    [(torch.float64, "", 1e-6, 1e-6), (torch.float32, "_f32", 3e-6, 5e-2)],
)
def test_one_step_of_training_is_the_official_one(
    variant: str, dtype: torch.dtype, suffix: str, loss_rtol: float, gradient_rtol: float
) -> None:
    golden = arrays(f"golden_train_{OFFICIAL[variant]}_c10.npz")
    network = fresh(variant, 10).to(dtype).train()
    rgb, depth = inputs("2x128x160")
    outputs = network(rgb.to(dtype), depth.to(dtype))
    losses = pyramid_losses(outputs, torch.from_numpy(labels(2, 128, 160, 10)), class_weights(10))
    torch.autograd.backward(losses)

    np.testing.assert_allclose(
        [loss.item() for loss in losses], golden[f"losses{suffix}"], rtol=loss_rtol
    )
    norms = {
        key: float(parameter.grad.norm())
        for key, parameter in network.named_parameters()
        if parameter.grad is not None
    }
    assert list(norms) == golden["grad_norm_keys"].tolist()
    expected = golden[f"grad_norms{suffix}"]
    large = (
        expected > 1e-3 * expected.max()
    )  # a bias before a batch norm has gradient 0; what is found there is noise
    np.testing.assert_allclose(
        np.array(list(norms.values()))[large], expected[large], rtol=gradient_rtol
    )
    if dtype == torch.float64:
        for number, output in enumerate(values.detach().numpy() for values in outputs):
            assert output.shape == tuple(golden[f"out{number}_shape"])
            np.testing.assert_allclose(
                output[:, :, :4, :4], golden[f"out{number}_corner"], atol=1e-9 * output.std()
            )
            np.testing.assert_allclose(
                output.mean(axis=(0, 2, 3)), golden[f"out{number}_mean"], atol=1e-9 * output.std()
            )
        stem = network.encoder_rgb.bn1
        assert stem.running_mean is not None
        assert stem.running_var is not None
        np.testing.assert_allclose(
            stem.running_mean.numpy(), golden["bn_running_mean_after"], rtol=1e-9
        )
        np.testing.assert_allclose(
            stem.running_var.numpy(), golden["bn_running_var_after"], rtol=1e-9
        )


@law(30)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6))
def test_the_loss_is_the_weighted_mean_over_labelled_pixels(seed: int, num_classes: int) -> None:
    random = np.random.default_rng(seed)
    logits = random.normal(size=(2, num_classes, 4, 6))
    truth = random.integers(0, num_classes + 1, size=(2, 4, 6))
    truth[0, 0, 0] = 1
    weights = random.uniform(0.1, 3.0, size=num_classes)
    total = mass = 0.0
    for batch, row, col in zip(*np.nonzero(truth), strict=True):
        pixel, target = logits[batch, :, row, col], truth[batch, row, col] - 1
        total += weights[target] * (np.log(np.exp(pixel).sum()) - pixel[target])
        mass += weights[target]
    (loss,) = pyramid_losses(
        [torch.from_numpy(logits)], torch.from_numpy(truth), torch.from_numpy(weights)
    )
    assert float(loss) == pytest.approx(total / mass, rel=1e-9)


def test_pictures_without_labels_cost_nothing_and_teach_nothing() -> None:
    logits = torch.randn(1, 3, 8, 8, requires_grad=True)
    losses = pyramid_losses(
        [logits, logits[:, :, ::4, ::4]], torch.zeros(1, 8, 8, dtype=torch.uint8), torch.ones(3)
    )
    torch.autograd.backward(losses)
    assert [loss.item() for loss in losses] == [0.0, 0.0]
    assert logits.grad is not None
    assert bool((logits.grad == 0).all())
    # The control: torch's own mean would be 0 / 0.
    bare = torch.nn.functional.cross_entropy(logits, torch.full((1, 8, 8), -1), ignore_index=-1)
    assert math.isnan(bare.item())


def test_a_class_of_weight_zero_teaches_nothing() -> None:
    assert (
        weighted_cross_entropy(
            torch.randn(1, 2, 4, 4), torch.zeros(1, 4, 4).long(), torch.tensor([0.0, 1.0])
        ).item()
        == 0.0
    )


@law(30)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6))
def test_of_sure_answers_the_jaccard_loss_is_what_lacks_to_the_mean_iou(
    seed: int, num_classes: int
) -> None:
    random = np.random.default_rng(seed)
    said, truth = (
        random.integers(0, num_classes, size=(2, 4, 6)),
        random.integers(0, num_classes + 1, size=(2, 4, 6)),
    )
    truth[0, 0, 0] = 1
    logits = 1e3 * np.moveaxis(np.eye(num_classes)[said], -1, 1)
    known, shown = truth > 0, np.unique(truth[truth > 0]) - 1
    ious = [
        (known & (said == number) & (truth == number + 1)).sum()
        / (known & ((said == number) | (truth == number + 1))).sum()
        for number in shown
    ]
    loss = jaccard_loss(torch.from_numpy(logits), torch.from_numpy(truth))
    assert float(loss) == pytest.approx(1 - np.mean(ious), abs=1e-9)


def test_in_doubt_the_jaccard_loss_finds_a_rare_class_and_cross_entropy_does_not() -> None:
    """Of 100 pixels that look alike 40 are cable, and 1000 more are surely none."""
    labels = torch.ones(1, 1, 1100, dtype=torch.uint8)
    labels[0, 0, :40] = 2
    doubt = torch.tensor(
        math.log(0.4 / 0.6), dtype=torch.float64, requires_grad=True
    )  # says cable with 0.4
    cable = torch.cat([doubt.expand(100), torch.full((1000,), -50.0, dtype=torch.float64)])[
        None, None
    ]
    logits = torch.stack([torch.zeros_like(cable), cable], dim=1)
    (cross_entropy,) = pyramid_losses([logits], labels, torch.ones(2))
    (at_rest,) = torch.autograd.grad(cross_entropy, doubt, retain_graph=True)
    (slope,) = torch.autograd.grad(jaccard_loss(logits, labels), doubt)
    assert at_rest.item() == pytest.approx(0.0, abs=1e-9)
    assert slope.item() < -0.03


def test_pictures_without_labels_cost_nothing_by_the_jaccard_loss() -> None:
    logits = torch.randn(1, 3, 8, 8, requires_grad=True)
    loss = jaccard_loss(logits, torch.zeros(1, 8, 8, dtype=torch.uint8))
    torch.autograd.backward(loss)
    assert loss.item() == 0.0
    assert logits.grad is not None
    assert bool((logits.grad == 0).all())


@pytest.mark.parametrize("label", [4, 255, -1])
def test_labels_beyond_the_classes_are_refused(label: int) -> None:
    with pytest.raises(BadFrame, match="expected 0"):
        pyramid_losses([torch.zeros(1, 3, 8, 8)], torch.full((1, 8, 8), label), torch.ones(3))


def test_labels_of_another_size_are_refused() -> None:
    with pytest.raises(BadFrame, match="shape"):
        pyramid_losses([torch.zeros(1, 3, 8, 8)], torch.zeros(1, 8, 4).long(), torch.ones(3))


def test_mean_iou_is_the_official_one() -> None:
    golden = arrays("golden_preproc_metric.npz")
    truth, other = labels(4, 128, 160, 10), labels(4, 128, 160, 9, seed=SEED + 1)
    mostly = uniform("metric.mix", truth.size).reshape(truth.shape) < 0.7
    predicted = np.where(mostly & (truth > 0), truth.astype(np.int64) - 1, other)
    confusion = confusion_matrix(truth, predicted, 10)
    np.testing.assert_array_equal(confusion, golden["metric/cm"])
    np.testing.assert_allclose(ious(confusion), golden["metric/ious"], atol=1e-6)
    assert mean_iou(confusion) == pytest.approx(float(golden["metric/miou"]), abs=1e-6)


def test_class_weights_are_the_official_ones() -> None:
    golden = arrays("golden_preproc_metric.npz")
    counts = count_pixels(labels(4, 128, 160, 10), 10)
    np.testing.assert_allclose(
        median_frequency_weights(counts), golden["weights/median_frequency"], rtol=1e-12
    )
    np.testing.assert_allclose(
        logarithmic_weights(counts), golden["weights/logarithmic_c1.02"], rtol=1e-12
    )


@law(60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_the_confusion_matrix_counts_every_labelled_pixel_once(seed: int, num_classes: int) -> None:
    random = np.random.default_rng(seed)
    truth: npt.NDArray[np.int64] = random.integers(0, num_classes + 1, size=(7, 9))
    predicted: npt.NDArray[np.int64] = random.integers(0, num_classes, size=(7, 9))
    confusion = confusion_matrix(truth, predicted, num_classes)
    assert confusion.sum() == (truth > 0).sum()
    np.testing.assert_array_equal(
        confusion.sum(axis=1), [(truth == c + 1).sum() for c in range(num_classes)]
    )
    half = confusion_matrix(truth[:3], predicted[:3], num_classes) + confusion_matrix(
        truth[3:], predicted[3:], num_classes
    )
    np.testing.assert_array_equal(confusion, half)
    perfect = confusion_matrix(truth, np.maximum(truth - 1, 0), num_classes)
    assert mean_iou(perfect) == 1.0 or not (truth > 0).any()


def test_a_class_without_true_pixels_does_not_enter_the_mean() -> None:
    confusion = np.array([[4, 0, 1], [0, 3, 2], [0, 0, 0]])
    values = ious(confusion)
    np.testing.assert_allclose(values, [0.8, 0.6, np.nan])
    assert mean_iou(confusion) == pytest.approx(0.7)
    assert math.isnan(mean_iou(np.zeros((3, 3), dtype=np.int64)))


def test_a_class_that_never_occurs_weighs_nothing_and_moves_no_other() -> None:
    image = np.array([[1, 1, 1, 2]])
    np.testing.assert_allclose(median_frequency_weights(count_pixels([image], 2)), [2 / 3, 2.0])
    np.testing.assert_allclose(
        median_frequency_weights(count_pixels([image], 3)), [2 / 3, 2.0, 0.0]
    )
    np.testing.assert_array_equal(median_frequency_weights(count_pixels([], 3)), [0.0, 0.0, 0.0])


def test_metrics_refuse_what_they_cannot_count() -> None:
    ones = np.ones((2, 2), dtype=np.uint8)
    with pytest.raises(BadFrame, match="shape"):
        confusion_matrix(ones, ones[:1], 3)
    with pytest.raises(BadFrame, match="prediction"):
        confusion_matrix(ones, ones * 3, 3)
    with pytest.raises(BadFrame, match="labels"):
        confusion_matrix(ones * 4, ones, 3)
    with pytest.raises(BadFrame, match="labels"):
        count_pixels([ones * 4], 3)
