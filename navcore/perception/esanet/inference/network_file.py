"""A trained network from the disk, whichever form it has: safetensors or ONNX."""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass
from pathlib import Path

from navcore.errors import BadConfiguration
from navcore.perception.esanet.inference import onnx_file
from navcore.perception.esanet.inference.onnx_file import OnnxCard
from navcore.perception.esanet.network.model import STRIDE, EsaNet
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size
from navcore.perception.esanet.weights import weights_file as weights

SHIPPED = Path(__file__).parents[1] / "shipped" / "beware-r18-nbt1d.safetensors"
"""The weights that come with the package."""
SMALLER = 0.77
"""Of each side, where a machine is too slow for the size that the network was trained at."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NetworkFile:
    """What is known of a network, and the network itself as an ESANet or as ONNX."""

    title: str
    """For people, e.g. `r18-nbt1d × 0.5`."""
    class_names: tuple[str, ...]
    """What the outputs mean, in their order."""
    depth: DepthStatistics
    """Of the training data."""
    size: Size
    """What pictures are resized to."""
    sha256: str
    """Of the file, hexadecimal."""
    network: EsaNet | None = None
    """None when it came as ONNX."""
    onnx: bytes | None = None
    """None when it came as safetensors."""
    ranges: tuple[float, ...] | None = None
    """Of its convolutions' inputs, for eight bits; None where they were not measured."""

    def as_onnx(self, *, in_bytes: bool = False) -> bytes:
        """The file's bytes, or the network exported for its size; `in_bytes`, where it has ranges,
        in eight bits."""
        if self.onnx is not None:
            return self.onnx
        assert self.network is not None
        card = OnnxCard(class_names=self.class_names, depth=self.depth, size=self.size)
        return onnx_file.exported(self.network, card, ranges=self.ranges if in_bytes else None)

    def smaller(self) -> NetworkFile | None:
        """The same at about 6/10 of the pixels (832 × 480 → 640 × 384); None where it cannot be, as
        ONNX has one size only."""
        if self.network is None:
            return None
        size = nearest_size(
            Size(height=round(SMALLER * self.size.height), width=round(SMALLER * self.size.width))
        )
        return None if size == self.size else dataclasses.replace(self, size=size)


def open_network(path: Path, *, camera: Size) -> NetworkFile:
    """Read a `.safetensors` or `.onnx` file; raises `BadConfiguration` naming it.

    The working size is the one it was trained at, if it says so, else the one nearest to the
    camera's.
    """
    if path.suffix == onnx_file.SUFFIX:
        content, onnx_card = onnx_file.read_onnx(path)
        return NetworkFile(
            title=path.name,
            class_names=onnx_card.class_names,
            depth=onnx_card.depth,
            size=onnx_card.size,
            sha256=hashlib.sha256(content).hexdigest(),
            onnx=content,
        )
    if path.suffix != weights.SUFFIX:
        raise BadConfiguration(
            f"{path}: expected a name ending in {weights.SUFFIX} or {onnx_file.SUFFIX}"
        )
    trained = weights.load(path)
    card = trained.card
    return NetworkFile(
        title=f"{card.variant} × {card.width:g}",
        class_names=card.class_names,
        depth=card.depth,
        size=card.size or nearest_size(camera),
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        network=trained.network,
        ranges=card.ranges,
    )


def nearest_size(camera: Size) -> Size:
    """The multiples of 32 nearest to a camera's picture, the larger of two: 424 × 240 → 416 × 256."""
    height, width = (
        max((2 * side + STRIDE) // (2 * STRIDE), 1) * STRIDE
        for side in (camera.height, camera.width)
    )
    return Size(height=height, width=width)
