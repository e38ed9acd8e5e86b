"""Checkpoints of a training run, written after every epoch, from which a killed run continues:
identically where its images are those of a data set."""

from __future__ import annotations

import dataclasses
import logging
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from navcore.errors import BadConfiguration, StorageFailed
from navcore.toml_config import from_table

MAX_STATE_BYTES = 8 << 30
_FORMAT = "bewarenav-training-1"
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Epoch:
    """Result of one epoch."""

    number: int
    """Number of the epoch, from 1."""
    loss: float
    """Mean loss over the steps, summed over the four scales."""
    learning_rate: float
    """Learning rate at the last step."""
    miou: float | None = None
    """Mean IoU of the selection split; None if it was not validated."""


@dataclass(slots=True, kw_only=True)
class RunState:
    """Everything that the next epoch depends on besides recipe and data."""

    identity: str
    """Identity of recipe and data: `Recipe.identity`."""
    network: dict[str, Tensor]
    """State dict of the network."""
    optimiser: dict[str, Any]
    """State dict of the optimiser."""
    average: dict[str, Tensor] = field(default_factory=dict)
    """Averaged weights; empty without averaging."""
    history: list[Epoch] = field(default_factory=list)
    """Results of the finished epochs."""
    best_epoch: int = 0
    """Number of the saved epoch; 0 before the first."""
    best_miou: float = -1.0
    """Of that epoch."""
    labels: str = ""
    """Lists and labels of the data set: `Dataset.labels_digest`; empty in the state of an earlier
    release."""


def write_state(path: Path, state: RunState) -> None:
    """Replace the file in one go; a kill at any moment leaves the old or the new one. Raises
    `StorageFailed`."""
    content = {**{name: getattr(state, name) for name in state.__slots__}, "format": _FORMAT}
    content["history"] = [dataclasses.asdict(epoch) for epoch in state.history]
    partial = path.with_name(f".{path.name}.partial")
    try:
        try:
            with partial.open("wb") as file:
                torch.save(content, file)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    except (
        OSError,
        RuntimeError,
    ) as error:  # torch's zip writer wraps a full disk in a RuntimeError
        raise StorageFailed(
            f"{path}: the training's state cannot be written: {error!s:.200}"
        ) from error


def read_state(path: Path, identity: str, labels: str) -> RunState:
    """Read a state of the same recipe and data without executing the file's content.

    Raises `BadConfiguration` for a file of another run, for labels that were edited since, and for
    a damaged or foreign file. The state of an earlier release does not tell its labels, and takes
    `labels`.
    """
    try:
        if path.stat().st_size > MAX_STATE_BYTES:
            raise BadConfiguration(
                f"{path}: more than {MAX_STATE_BYTES} bytes, too many for a training's state"
            )
        content = torch.load(path, map_location="cpu", weights_only=True)
        known = isinstance(content, dict) and content.pop("format") == _FORMAT
    except BadConfiguration:
        raise
    except Exception as error:  # a damaged pickle can make the reader fail in any way
        raise BadConfiguration(
            f"{path}: the training cannot be resumed: {type(error).__name__}: {error!s:.200}"
        ) from None
    if known and "labels" not in content:
        log.warning("%s: is of an earlier release; edits of the labels since are not noticed", path)
        content["labels"] = labels
    if not known or set(content) != set(RunState.__slots__):
        raise BadConfiguration(f"{path}: not the state of a training run of this version")
    if content["identity"] != identity:
        raise BadConfiguration(
            f"{path}: is of a run with another recipe or other data; resume it with the same, "
            "or train elsewhere"
        )
    if content["labels"] != labels:
        raise BadConfiguration(
            f"{path}: the labels of the data set, or its lists, were edited since; resume it with "
            "those of before, or train elsewhere"
        )
    content["history"] = [
        from_table(Epoch, epoch, f"{path}: history") for epoch in content["history"]
    ]
    return RunState(**content)
