"""Reader of official checkpoints: pickles from the internet, read without executing their
content."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import torch
from torch import Tensor

from navcore.errors import BadConfiguration

MAX_CHECKPOINT_BYTES = 2 << 30
"""Largest size of a checkpoint; an R50 with its optimiser's state is about a third of it."""
MAX_TENSORS = 10_000
_WRAPPERS = ("state_dict", "model")
_PREFIXES = ("module.", "model.")
_ZIP_START = b"PK\x03\x04"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """The tensors of a checkpoint, not yet checked to be an ESANet."""

    tensors: dict[str, Tensor]
    """Tensors by key, without the prefixes of `DataParallel` and similar wrappers."""
    sha256: str
    """SHA-256 of the file, hexadecimal."""


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a state dict saved by `torch.save`, bare or under `state_dict` or `model`.

    Raises `BadConfiguration` naming the file if it is missing, damaged, too large or holds anything
    but plain values.
    """
    try:
        with path.open("rb") as file:
            _check_bytes(path, file)
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
            file.seek(0)
            content = _unpickle(path, file)
    except OSError as error:
        raise BadConfiguration(
            f"{path}: the checkpoint cannot be read: {error.strerror or error}"
        ) from None
    return Checkpoint(tensors=_tensors(path, content), sha256=sha256)


def _unpickle(path: Path, file: BinaryIO) -> object:
    try:
        return torch.load(file, map_location="cpu", weights_only=True)
    except Exception as error:  # a hostile or truncated pickle can raise anything
        reason = str(error).strip().partition("\n")[0][:200]
        raise BadConfiguration(
            f"{path}: not a checkpoint of plain tensors, nothing of it was executed. "
            "Expected a state dict written by torch.save; the reader says: "
            f"{type(error).__name__}: {reason}"
        ) from None


def _check_bytes(path: Path, file: BinaryIO) -> None:
    """Refuse a file that would fill the memory, itself or unpacked from a compressed archive."""
    size = file.seek(0, 2)
    file.seek(0)
    if file.read(len(_ZIP_START)) == _ZIP_START:
        try:
            with zipfile.ZipFile(file) as archive:
                size = max(size, sum(entry.file_size for entry in archive.infolist()))
        except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
            raise BadConfiguration(f"{path}: the checkpoint is damaged: {error}") from None
    file.seek(0)
    if size > MAX_CHECKPOINT_BYTES:
        raise BadConfiguration(
            f"{path}: {size} bytes are too many for a checkpoint, "
            f"at most {MAX_CHECKPOINT_BYTES} are read"
        )


def _tensors(path: Path, content: object) -> dict[str, Tensor]:
    """Return the state dict of a checkpoint, without wrappers and prefixes."""
    for wrapper in _WRAPPERS:
        if isinstance(content, Mapping) and isinstance(content.get(wrapper), Mapping):
            content = content[wrapper]
    if not isinstance(content, Mapping) or not 0 < len(content) <= MAX_TENSORS:
        raise BadConfiguration(
            f"{path}: expected a state dict of at most {MAX_TENSORS} tensors, "
            f"got {_in_words(content)}"
        )
    for key, value in content.items():
        if not isinstance(key, str) or not _is_plain(value):
            raise BadConfiguration(
                f"{path}: {key!r:.80} is {_in_words(value)}, expected a dense tensor under a name"
            )
    return _without_prefixes({key: value.detach() for key, value in content.items()})


def _without_prefixes(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    for prefix in _PREFIXES * 2:  # `module.model.` and `model.module.` occur both
        if all(key.startswith(prefix) for key in tensors):
            tensors = {key.removeprefix(prefix): value for key, value in tensors.items()}
    return tensors


def _is_plain(value: object) -> bool:
    return (
        isinstance(value, Tensor) and value.layout == torch.strided and value.device.type == "cpu"
    )


def _in_words(value: object) -> str:
    return (
        f"{type(value).__name__} of {len(value)}"
        if isinstance(value, Mapping | list | tuple)
        else type(value).__name__
    )
