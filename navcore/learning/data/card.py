"""What a labelled data set is: splits, kinds of files, its card, and what fits together in one
sample."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from navcore.errors import BadConfiguration
from navcore.learning.data.images import DepthArray, LabelArray, RgbArray
from navcore.perception.esanet.network.preprocess import DepthStatistics
from navcore.toml_config import ranged

Split = Literal["train", "valid", "test"]
SPLITS: tuple[Split, ...] = get_args(Split)
KINDS = ("rgb", "depth", "label")
CARD_NAME = "dataset.json"
MAX_PICTURES = 1_000_000
MAX_CLASSES = 254
"""Labels are bytes, 0 is void and 255 stays free for other people's void."""
Files = tuple[str, str, str]
"""Paths of colours, depth and labels, relative to the folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Pictures per split."""

    train: int = ranged(0, MAX_PICTURES, default=0)
    valid: int = ranged(0, MAX_PICTURES, default=0)
    test: int = ranged(0, MAX_PICTURES, default=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetCard:
    """What must be known of a data set beside its pictures; the file `dataset.json`."""

    format: Literal["bewarenav-dataset-1"] = "bewarenav-dataset-1"
    """Of the folder."""
    class_names: tuple[str, ...]
    """Of the labels 1, 2, …; void has no name."""
    depth: DepthStatistics
    """Mean and standard deviation over the measured pixels of the train split (of all pictures if
    there is no such split)."""
    counts: Counts = Counts()
    """How many pictures each split has."""
    sizes: tuple[tuple[int, int], ...] = ()
    """(height, width) in pixels of the pictures, each once."""
    source: Mapping[str, object] = dataclasses.field(default_factory=dict)
    """Where the pictures come from: whatever the maker wrote down."""

    def __post_init__(self) -> None:
        folded = [name.strip().casefold() for name in self.class_names]
        if not 0 < len(folded) <= MAX_CLASSES or "" in folded or len(set(folded)) != len(folded):
            raise BadConfiguration(
                f"data set: expected 1 to {MAX_CLASSES} class names, unique and not empty, got {self.class_names!r:.400}"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """One labelled picture; all three have the same height and width."""

    rgb: RgbArray
    """(H, W, 3) uint8."""
    depth: DepthArray
    """(H, W) uint16, data set units, 0 = not measured."""
    labels: LabelArray
    """(H, W) uint8, 0 = void, else class + 1."""


@dataclass(slots=True, kw_only=True)
class DepthSums:
    """Mean and spread of depth, summed up exactly, picture by picture."""

    pixels: int = 0
    """Measured ones."""
    total: int = 0
    """Of their depths."""
    squares: int = 0
    """Of their depths squared."""

    def add(self, depth: DepthArray) -> None:
        """Count the measured pixels of (H, W) in."""
        measured = depth[depth > 0].astype(np.int64)
        self.pixels += measured.size
        self.total += int(measured.sum())
        self.squares += int((measured**2).sum())

    def statistics(self, *, units_per_m: float, raw: bool = True) -> DepthStatistics:
        """Raises `BadConfiguration` where nothing was measured or everything is equally far."""
        variance = (self.squares * self.pixels - self.total**2) / max(1, self.pixels) ** 2
        if variance <= 0:
            raise BadConfiguration(
                f"data set: depth has no spread over {self.pixels} measured pixels; is it depth at all?"
            )
        return DepthStatistics(
            mean=self.total / self.pixels, std=math.sqrt(variance), units_per_m=units_per_m, raw=raw
        )


def check_sample(
    rgb: RgbArray, depth: DepthArray, labels: LabelArray, num_classes: int, where: str
) -> None:
    """Raise `BadConfiguration` unless the three are of the right types and one size, and no label
    is beyond the classes."""
    found = [(rgb.dtype, rgb.shape), (depth.dtype, depth.shape), (labels.dtype, labels.shape)]
    height, width = depth.shape if depth.ndim == 2 else (0, 0)
    expected = [
        (np.uint8, (height, width, 3)),
        (np.uint16, (height, width)),
        (np.uint8, (height, width)),
    ]
    if found != expected or not depth.size:
        given = ", ".join(
            f"{kind} {dtype} {shape}" for kind, (dtype, shape) in zip(KINDS, found, strict=True)
        )
        raise BadConfiguration(
            f"{where}: {given}; expected uint8 (H, W, 3), uint16 (H, W) and uint8 (H, W) of one size"
        )
    check_labels(labels, num_classes, where)


def check_labels(labels: LabelArray, num_classes: int, where: str) -> None:
    """Raise `BadConfiguration` for a label beyond the classes."""
    if int(labels.max()) > num_classes:
        raise BadConfiguration(f"{where}: label {labels.max()} is beyond the {num_classes} classes")
