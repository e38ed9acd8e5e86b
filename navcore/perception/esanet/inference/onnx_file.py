"""Networks as ONNX files: exported from an ESANet, or any other with a card.

A file has the inputs `rgb` (1, 3, h, w) and `depth` (1, 1, h, w), normalised, the output `logits`
(1, classes, h, w) and, where it was exported here, `features` (1, C, h/4, w/4), which the last
layer makes the logits of. Its card (class names, depth statistics, size) is JSON in its metadata
under `bewarenav`, or beside it in `FILE.onnx.json`. The metadata are read and written without the
onnx package: fields may be appended to a protobuf message.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from navcore.errors import BadConfiguration
from navcore.perception.esanet.network.limits import MAX_CLASSES, STRIDE
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size, check_size
from navcore.toml_config import from_table

if TYPE_CHECKING:
    from navcore.perception.esanet.network.model import EsaNet

INSTALL = "run `make setup`"
"""How the packages are installed that run and export networks, in messages."""
SUFFIX = ".onnx"
INPUTS, OUTPUT, FEATURES = ("rgb", "depth"), "logits", "features"
OPSET = 17
MAX_ONNX_BYTES = 1 << 30
_KEY = "bewarenav"
_METADATA_FIELD = 14
"""`metadata_props` of ONNX's ModelProto: messages of a key (field 1) and a value (field 2)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OnnxCard:
    """Description of an ONNX file that is needed to use it."""

    class_names: tuple[str, ...]
    """Class names of the outputs, in their order."""
    depth: DepthStatistics
    """Depth statistics of the training data."""
    size: Size
    """Size (h, w) of the inputs."""
    features: str = ""
    """SHA-256 of what makes the features; empty where it is not known."""

    def __post_init__(self) -> None:
        check_size(self.size, STRIDE)
        folded_names = [name.strip().casefold() for name in self.class_names]
        if (
            "" in folded_names
            or len(set(folded_names)) != len(folded_names)
            or not 1 <= len(folded_names) <= MAX_CLASSES
        ):
            raise BadConfiguration(f"expected 1 to {MAX_CLASSES} class names, unique and not empty")


def can_export() -> bool:
    """Return whether the onnx package, which torch needs for the export, is installed."""
    return importlib.util.find_spec("onnx") is not None


def exported(network: EsaNet, card: OnnxCard, *, ranges: Sequence[float] | None = None) -> bytes:
    """Export the network as an ONNX file for one size, batch norms folded; with `ranges` (see
    `quantisation.py`) in eight bits.

    Needs the onnx package (extra `fast`); raises `BadConfiguration`.
    """
    if not can_export():
        raise BadConfiguration(
            f"the onnx package is missing, without which nothing is exported: {INSTALL}"
        )
    import torch

    from navcore.perception.esanet.network.batchnorm_folding import folded, with_fixed_pools
    from navcore.perception.esanet.network.quantisation import quantised

    class WithFeatures(torch.nn.Module):
        """A network that answers with its logits and features."""

        def __init__(self, network: EsaNet) -> None:
            super().__init__()
            self.network = network

        def forward(self, rgb: torch.Tensor, depth: torch.Tensor) -> tuple[torch.Tensor, ...]:
            return self.network.with_features(rgb, depth)

    height, width = card.size.height, card.size.width
    ready = folded(network) if ranges is None else quantised(network, ranges)
    fixed = with_fixed_pools(ready.cpu(), height // STRIDE, width // STRIDE)
    inputs = (torch.zeros(1, 3, height, width), torch.zeros(1, 1, height, width))
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
        # The tracer warns about shape checks and its deprecation; the result is compared with
        # torch before it is used.
        warnings.simplefilter("ignore")
        file = Path(folder) / f"network{SUFFIX}"
        try:
            torch.onnx.export(
                WithFeatures(fixed).eval(),
                inputs,
                file,
                input_names=list(INPUTS),
                output_names=[OUTPUT, FEATURES],
                opset_version=OPSET,
                dynamo=False,
            )
        except Exception as error:  # an onnx package that does not fit torch or the machine
            raise BadConfiguration(
                f"torch cannot export the network to ONNX: {str(error).partition(chr(10))[0]:.300}"
            ) from None
        return with_card(file.read_bytes(), card)


def with_card(content: bytes, card: OnnxCard) -> bytes:
    """Return the file with the card in its metadata."""
    pair = _field(1, _KEY.encode()) + _field(2, json.dumps(dataclasses.asdict(card)).encode())
    return content + _field(_METADATA_FIELD, pair)


def read_onnx(path: Path) -> tuple[bytes, OnnxCard]:
    """Read a file and its card; raises `BadConfiguration` naming the file and the defect."""
    try:
        with path.open("rb") as file:
            content = file.read(MAX_ONNX_BYTES + 1)
        beside = path.with_name(f"{path.name}.json")
        text = (
            beside.read_text(encoding="utf-8") if beside.exists() else _metadata(content).get(_KEY)
        )
    except (OSError, UnicodeDecodeError) as error:
        raise BadConfiguration(f"{path}: the network cannot be read: {error}") from None
    except ValueError as error:
        raise BadConfiguration(f"{path}: not an ONNX file, or damaged: {error}") from None
    if len(content) > MAX_ONNX_BYTES:
        raise BadConfiguration(f"{path}: more than {MAX_ONNX_BYTES} bytes, too many for a network")
    if text is None:
        raise BadConfiguration(
            f"{path}: does not say what its outputs mean; "
            f"write class_names, depth and size into {beside.name}"
        )
    try:
        table: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadConfiguration(f"{path}: its card is not JSON: {error!s:.200}") from None
    try:
        return content, from_table(OnnxCard, table, "card")
    except BadConfiguration as error:
        raise BadConfiguration(f"{path}: {error}") from None


def _metadata(content: bytes) -> dict[str, str]:
    found = {}
    for number, value in _fields(memoryview(content)):
        if number == _METADATA_FIELD:
            pair = {key: bytes(text).decode() for key, text in _fields(value)}
            found[pair.get(1, "")] = pair.get(2, "")
    return found


def _fields(message: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Yield number and content of the length-delimited fields of a protobuf message; raises
    `ValueError` for anything else."""
    at = 0
    while at < len(message):
        tag, at = _varint(message, at)
        number, kind = tag >> 3, tag & 7
        if kind == 0:
            _, at = _varint(message, at)
            continue
        if kind not in (1, 2, 5):
            raise ValueError(f"no protobuf at byte {at}")
        length, at = (8 if kind == 1 else 4, at) if kind != 2 else _varint(message, at)
        if at + length > len(message):
            raise ValueError("it is cut off")
        if kind == 2:
            yield number, message[at : at + length]
        at += length


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            raise ValueError("it is cut off")
        byte = message[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
    raise ValueError(f"no protobuf at byte {at}")


def _field(number: int, content: bytes) -> bytes:
    return _as_varint(number << 3 | 2) + _as_varint(len(content)) + content


def _as_varint(value: int) -> bytes:
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])
