"""Trained networks on the disk: safetensors files that say what they are and prove that they are
whole.

A file's metadata is a card (variant, classes, width, depth statistics, where it came from) and the
SHA-256 of the card and all tensors. Loading one executes nothing and takes nothing on trust.
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
from navcore.perception.esanet.network.model import EsaNet
from navcore.perception.esanet.network.preprocess import (
    NYUV2_DEPTH,
    SUNRGBD_DEPTH,
    DepthStatistics,
    Size,
)
from navcore.perception.esanet.network.quantisation import convolutions
from navcore.perception.esanet.network.variants import MAX_CLASSES
from navcore.perception.esanet.weights.architecture import Architecture, fitting, infer
from navcore.perception.esanet.weights.class_names import NYUV2_CLASSES, SUNRGBD_CLASSES
from navcore.perception.esanet.weights.official_checkpoint import read_checkpoint
from navcore.toml_config import from_table, ranged

MAX_WEIGHTS_BYTES = 2 << 30
"""A width of 2 in the largest variant fits."""
MAX_HEADER_BYTES = 1 << 20
SUFFIX = ".safetensors"
_FORMAT = "bewarenav-esanet-1"
_KERNEL_DIMENSIONS = 4
_DATA_SETS = {40: (NYUV2_CLASSES, NYUV2_DEPTH), 37: (SUNRGBD_CLASSES, SUNRGBD_DEPTH)}
"""By number of classes: the public checkpoints do not say what they were trained on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightsCard:
    """What must be known of trained weights to use them."""

    variant: str
    """As `build` takes it."""
    num_classes: int = ranged(1, MAX_CLASSES)
    """Outputs per pixel."""
    width: float = ranged(0.0, 8.0)
    """Channels, relative to the paper's."""
    class_names: tuple[str, ...]
    """What the outputs mean, in their order."""
    depth: DepthStatistics
    """Of the training data."""
    source_sha256: str
    """Of the checkpoint it was converted from, or of the training run's configuration; hexadecimal.
    """
    size: Size | None = None
    """The working size it was trained at; files written before this was kept, and converted ones,
    do not say."""
    ranges: tuple[float, ...] | None = ranged(0.0, 1e9, default=None)
    """Of its convolutions' inputs, for eight bits (`backends/quantised.py`); None where they were
    not measured."""

    def __post_init__(self) -> None:
        if len(self.class_names) != self.num_classes:
            raise BadConfiguration(
                f"weights: {len(self.class_names)} class names for {self.num_classes} classes"
            )
        folded = [name.strip().casefold() for name in self.class_names]
        if "" in folded or len(set(folded)) != len(folded):
            raise BadConfiguration(
                f"weights: class names must be unique and not empty, got {', '.join(self.class_names):.400}"
            )
        if not re.fullmatch("[0-9a-f]{64}", self.source_sha256):
            raise BadConfiguration(
                f"weights: source_sha256 is {self.source_sha256!r:.80}, expected 64 hexadecimal digits"
            )

    @property
    def architecture(self) -> Architecture:
        """What to build."""
        return Architecture(variant=self.variant, num_classes=self.num_classes, width=self.width)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrainedNetwork:
    """A network and what must be known to use it."""

    network: EsaNet
    """In eval mode."""
    card: WeightsCard
    """Its classes and the depth statistics of its training data."""


def convert(
    source: Path,
    target: Path,
    *,
    class_names: Sequence[str] | None = None,
    depth: DepthStatistics | None = None,
) -> WeightsCard:
    """Write the official checkpoint `source` as the safetensors file `target`; returns what it
    turned out to be.

    Variant, classes and width are read from its keys and shapes. With 40 classes it is taken for
    NYUv2's, with 37 for SUN RGB-D's, unless `class_names` and `depth` say otherwise. Raises
    `BadConfiguration` or `StorageFailed`.
    """
    checkpoint = read_checkpoint(source)
    architecture = infer(checkpoint.tensors, str(source))
    network = fitting(architecture, checkpoint.tensors, str(source))
    known_names, known_depth = _DATA_SETS.get(architecture.num_classes, (None, None))
    names, statistics = class_names or known_names, depth or known_depth
    if names is None or statistics is None:
        raise BadConfiguration(
            f"{source}: {architecture.num_classes} classes are those of no public data set (40: NYUv2, 37: SUN RGB-D); "
            "say class_names and depth"
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
    """Write a network with its card; what was at `target` stays intact until the new file is whole.

    With `half` the convolutions' kernels, nearly all of it, are kept in half precision: half the
    size, for files to ship. Raises `BadConfiguration` when the two do not belong together,
    `StorageFailed` when the disk does not take it.
    """
    check_name(target)
    tensors = {
        key: value.detach().cpu().contiguous() for key, value in network.state_dict().items()
    }
    fitting(card.architecture, tensors, str(target))
    if half:
        tensors = {
            key: value.half() if value.ndim == _KERNEL_DIMENSIONS else value
            for key, value in tensors.items()
        }
    metadata = _as_metadata(card)
    content = safetensors.torch.save(tensors, {**metadata, "sha256": digest(tensors, metadata)})
    write_whole(target, content)


def check_name(target: Path) -> None:
    """Raise `BadConfiguration` unless a file of weights may be called so."""
    if target.suffix != SUFFIX:
        raise BadConfiguration(f"{target}: expected a name ending in {SUFFIX}")


def load(path: Path) -> TrainedNetwork:
    """Read what `save` or `convert` wrote; raises `BadConfiguration` naming the file and what is
    wrong with it."""
    content = read_whole(path, at_most=MAX_WEIGHTS_BYTES)
    metadata = _metadata(content, path)
    claimed = metadata.pop("sha256", "")
    try:
        tensors = safetensors.torch.load(content)
    except (SafetensorError, ValueError, TypeError, KeyError, RuntimeError) as error:
        raise BadConfiguration(f"{path}: the weights are damaged: {error!s:.200}") from None
    if digest(tensors, metadata) != claimed:
        raise BadConfiguration(
            f"{path}: the weights are damaged: their SHA-256 is not the one in the file; convert them again"
        )
    card = _from_metadata(metadata, path)
    tensors = {
        key: value.float() if value.dtype is torch.float16 else value
        for key, value in tensors.items()
    }
    network = fitting(card.architecture, tensors, str(path))
    if card.ranges is not None and len(card.ranges) != (count := len(convolutions(network))):
        raise BadConfiguration(
            f"{path}: {len(card.ranges)} ranges for {count} convolutions; quantise it again"
        )
    return TrainedNetwork(network=network, card=card)


def digest(tensors: Mapping[str, Tensor], metadata: Mapping[str, str]) -> str:
    """SHA-256 of the metadata and of every tensor's name, type, shape and bytes, in the order of
    their names."""
    hashed = hashlib.sha256(json.dumps(sorted(metadata.items())).encode())
    for key in sorted(tensors):
        tensor = tensors[key]
        hashed.update(json.dumps([key, str(tensor.dtype), list(tensor.shape)]).encode())
        hashed.update(tensor.reshape(-1).view(torch.uint8).numpy().tobytes())
    return hashed.hexdigest()


def _as_metadata(card: WeightsCard) -> dict[str, str]:
    """Safetensors knows only strings, so each field is JSON; what is not known is left out."""
    told = {key: value for key, value in dataclasses.asdict(card).items() if value is not None}
    return {"format": _FORMAT, **{key: json.dumps(value) for key, value in told.items()}}


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
    """The strings of the file's header: eight bytes of length, little endian, then JSON."""
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
