"""A trained network on disk, as safetensors or ONNX."""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from navcore.config.perception.inference import InferenceConfig
from navcore.errors import BadConfiguration
from navcore.files import is_there
from navcore.perception.esanet.inference import onnx_file
from navcore.perception.esanet.inference.onnx_file import OnnxCard
from navcore.perception.esanet.network.limits import STRIDE
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size

if TYPE_CHECKING:
    from navcore.perception.esanet.network.model import EsaNet

SHIPPED = Path(__file__).parents[1] / "shipped" / "beware-r18-nbt1d.safetensors"
"""The weights that come with the package."""
SUFFIXES = (".safetensors", onnx_file.SUFFIX)
"""Endings of the names of a network's file."""
DEFAULT_CONFIG = InferenceConfig()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NetworkFile:
    """A network as an ESANet or as ONNX, and what is needed to use it."""

    title: str
    """Title for the operator, e.g. `r18-nbt1d × 0.5`."""
    class_names: tuple[str, ...]
    """Class names of the outputs, in their order."""
    depth: DepthStatistics
    """Depth statistics of the training data."""
    size: Size
    """Working size that images are resized to."""
    sha256: str
    """SHA-256 of the file, hexadecimal."""
    features: str
    """SHA-256 of what makes the features (`weights_file.digest_of_features`); that of the file
    where it is not known."""
    network: EsaNet | None = None
    """The network; None if the file is ONNX."""
    onnx: bytes | None = None
    """Content of the ONNX file; None if the file is safetensors."""
    ranges: tuple[float, ...] | None = None
    """Largest inputs of the convolutions, for eight bits; None if they were not measured."""

    def as_onnx(self, *, in_bytes: bool = False) -> bytes:
        """Return the ONNX file, or the network exported for its working size; with `in_bytes` in
        eight bits, if ranges were measured."""
        if self.onnx is not None:
            return self.onnx
        assert self.network is not None
        card = OnnxCard(
            class_names=self.class_names, depth=self.depth, size=self.size, features=self.features
        )
        return onnx_file.exported(self.network, card, ranges=self.ranges if in_bytes else None)

    def smaller(self, config: InferenceConfig = DEFAULT_CONFIG) -> NetworkFile | None:
        """Return the network at a reduced working size (by default 832 × 480 → 640 × 384, about
        6/10 of the pixels); None for ONNX, which has one size only."""
        if self.network is None:
            return None
        size = nearest_size(
            Size(
                height=round(config.reduced_side * self.size.height),
                width=round(config.reduced_side * self.size.width),
            )
        )
        return None if size == self.size else dataclasses.replace(self, size=size)


def open_network(path: Path, *, camera: Size) -> NetworkFile:
    """Read a `.safetensors` or `.onnx` file; raises `BadConfiguration` naming it.

    The working size is the training size if the file states it, else the one nearest to the
    camera's.
    """
    if path.suffix == onnx_file.SUFFIX:
        content, onnx_card = onnx_file.read_onnx(path)
        sha256 = hashlib.sha256(content).hexdigest()
        return NetworkFile(
            title=path.name,
            class_names=onnx_card.class_names,
            depth=onnx_card.depth,
            size=onnx_card.size,
            sha256=sha256,
            features=onnx_card.features or sha256,
            onnx=content,
        )
    check_name(path)
    from navcore.perception.esanet.weights import weights_file as weights

    trained = weights.load(path)
    card = trained.card
    return NetworkFile(
        title=f"{card.variant} × {card.width:g}",
        class_names=card.class_names,
        depth=card.depth,
        size=card.size or nearest_size(camera),
        sha256=trained.sha256,
        features=weights.digest_of_features(trained),
        network=trained.network,
        ranges=card.ranges,
    )


def check_name(path: Path) -> None:
    """Raise `BadConfiguration` for a name that is not that of a network, and for one without a
    file; loads nothing slow."""
    if path.suffix not in SUFFIXES:
        raise BadConfiguration(f"{path}: expected a name ending in {' or '.join(SUFFIXES)}")
    if not is_there(path) or not path.is_file():
        raise BadConfiguration(f"{path}: no such file")


def nearest_size(camera: Size) -> Size:
    """Return the multiples of 32 nearest to a camera's size, ties up: 424 × 240 → 416 × 256."""
    height, width = (
        max((2 * side + STRIDE) // (2 * STRIDE), 1) * STRIDE
        for side in (camera.height, camera.width)
    )
    return Size(height=height, width=width)
