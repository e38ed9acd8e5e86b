"""The network's shapes, sizes, widths and beginnings; what it refuses."""

from __future__ import annotations

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor, nn
from torch.nn import functional

from navcore.errors import BadConfiguration, BadFrame
from navcore.perception.esanet import EsaNet, build
from navcore.perception.esanet.network.blocks import Bottleneck
from navcore.perception.esanet.network.decoder import LearnedUpsampling
from navcore.perception.esanet.network.variants import VARIANTS
from tests.navcore.laws import law

SLIM = 1 / 8
NAMES = [variant.name for variant in VARIANTS]


def images(count: int, height: int, width: int) -> tuple[Tensor, Tensor]:
    random = torch.Generator().manual_seed(height * width)
    return torch.randn(count, 3, height, width, generator=random), torch.randn(
        count, 1, height, width, generator=random
    )


def slim(variant: str = "r18-nbt1d", num_classes: int = 4) -> EsaNet:
    torch.manual_seed(0)
    return build(variant, num_classes, width=SLIM).eval()


@law(12)
@given(
    st.sampled_from(NAMES),
    st.integers(1, 3),
    st.integers(1, 5),
    st.integers(1, 5),
    st.integers(1, 9),
)
def test_every_variant_takes_every_multiple_of_32(
    variant: str, count: int, rows: int, cols: int, num_classes: int
) -> None:
    height, width = 32 * rows, 32 * cols
    with torch.inference_mode():
        logits = slim(variant, num_classes)(*images(count, height, width))
    assert logits.shape == (count, num_classes, height, width)
    assert bool(torch.isfinite(logits).all())


@pytest.mark.parametrize("variant", NAMES)
def test_in_training_the_side_outputs_come_too_and_every_weight_learns(variant: str) -> None:
    network = slim(variant).train()
    outputs = network(*images(2, 64, 96))
    assert [tuple(output.shape) for output in outputs] == [
        (2, 4, 64, 96),
        (2, 4, 8, 12),
        (2, 4, 4, 6),
        (2, 4, 2, 3),
    ]
    torch.autograd.backward([output.square().mean() for output in outputs])
    assert all(parameter.grad is not None for parameter in network.parameters())


def test_a_picture_is_labelled_alike_alone_and_in_a_batch() -> None:
    network, (rgb, depth) = slim(), images(3, 96, 64)
    with torch.inference_mode():
        together = network(rgb, depth)
        for number in range(3):
            alone = network(rgb[number : number + 1], depth[number : number + 1])
            assert bool(((together[number] - alone[0]).abs() <= 1e-4 * alone.std()).all())


# Without the classifier, torchvision's ResNet 18, 34 and 50 have this many parameters and keys.
@pytest.mark.parametrize(
    ("variant", "parameters", "keys"),
    [("r18", 11_176_512, 120), ("r34", 21_284_672, 216), ("r50", 23_508_032, 318)],
)
def test_the_encoders_are_torchvisions(variant: str, parameters: int, keys: int) -> None:
    encoder = build(variant, 2).encoder_rgb
    assert sum(parameter.numel() for parameter in encoder.parameters()) == parameters
    assert len(encoder.state_dict()) == keys


def test_the_middle_convolution_of_a_bottleneck_carries_the_stride() -> None:
    network = slim("r50")
    for number, stride in ((1, 1), (2, 2), (3, 2), (4, 2)):
        first = network.encoder_rgb.get_submodule(f"layer{number}.0")
        assert isinstance(first, Bottleneck)
        assert [first.conv1.stride, first.conv2.stride, first.conv3.stride] == [
            (1, 1),
            (stride, stride),
            (1, 1),
        ]
    shapes = {key: tuple(value.shape) for key, value in build("r50", 2).state_dict().items()}
    assert shapes["se_layer4.se_rgb.fc.0.weight"] == (128, 2048, 1, 1)
    assert shapes["skip_layer3.0.conv.weight"] == (512, 1024, 1, 1)
    assert shapes["context_module.features.1.1.conv.weight"] == (1024, 2048, 1, 1)
    assert shapes["context_module.final_conv.conv.weight"] == (512, 4096, 1, 1)


@pytest.mark.long
@pytest.mark.parametrize("width", [1 / 8, 0.5, 0.625, 1.0, 1.25])
def test_width_scales_every_map_of_features_and_no_map_of_classes(width: float) -> None:
    full, other = (
        build("r18-nbt1d", 7).state_dict(),
        build("r18-nbt1d", 7, width=width).state_dict(),
    )
    assert list(full) == list(other)
    for key in full:
        if "conv1.weight" in key and full[key].shape[1] > 3:
            assert other[key].shape[:2] == (full[key].shape[0] * width, full[key].shape[1] * width)
    assert other["encoder_rgb.conv1.weight"].shape == (64 * width, 3, 7, 7)
    assert other["decoder.conv_out.weight"].shape == (7, 128 * width, 3, 3)
    assert other["decoder.decoder_module_1.side_output.bias"].shape == (7,)


@pytest.mark.parametrize(
    "width", [0, -1.0, 0.1, 1 / 16, 2.125, math.nan, math.inf, "1", True, None]
)
def test_a_width_that_leaves_no_whole_channels_is_refused(width: float) -> None:
    with pytest.raises(BadConfiguration, match="width"):
        build("r18", 4, width=width)


@pytest.mark.parametrize("variant", ["", "R18", "r101", "r18_nbt1d", "r50-nbt1d", "x" * 10_000])
def test_an_unknown_variant_is_refused_naming_the_known_ones(variant: str) -> None:
    with pytest.raises(BadConfiguration) as refusal:
        build(variant, 4)
    assert all(name in str(refusal.value) for name in NAMES)
    assert len(str(refusal.value)) < 300


@pytest.mark.parametrize("num_classes", [0, -1, 256, 2.0, True, "4"])
def test_a_number_of_classes_that_no_byte_can_count_is_refused(num_classes: int) -> None:
    with pytest.raises(BadConfiguration, match="num_classes"):
        build("r18", num_classes)


@pytest.mark.parametrize(
    ("rgb", "depth", "says"),
    [
        ((1, 3, 240, 320), (1, 1, 240, 320), "multiples of 32"),
        ((1, 3, 64, 48), (1, 1, 64, 48), "multiples of 32"),
        ((1, 3, 0, 64), (1, 1, 0, 64), "multiples of 32"),
        ((0, 3, 64, 64), (0, 1, 64, 64), "at least one"),
        ((1, 3, 64, 64), (1, 1, 64, 96), "differ"),
        ((2, 3, 64, 64), (1, 1, 64, 64), "differ"),
        ((1, 4, 64, 64), (1, 1, 64, 64), "rgb has shape"),
        ((1, 3, 64, 64), (1, 3, 64, 64), "depth has shape"),
        ((3, 64, 64), (1, 64, 64), "rgb has shape"),
    ],
)
def test_pictures_that_do_not_fit_are_refused_with_their_shape(
    rgb: tuple[int, ...], depth: tuple[int, ...], says: str
) -> None:
    with pytest.raises(BadFrame, match=says):
        slim()(torch.zeros(rgb), torch.zeros(depth))


def test_a_picture_that_was_not_normalised_is_refused() -> None:
    with pytest.raises(BadFrame, match="preprocess"):
        slim()(torch.zeros(1, 3, 64, 64, dtype=torch.uint8), torch.zeros(1, 1, 64, 64))


def test_learned_upsampling_starts_as_bilinear_interpolation() -> None:
    x = torch.randn(2, 5, 6, 7, generator=torch.Generator().manual_seed(1))
    with torch.inference_mode():
        learned = LearnedUpsampling(5)(x)
    bilinear = functional.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)
    torch.testing.assert_close(learned[..., 1:-1, 1:-1], bilinear[..., 1:-1, 1:-1])
    assert not torch.allclose(
        learned, bilinear
    )  # the border is padded with zeros, as the official network has it


@pytest.mark.parametrize("num_classes", [5, 64])
def test_he_initialisation_reaches_what_a_relu_follows_and_nothing_else(num_classes: int) -> None:
    torch.manual_seed(0)
    network = build("r18-nbt1d", num_classes)
    for name, module in network.named_modules():
        if isinstance(module, nn.BatchNorm2d):
            assert bool((module.weight == 1).all())
            assert bool((module.bias == 0).all())
        if isinstance(module, nn.Conv2d):
            kernel, he = module.weight, math.sqrt(2.0 / (module.weight[:, 0].numel()))
            if "upsample" in name:
                assert bool((kernel == kernel[0]).all())
                assert kernel[0, 0].tolist() == [
                    [1 / 16, 1 / 8, 1 / 16],
                    [1 / 8, 1 / 4, 1 / 8],
                    [1 / 16, 1 / 8, 1 / 16],
                ]
            elif "side_output" in name or "conv_out" in name or ".fc.2" in name:
                assert kernel.abs().max().item() <= 1 / math.sqrt(
                    kernel[0].numel()
                )  # torch's own: uniform, fan-in
            else:
                assert kernel.detach().std().item() == pytest.approx(he, rel=0.15), name
