"""Architecture of a state dict: inferred from its keys and shapes, then checked in full."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from navcore.errors import BadConfiguration
from navcore.perception.esanet.network.blocks import (
    BasicBlock,
    Bottleneck,
    NonBottleneck1D,
    ResidualBlock,
)
from navcore.perception.esanet.network.model import EsaNet
from navcore.perception.esanet.network.variants import (
    BASE_CHANNELS,
    VARIANTS,
    Variant,
    variant_named,
)

_SHOWN = 3
"""Number of mismatching keys that are named in an error."""
_STEM = "encoder_rgb.conv1.weight"
_OUTPUT = "decoder.conv_out.bias"


@dataclass(frozen=True, slots=True, kw_only=True)
class Architecture:
    """The arguments of `build`."""

    variant: str
    """Name of the variant."""
    num_classes: int
    """Number of outputs per pixel."""
    width: float
    """Number of channels relative to the paper."""

    def skeleton(self) -> EsaNet:
        """Return the network without memory for its weights (torch's meta device)."""
        with torch.device("meta"):
            return EsaNet(variant_named(self.variant), self.num_classes, width=self.width)

    def class_tensors(self) -> set[str]:
        """Return the keys of the tensors with a row per class, whose shape depends on the number of
        classes: what makes classes of the features."""
        more = replace(self, num_classes=self.num_classes + 1).skeleton().state_dict()
        return {
            key
            for key, tensor in self.skeleton().state_dict().items()
            if tensor.shape != more[key].shape
        }


def infer_architecture(tensors: Mapping[str, Tensor], where: str) -> Architecture:
    """Return the architecture of a state dict; raises `BadConfiguration` unless `build` can make
    it."""
    for key, dimensions in ((_STEM, 4), (_OUTPUT, 1)):
        if key not in tensors or tensors[key].ndim != dimensions:
            raise BadConfiguration(
                f"{where}: not an RGB-D ESANet: {key!r} is missing or has the wrong shape"
            )
    if "context_module.features.0.conv.weight" in tensors:
        raise BadConfiguration(
            f"{where}: its context module is `appm` (Cityscapes), which is not supported; "
            "expected `ppm`"
        )
    return Architecture(
        variant=_variant(tensors, where).name,
        num_classes=tensors[_OUTPUT].shape[0],
        width=tensors[_STEM].shape[0] / BASE_CHANNELS,
    )


def network_with(architecture: Architecture, tensors: Mapping[str, Tensor], where: str) -> EsaNet:
    """Return the network with the tensors as its weights, in eval mode, without a copy.

    Raises `BadConfiguration` naming what is missing, unknown, of another shape or type, or not
    finite.
    """
    try:
        network = architecture.skeleton()
    except BadConfiguration as error:
        raise BadConfiguration(f"{where}: {error}") from None
    expected = network.state_dict()
    wrong = [f"{key} is missing" for key in expected if key not in tensors]
    wrong += [f"{key} is unknown" for key in tensors if key not in expected]
    wrong += [_mismatch(key, expected[key], tensors[key]) for key in expected if key in tensors]
    _refuse(where, architecture, [text for text in wrong if text])
    # Only after the shapes: a hostile tensor of few bytes can claim a shape that fills the memory
    # when its values are checked.
    _refuse(
        where,
        architecture,
        [f"{key} holds non-finite values" for key in expected if not _is_finite(tensors[key])],
    )
    network.load_state_dict(dict(tensors), assign=True)
    return network.eval()


def _refuse(where: str, architecture: Architecture, wrong: list[str]) -> None:
    if wrong:
        more = f" and {len(wrong) - _SHOWN} more" if len(wrong) > _SHOWN else ""
        raise BadConfiguration(
            f"{where}: does not fit {architecture}: {'; '.join(wrong[:_SHOWN])}{more}"
        )


def _mismatch(key: str, expected: Tensor, given: Tensor) -> str:
    if (given.shape, given.dtype) == (expected.shape, expected.dtype):
        return ""
    return (
        f"{key} is {given.dtype} {tuple(given.shape)}, "
        f"expected {expected.dtype} {tuple(expected.shape)}"
    )


def _is_finite(tensor: Tensor) -> bool:
    return bool(torch.isfinite(tensor).all())


def _variant(tensors: Mapping[str, Tensor], where: str) -> Variant:
    block, blocks = _block(tensors), _blocks_per_stage(tensors)
    for variant in VARIANTS:
        if (variant.block, variant.blocks) == (block, blocks):
            return variant
    known = ", ".join(
        f"{variant.name} {variant.block.__name__} {variant.blocks}" for variant in VARIANTS
    )
    raise BadConfiguration(
        f"{where}: no known encoder has {block.__name__} × {blocks}; known: {known}"
    )


def _block(tensors: Mapping[str, Tensor]) -> type[ResidualBlock]:
    if "encoder_rgb.layer1.0.conv3x1_1.weight" in tensors:
        return NonBottleneck1D
    return Bottleneck if "encoder_rgb.layer1.0.conv3.weight" in tensors else BasicBlock


def _blocks_per_stage(tensors: Mapping[str, Tensor]) -> tuple[int, ...]:
    found = {tuple(key.split(".")[1:3]) for key in tensors if key.startswith("encoder_rgb.layer")}
    return tuple(
        len({block for stage, block in found if stage == f"layer{number}"})
        for number in (1, 2, 3, 4)
    )
