"""The network is the official one: same keys, same shapes, same numbers; and the comparison would
notice if it were not."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional

from navcore.perception.esanet import EsaNet, build
from navcore.perception.esanet.network import decoder, fusion, model
from navcore.perception.esanet.network import pyramid_pooling as context
from navcore.perception.esanet.network.blocks import NonBottleneck1D
from tests.navcore.perception.esanet.goldens import (
    OFFICIAL,
    arrays,
    filled,
    fresh,
    inputs,
    run,
    table,
)

STRICT = 1e-4
"""Of the logits' standard deviation; float32 noise is a tenth of it, the smallest mistake 380 times
as much."""


@pytest.mark.parametrize(
    ("variant", "num_classes"),
    [("r18", 40), ("r18-nbt1d", 40), ("r34-nbt1d", 37), ("r34-nbt1d", 40)],
)
def test_keys_shapes_and_their_order_are_the_official_ones(variant: str, num_classes: int) -> None:
    golden = table(f"state_dict_{OFFICIAL[variant]}_c{num_classes}.json")
    network = build(variant, num_classes)
    (expected,) = (value for value in golden.values() if isinstance(value, list))
    found = [
        [key, list(value.shape), str(value.dtype).removeprefix("torch.")]
        for key, value in network.state_dict().items()
    ]
    assert found == expected
    assert sum(parameter.numel() for parameter in network.parameters()) == golden["n_params"]


@pytest.mark.parametrize(
    ("variant", "num_classes", "size"),
    [
        ("r18", 40, "1x256x320"),
        ("r18", 40, "1x480x640"),
        ("r18", 5, "1x256x320"),
        ("r18-nbt1d", 40, "1x256x320"),
        ("r18-nbt1d", 40, "1x480x640"),
        ("r34-nbt1d", 37, "1x480x640"),
        ("r34-nbt1d", 40, "1x256x320"),
        ("r34-nbt1d", 40, "1x480x640"),
        ("r34-nbt1d", 40, "2x288x416"),
    ],
)
def test_logits_are_the_official_ones(variant: str, num_classes: int, size: str) -> None:
    name = f"{OFFICIAL[variant]}_c{num_classes}"
    golden = {
        key.removeprefix(f"{size}/"): value
        for key, value in arrays(f"golden_{name}.npz").items()
        if key.startswith(size)
    }
    scale = table("noise.json")[f"{name}_{size}"]["out_std"]
    rgb, depth = inputs(size)
    middle = depth[0, 0, depth.shape[2] // 2, depth.shape[3] // 2]
    checks = [rgb.double().sum(), depth.double().sum(), rgb[0, 0, 0, 0], middle]
    np.testing.assert_allclose(
        np.array([float(value) for value in checks]), golden["input_checks"], rtol=1e-9
    )

    logits = run(filled(variant, num_classes), size)
    batch, row, col = golden["positions"]
    for reference in ("logits_f32", "logits_f64ref"):
        assert np.abs(logits[batch, :, row, col] - golden[reference]).max() <= STRICT * scale
    winners = logits.argmax(axis=1)
    np.testing.assert_array_equal(winners[:, ::4, ::4], golden["argmax_every4"])
    np.testing.assert_array_equal(
        np.bincount(winners.ravel(), minlength=num_classes), golden["argmax_hist"]
    )
    np.testing.assert_allclose(
        logits.mean(axis=(0, 2, 3), dtype=np.float64), golden["class_mean"], atol=STRICT * scale
    )
    np.testing.assert_allclose(
        logits.std(axis=(0, 2, 3), dtype=np.float64), golden["class_std"], atol=STRICT * scale
    )


def test_memory_format_changes_nothing_but_the_speed() -> None:
    network = fresh("r18-nbt1d", 5)
    plain = run(network, "1x128x160")
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    assert np.abs(run(network, "1x128x160") - plain).max() <= 3 * STRICT * plain.std()


# What typical mistakes cost, measured on the official network: the goldens would show every one of
# them.

Patch = Callable[[EsaNet, pytest.MonkeyPatch], None]


def decoder_epsilon(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
    for module in network.decoder.modules():
        if isinstance(module, NonBottleneck1D):
            module.bn1.eps = module.bn2.eps = 1e-5


def one_epsilon(value: float) -> Patch:
    def mutate(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
        for module in network.modules():
            if isinstance(module, nn.BatchNorm2d):
                module.eps = value

    return mutate


def bilinear_context(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(
        context,
        "enlarge",
        lambda x, like: functional.interpolate(
            x, like.shape[2:], mode="bilinear", align_corners=False
        ),
    )


def bilinear_upsampling(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
    def forward(self: decoder.LearnedUpsampling, x: Tensor) -> Tensor:
        return self.conv(  # type: ignore[no-any-return]
            functional.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)
        )

    patch.setattr(decoder.LearnedUpsampling, "forward", forward)


def replication_padding(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
    for module in network.modules():
        if isinstance(module, decoder.LearnedUpsampling):
            module.conv.padding_mode = "replicate"


def no_weighting(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(fusion.SqueezeExcite, "forward", lambda self, x: x)


def no_weighting_at_the_stem(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(network.get_submodule("se_layer0"), "forward", lambda rgb, depth: rgb + depth)


def pool_before_fusion(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
    fuse = network.get_submodule("se_layer0").forward
    patch.setattr(
        network.get_submodule("se_layer0"),
        "forward",
        lambda rgb, depth: fuse(POOL(rgb), POOL(depth)),
    )
    patch.setattr(model, "max_pool", lambda x: x if x.shape[2] == 64 else POOL(x))


def colour_leaks_into_depth(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
    handed_on: list[Tensor] = []
    stage_of_rgb, stage_of_depth = network.encoder_rgb.stage, network.encoder_depth.stage

    def remember(number: int, x: Tensor) -> Tensor:
        handed_on.append(x)
        return stage_of_rgb(number, x)

    patch.setattr(network.encoder_rgb, "stage", remember)
    patch.setattr(
        network.encoder_depth,
        "stage",
        lambda number, x: stage_of_depth(number, x if number == 1 else handed_on[-1]),
    )


def skips_of_rgb(network: EsaNet, patch: pytest.MonkeyPatch) -> None:
    for number in (1, 2, 3):
        fusing, skip = (
            network.get_submodule(f"se_layer{number}"),
            network.get_submodule(f"skip_layer{number}"),
        )
        _skip_from_rgb(fusing, skip, patch)


def _skip_from_rgb(fusing: nn.Module, skip: nn.Module, patch: pytest.MonkeyPatch) -> None:
    seen: list[Tensor] = []
    fuse, convolve = fusing.forward, skip.forward

    def remember(rgb: Tensor, depth: Tensor) -> Tensor:
        seen.append(rgb)
        return fuse(rgb, depth)  # type: ignore[no-any-return]

    patch.setattr(fusing, "forward", remember)
    patch.setattr(skip, "forward", lambda fused: convolve(seen[-1]))


POOL = model.max_pool
SIZE = "1x256x320"
MUTATIONS: dict[str, Patch] = {
    "BN eps 1e-3 everywhere": one_epsilon(1e-3),
    "BN eps 1e-5 everywhere": one_epsilon(1e-5),
    "decoder NBt1D eps 1e-5": decoder_epsilon,
    "context bilinear instead of nearest": bilinear_context,
    "decoder upsample bilinear before the 3x3": bilinear_upsampling,
    "replication padding in learned upsampling": replication_padding,
    "no SE weighting": no_weighting,
    "SE missing only at stem": no_weighting_at_the_stem,
    "max-pool before the stem fusion": pool_before_fusion,
    "fused features also into the depth encoder": colour_leaks_into_depth,
    "skips from rgb before fusion": skips_of_rgb,
}


@pytest.fixture(name="patch")
def _patch() -> Iterator[pytest.MonkeyPatch]:
    with pytest.MonkeyPatch.context() as patch:
        yield patch


@pytest.mark.long
@pytest.mark.parametrize("mistake", MUTATIONS)
def test_a_typical_mistake_costs_what_it_costs_the_official_network(
    mistake: str, patch: pytest.MonkeyPatch
) -> None:
    variant = "r34-nbt1d" if mistake == "BN eps 1e-5 everywhere" else "r18"
    largest, mean, _ = table("mutations.json")[f"{OFFICIAL[variant]}: {mistake}"]
    right = run(filled(variant, 40), SIZE)
    network = fresh(variant, 40)
    MUTATIONS[mistake](network, patch)
    error = np.abs(run(network, SIZE) - right) / right.std()
    assert error.max() > 100 * STRICT
    np.testing.assert_allclose([error.max(), error.mean()], [largest, mean], rtol=0.02)


def test_colours_in_the_wrong_order_cost_what_they_cost_the_official_network() -> None:
    largest, mean, _ = table("mutations.json")["r18_basic: BGR instead of RGB"]
    right = run(filled("r18", 40), SIZE)
    rgb, depth = inputs(SIZE)
    with torch.inference_mode():
        error = np.abs(filled("r18", 40)(rgb.flip(1), depth).numpy() - right) / right.std()
    np.testing.assert_allclose([error.max(), error.mean()], [largest, mean], rtol=0.02)
