"""Preprocessing equals the official code, from the image file to the labels."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import numpy.typing as npt
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.nn import functional

from navcore.errors import BadConfiguration, BadFrame
from navcore.perception.esanet.network.preprocess import (
    NYUV2_DEPTH,
    RGB_MEAN,
    RGB_STD,
    SUNRGBD_DEPTH,
    DepthStatistics,
    Size,
    check_size,
    normalise_depth,
    normalise_rgb,
    resize_depth,
    resize_rgb,
    to_tensors,
)
from navcore.perception.esanet.weights.class_names import NYUV2_CLASSES, SUNRGBD_CLASSES
from tests.navcore.laws import law
from tests.navcore.perception.esanet.goldens import arrays, data_file, filled

SIZE = Size(height=480, width=640)
DATA_SETS = {"nyuv2": (NYUV2_DEPTH, 0.1, 40), "sunrgbd": (SUNRGBD_DEPTH, 1.0, 37)}
"""Statistics, what the sample's depth is multiplied with, classes."""


def sample(scale: float) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """The official repository's sample picture, (424, 512, 3) and (424, 512), depth in data set
    units."""
    bgr = cv2.imread(str(data_file("samples/sample_rgb.png")), cv2.IMREAD_COLOR)
    depth = cv2.imread(str(data_file("samples/sample_depth.png")), cv2.IMREAD_UNCHANGED)
    assert bgr is not None
    assert depth is not None
    return np.ascontiguousarray(bgr[..., ::-1], dtype=np.uint8), np.asarray(
        depth, dtype=np.float32
    ) * np.float32(scale)


@pytest.mark.parametrize("data_set", DATA_SETS)
@pytest.mark.parametrize("raw", [True, False])
def test_the_tensors_are_the_official_ones(data_set: str, raw: bool) -> None:
    statistics, scale, _ = DATA_SETS[data_set]
    rgb, depth = to_tensors(*sample(scale), SIZE, dataclasses.replace(statistics, raw=raw))
    assert (rgb.shape, depth.shape, rgb.dtype, depth.dtype) == (
        (1, 3, 480, 640),
        (1, 1, 480, 640),
        torch.float32,
        torch.float32,
    )
    prefix = f"{data_set}/{'raw' if raw else 'refined'}/"
    golden = {
        key.removeprefix(prefix): value
        for key, value in arrays("golden_preproc_metric.npz").items()
    }
    batch, row, col = golden["positions"]
    np.testing.assert_allclose(rgb[batch, :, row, col].numpy(), golden["image"], atol=2e-6)
    np.testing.assert_allclose(depth[batch, 0, row, col].numpy(), golden["depth"], atol=2e-6)
    np.testing.assert_allclose(
        rgb.double().mean(dim=(0, 2, 3)).numpy(), golden["image_mean"], atol=1e-6
    )
    assert float(depth.double().mean()) == pytest.approx(float(golden["depth_mean"]), abs=1e-6)
    assert float((depth == 0).double().mean()) == float(golden["depth_zero_fraction"])


@pytest.mark.parametrize("data_set", DATA_SETS)
def test_from_picture_to_logits_the_numbers_are_the_official_ones(data_set: str) -> None:
    statistics, scale, num_classes = DATA_SETS[data_set]
    golden = arrays("golden_preproc_metric.npz")
    batch, row, col = golden[f"{data_set}/raw/e2e_positions"]
    expected = golden[f"{data_set}/raw/e2e_logits"]

    def logits(depth_as: DepthStatistics) -> npt.NDArray[np.float32]:
        with torch.inference_mode():
            small = filled("r34-nbt1d", num_classes)(*to_tensors(*sample(scale), SIZE, depth_as))
            full = functional.interpolate(
                small, size=(424, 512), mode="bilinear", align_corners=False
            )
        return np.asarray(full.numpy(), dtype=np.float32)

    found = logits(statistics)
    assert np.abs(found[batch, :, row, col] - expected).max() <= 1e-4 * found.std()
    # Processors round differently: the label may be another where two classes tie, and only there.
    official = golden[f"{data_set}/raw/e2e_argmax"]
    of_official = np.take_along_axis(found[0], official[None].astype(np.int64), axis=0)[0]
    assert (found[0].max(axis=0) - of_official).max() <= 2e-4 * found.std()
    assert np.mean(found[0].argmax(axis=0) != official) < 1e-4
    if data_set == "nyuv2":  # the control: without the rule for missing depth the comparison fails
        wrong = logits(dataclasses.replace(statistics, raw=False))
        assert np.abs(wrong[batch, :, row, col] - expected).max() > 100 * 1e-4 * found.std()


@law(40)
@given(st.floats(0.0, 60_000.0), st.booleans())
def test_depth_is_centred_and_only_missing_raw_depth_becomes_the_mean(
    depth: float, raw: bool
) -> None:
    statistics = dataclasses.replace(SUNRGBD_DEPTH, raw=raw)
    (value,) = normalise_depth(np.full((1, 1), depth, dtype=np.float32), statistics).ravel()
    expected = 0.0 if raw and np.float32(depth) == 0 else (depth - statistics.mean) / statistics.std
    assert value == pytest.approx(expected, abs=1e-5)
    if raw and depth == 0:
        assert value == 0.0


@law(40)
@given(st.tuples(st.integers(0, 255), st.integers(0, 255), st.integers(0, 255)))
def test_colours_come_back_from_normalisation(colour: tuple[int, int, int]) -> None:
    normalised = normalise_rgb(np.array([[colour]], dtype=np.uint8))
    back = (normalised * RGB_STD + RGB_MEAN) * 255
    np.testing.assert_allclose(back[0, 0], colour, atol=1e-3)


def test_resized_depth_invents_no_distance() -> None:
    depth = np.array([[0.0, 1000.0], [3000.0, 0.0]], dtype=np.float32)
    assert set(np.unique(resize_depth(depth, Size(height=64, width=96)))) == {0.0, 1000.0, 3000.0}


def test_the_arrays_given_stay_as_they_were() -> None:
    rgb, depth = np.full((32, 32, 3), 7, dtype=np.uint8), np.zeros((32, 32), dtype=np.float32)
    to_tensors(rgb, depth, Size(height=32, width=32), NYUV2_DEPTH)
    assert (rgb == 7).all()
    assert (depth == 0).all()


def test_pictures_of_another_shape_or_type_are_refused() -> None:
    with pytest.raises(BadFrame, match="rgb"):
        resize_rgb(np.zeros((4, 4), dtype=np.uint8), SIZE)
    with pytest.raises(BadFrame, match="rgb"):
        resize_rgb(np.zeros((0, 4, 3), dtype=np.uint8), SIZE)
    with pytest.raises(BadFrame, match="depth"):
        resize_depth(np.zeros((4, 4, 1), dtype=np.float32), SIZE)
    with pytest.raises(BadFrame, match="depth"):
        resize_depth(np.zeros((4, 4), dtype=np.uint16), SIZE)


@pytest.mark.parametrize(
    ("height", "width"), [(240, 320), (480, 650), (0, 640), (480, -32), (480, 4128), (480.0, 640)]
)
def test_a_working_size_the_network_cannot_take_is_refused(height: int, width: int) -> None:
    with pytest.raises(BadConfiguration, match="multiple of 32"):
        check_size(Size(height=height, width=width), 32)


def test_the_public_data_sets_have_their_classes() -> None:
    assert len(set(NYUV2_CLASSES)) == 40
    assert len(set(SUNRGBD_CLASSES)) == 37
