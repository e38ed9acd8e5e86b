"""Weights files: trained networks as safetensors with a card and a checksum.

The metadata of a file is a card (variant, classes, width, depth statistics, source) and the SHA-256
of the card and all tensors. Loading executes nothing and trusts nothing.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from safetensors import SafetensorError
from torch import Tensor

from navcore.errors import BadConfiguration
from navcore.files import read_whole, write_whole
from navcore.perception.esanet.network.limits import MAX_CLASSES
from navcore.perception.esanet.network.model import EsaNet
from navcore.perception.esanet.network.preprocess import (
    NYUV2_DEPTH,
    SUNRGBD_DEPTH,
    DepthStatistics,
    Size,
)
from navcore.perception.esanet.network.quantisation import convolutions
from navcore.perception.esanet.weights.architecture import (
    Architecture,
    infer_architecture,
    network_with,
)
from navcore.perception.esanet.weights.class_names import NYUV2_CLASSES, SUNRGBD_CLASSES
from navcore.perception.esanet.weights.official_checkpoint import read_checkpoint
from navcore.toml_config import from_table, ranged

MAX_WEIGHTS_BYTES = 2 << 30
"""Largest size of a weights file; a width of 2 in the largest variant fits."""
MAX_HEADER_BYTES = 1 << 20
SUFFIX = ".safetensors"
_FORMAT = "bewarenav-esanet-1"
_KERNEL_DIMENSIONS = 4
_DATA_SETS = {40: (NYUV2_CLASSES, NYUV2_DEPTH), 37: (SUNRGBD_CLASSES, SUNRGBD_DEPTH)}
"""Class names and depth statistics by number of classes, because the public checkpoints do not
state their data set."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightsCard:
    """Description of trained weights that is needed to use them."""

    variant: str
    """Name of the variant, as `build` takes it."""
    num_classes: int = ranged(1, MAX_CLASSES)
    """Number of outputs per pixel."""
    width: float = ranged(0.0, 8.0)
    """Number of channels relative to the paper."""
    class_names: tuple[str, ...]
    """Class names of the outputs, in their order."""
    depth: DepthStatistics
    """Depth statistics of the training data."""
    source_sha256: str
    """SHA-256 of the converted checkpoint, or identity of the training run; hexadecimal."""
    size: Size | None = None
    """Working size of the training; None in converted and older files."""
    ranges: tuple[float, ...] | None = ranged(0.0, 1e9, default=None)
    """Largest inputs of the convolutions, for eight bits (`network/quantisation.py`); None if they
    were not measured."""

    def __post_init__(self) -> None:
        if len(self.class_names) != self.num_classes:
            raise BadConfiguration(
                f"weights: {len(self.class_names)} class names for {self.num_classes} classes"
            )
        folded = [name.strip().casefold() for name in self.class_names]
        if "" in folded or len(set(folded)) != len(folded):
            raise BadConfiguration(
                "weights: class names must be unique and not empty, "
                f"got {', '.join(self.class_names):.400}"
            )
        if not re.fullmatch("[0-9a-f]{64}", self.source_sha256):
            raise BadConfiguration(
                f"weights: source_sha256 is {self.source_sha256!r:.80}, "
                "expected 64 hexadecimal digits"
            )

    @property
    def architecture(self) -> Architecture:
        """The architecture to build."""
        return Architecture(variant=self.variant, num_classes=self.num_classes, width=self.width)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrainedNetwork:
    """A network with its card."""

    network: EsaNet
    """The network, in eval mode."""
    card: WeightsCard
    """Classes, depth statistics and working size of the network."""
    sha256: str = ""
    """SHA-256 of the file that it was read from, hexadecimal; empty for none."""


def convert(
    source: Path,
    target: Path,
    *,
    class_names: Sequence[str] | None = None,
    depth: DepthStatistics | None = None,
) -> WeightsCard:
    """Convert the official checkpoint `source` to the safetensors file `target`; return its card.

    Variant, classes and width are inferred from keys and shapes. 40 classes are taken for NYUv2,
    37 for SUN RGB-D, unless `class_names` and `depth` are given. Raises `BadConfiguration` or
    `StorageFailed`.
    """
    checkpoint = read_checkpoint(source)
    architecture = infer_architecture(checkpoint.tensors, str(source))
    network = network_with(architecture, checkpoint.tensors, str(source))
    known_names, known_depth = _DATA_SETS.get(architecture.num_classes, (None, None))
    names, statistics = class_names or known_names, depth or known_depth
    if names is None or statistics is None:
        raise BadConfiguration(
            f"{source}: {architecture.num_classes} classes match no public data set "
            "(40: NYUv2, 37: SUN RGB-D); give class_names and depth"
        )
    card = WeightsCard(
        variant=architecture.variant,
        num_classes=architecture.num_classes,
        width=architecture.width,
        class_names=tuple(names),
        depth=statistics,
        source_sha256=checkpoint.sha256,
    )
    save(network, card, target)
    return card


def save(network: EsaNet, card: WeightsCard, target: Path, *, half: bool = False) -> None:
    """Write a network with its card, replacing `target` atomically.

    With `half` the kernels of the convolutions, nearly all of the weights, are stored in half
    precision. Raises `BadConfiguration` if network and card do not match, `StorageFailed` if the
    file cannot be written.
    """
    check_name(target)
    tensors = {
        key: value.detach().cpu().contiguous() for key, value in network.state_dict().items()
    }
    network_with(card.architecture, tensors, str(target))
    if half:
        tensors = {key: _halved(value) for key, value in tensors.items()}
    metadata = _as_metadata(card)
    content = safetensors.torch.save(tensors, {**metadata, "sha256": digest(tensors, metadata)})
    write_whole(target, content)


def check_name(target: Path) -> None:
    """Raise `BadConfiguration` unless the name ends in `.safetensors`."""
    if target.suffix != SUFFIX:
        raise BadConfiguration(f"{target}: expected a name ending in {SUFFIX}")


def load(path: Path) -> TrainedNetwork:
    """Read a file of `save` or `convert`; raises `BadConfiguration` naming the file and the
    defect."""
    content = read_whole(path, at_most=MAX_WEIGHTS_BYTES)
    metadata = _metadata(content, path)
    claimed = metadata.pop("sha256", "")
    try:
        tensors = safetensors.torch.load(content)
    except (SafetensorError, ValueError, TypeError, KeyError, RuntimeError) as error:
        raise BadConfiguration(f"{path}: the weights are damaged: {error!s:.200}") from None
    if digest(tensors, metadata) != claimed:
        raise BadConfiguration(
            f"{path}: the weights are damaged: their SHA-256 is not the one in the file; "
            "convert them again"
        )
    card = _from_metadata(metadata, path)
    tensors = {
        key: value.float() if value.dtype is torch.float16 else value
        for key, value in tensors.items()
    }
    network = network_with(card.architecture, tensors, str(path))
    if card.ranges is not None and len(card.ranges) != (count := len(convolutions(network))):
        raise BadConfiguration(
            f"{path}: {len(card.ranges)} ranges for {count} convolutions; quantise it again"
        )
    sha256 = hashlib.sha256(content).hexdigest()
    return TrainedNetwork(network=network, card=card, sha256=sha256)


def digest(tensors: Mapping[str, Tensor], metadata: Mapping[str, str]) -> str:
    """Return the SHA-256 of the metadata and of every tensor's name, type, shape and bytes, in the
    order of the names."""
    hashed = hashlib.sha256(json.dumps(sorted(metadata.items())).encode())
    for key in sorted(tensors):
        tensor = tensors[key]
        hashed.update(json.dumps([key, str(tensor.dtype), list(tensor.shape)]).encode())
        hashed.update(tensor.reshape(-1).view(torch.uint8).numpy().tobytes())
    return hashed.hexdigest()


def _halved(tensor: Tensor) -> Tensor:
    """Return the kernel of a convolution in half precision, any other tensor as it is."""
    return tensor.half() if tensor.ndim == _KERNEL_DIMENSIONS else tensor


def digest_of_features(trained: TrainedNetwork) -> str:
    """Return the SHA-256 of what makes the features, before classes are made of them: networks of
    the same have the same features, whatever classes were taught to them.

    It is that of the kernels in half precision, in which a taught network is saved.
    """
    of_classes = trained.card.architecture.class_tensors()
    tensors = {
        key: _halved(tensor).float() if tensor.is_floating_point() else tensor
        for key, tensor in trained.network.state_dict().items()
        if key not in of_classes
    }
    return digest(tensors, {})


def _as_metadata(card: WeightsCard) -> dict[str, str]:
    """Return the card as metadata: JSON per field, because safetensors stores only strings; fields
    that are None are left out."""
    known = {key: value for key, value in dataclasses.asdict(card).items() if value is not None}
    return {"format": _FORMAT, **{key: json.dumps(value) for key, value in known.items()}}


def _from_metadata(metadata: Mapping[str, str], path: Path) -> WeightsCard:
    try:
        table = {key: json.loads(value) for key, value in metadata.items() if key != "format"}
    except (ValueError, RecursionError):
        raise BadConfiguration(
            f"{path}: the weights are damaged: their metadata is not readable"
        ) from None
    try:
        return from_table(WeightsCard, table, "card")
    except BadConfiguration as error:
        raise BadConfiguration(f"{path}: {error}") from None


def _metadata(content: bytes, path: Path) -> dict[str, str]:
    """Read the metadata of the header: eight bytes of length, little endian, then JSON."""
    length = int.from_bytes(content[:8], "little")
    if not 2 <= length <= min(MAX_HEADER_BYTES, len(content) - 8):
        raise BadConfiguration(
            f"{path}: not a safetensors file, or cut off: its header would take {length} bytes"
        )
    try:
        header: Any = json.loads(content[8 : 8 + length])
        metadata = header["__metadata__"]
        known = metadata["format"] == _FORMAT and all(
            isinstance(value, str) for value in metadata.values()
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        known = False
    if not known:
        raise BadConfiguration(
            f"{path}: no weights of format {_FORMAT}; convert an official checkpoint first"
        )
    return dict(metadata)
