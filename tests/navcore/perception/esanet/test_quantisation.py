"""Eight bits: which convolutions, how they round, and that an engine computes what torch says it
should."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from navcore.errors import BadConfiguration
from navcore.perception.esanet.inference.network_file import open_network
from navcore.perception.esanet.inference.onnx_engines import OpenVinoInference
from navcore.perception.esanet.inference.selection import open_inference, probe_images
from navcore.perception.esanet.inference.torch_engine import TorchInference
from navcore.perception.esanet.network.batchnorm_folding import folded
from navcore.perception.esanet.network.preprocess import NYUV2_DEPTH
from navcore.perception.esanet.network.quantisation import (
    ByteConvolution,
    convolutions,
    measured_ranges,
    quantised,
)
from navcore.perception.esanet.weights.weights_file import WeightsCard, load, save
from tests.navcore.perception.esanet.test_inference import (
    NAMES,
    SIZE,
    needs_openvino,
    network,
    network_file,
)

CARD = WeightsCard(
    variant="r18-nbt1d",
    num_classes=4,
    width=1 / 8,
    class_names=NAMES,
    depth=NYUV2_DEPTH,
    source_sha256="0" * 64,
    size=SIZE,
)


def ranges() -> tuple[float, ...]:
    images = [
        (torch.from_numpy(rgb), torch.from_numpy(depth))
        for rgb, depth in probe_images(SIZE, NYUV2_DEPTH)
    ]
    return measured_ranges(network(), images)


def test_only_what_follows_a_relu_works_on_bytes() -> None:
    made = quantised(network(), ranges())
    names = {name for name, module in made.named_modules() if isinstance(module, ByteConvolution)}
    assert "encoder_rgb.layer1.0.conv3x1_1" in names
    assert "encoder_depth.layer4.1.conv1x3_2" in names
    assert "skip_layer1.0.conv" in names
    plain = {name for name, module in made.named_modules() if isinstance(module, nn.Conv2d)} - {
        f"{n}.convolution" for n in names
    }
    assert {"encoder_rgb.conv1", "encoder_depth.conv1", "decoder.upsample2.conv"} <= plain
    assert all(".fc." not in name and "side_output" not in name for name in names)
    assert not any(isinstance(module, ByteConvolution) for module in network().modules())


def test_a_convolution_rounds_its_inputs_and_each_kernel_to_bytes_and_cuts_off_what_is_beyond() -> (
    None
):
    plain = nn.Conv2d(1, 2, 1)
    with torch.no_grad():
        plain.weight[:] = torch.tensor([[[[1.0]]], [[[-0.1]]]])
        plain.bias = nn.Parameter(torch.tensor([0.5, 0.0]))
    x = torch.tensor([[[[0.0, 0.299, 1.0, 7.0]]]])
    first, second = ByteConvolution(plain, most=1.0)(x)[0, :, 0].detach().numpy()
    np.testing.assert_allclose(first, [0.5, 0.5 + 76 / 255, 1.5, 1.5], atol=1e-6)
    np.testing.assert_allclose(second, [0.0, -0.1 * 76 / 255, -0.1, -0.1], atol=1e-6)


def test_ranges_of_another_network_are_refused() -> None:
    with pytest.raises(BadConfiguration, match="3 ranges for"):
        quantised(network(), (1.0, 2.0, 3.0))


def test_ranges_are_kept_with_the_weights_and_files_without_them_still_load(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    save(network(), CARD, path)
    assert (load(path).card.ranges, open_network(path, camera=SIZE).ranges) == (None, None)
    save(network(), dataclasses.replace(CARD, ranges=ranges()), path)
    assert load(path).card.ranges == open_network(path, camera=SIZE).ranges == ranges()
    for bad, why in (((-1.0,), "out of range"), ((1.0, 2.0, 3.0), "3 ranges for")):
        save(network(), dataclasses.replace(CARD, ranges=bad), path)
        with pytest.raises(BadConfiguration, match=why):
            load(path)


def test_a_range_leaves_out_the_few_largest_inputs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "navcore.perception.esanet.network.quantisation.KEPT", 0.99
    )  # the maps of this network are small
    rgb, depth = (torch.from_numpy(batch) for batch in probe_images(SIZE, NYUV2_DEPTH)[0])
    folded_network = folded(network())
    convolution = folded_network.get_submodule("skip_layer1.0.conv")
    seen: list[torch.Tensor] = []
    convolution.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0].clone()))
    with torch.inference_mode():
        folded_network(rgb, depth)
    names = [name for name, _ in convolutions(folded_network)]
    most = measured_ranges(network(), [(rgb, depth)])[names.index("skip_layer1.0.conv")]
    beyond = float((seen[0] > most).float().mean())
    assert 0.005 < beyond < 0.015


@needs_openvino
def test_openvino_computes_in_eight_bits_and_rounds_no_more_than_that() -> None:
    engine, _ = open_inference(network_file(ranges=ranges()), "openvino int8", threads=1)
    assert isinstance(engine, OpenVinoInference)
    as_if, exact = TorchInference(quantised(network(), ranges())), TorchInference(network())
    for image in probe_images(SIZE, NYUV2_DEPTH):
        answer, expected, plain = (one.logits(*image).copy() for one in (engine, as_if, exact))
        lost = [
            float(np.abs(rounded - plain).mean() / plain.std()) for rounded in (expected, answer)
        ]
        assert all(0.005 < share < 0.06 for share in lost)
    layers = [
        one.get_rt_info()
        for one in engine._request.get_compiled_model().get_runtime_model().get_ops()
    ]
    in_bytes = [
        one
        for one in layers
        if (one["layerType"].value, one["runtimePrecision"].value) == ("Convolution", "u8")
    ]
    assert len(in_bytes) == sum(most > 0 for most in ranges())


@needs_openvino
def test_without_ranges_there_is_no_engine_of_eight_bits() -> None:
    with pytest.raises(BadConfiguration, match="openvino int8 is not installed"):
        open_inference(network_file(), "openvino int8", threads=1)
