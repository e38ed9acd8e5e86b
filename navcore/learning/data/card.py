"""Description of a data set: splits, kinds of files, card and samples."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from navcore.errors import BadConfiguration
from navcore.learning.data.images import DepthArray, LabelArray, MaskArray, RgbArray
from navcore.perception.esanet.network.preprocess import DepthStatistics
from navcore.toml_config import ranged

Split = Literal["train", "valid", "test"]
SPLITS: tuple[Split, ...] = get_args(Split)
KINDS = ("rgb", "depth", "label")
CARD_NAME = "dataset.json"
MAX_IMAGES = 1_000_000
MAX_CLASSES = 254
"""Largest number of classes: labels are bytes, 0 is void and 255 is void in other tools."""
Files = tuple[str, str, str]
"""Paths of colours, depth and labels, relative to the folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Number of images per split."""

    train: int = ranged(0, MAX_IMAGES, default=0)
    """Number of images of the train split."""
    valid: int = ranged(0, MAX_IMAGES, default=0)
    """Number of images of the valid split."""
    test: int = ranged(0, MAX_IMAGES, default=0)
    """Number of images of the test split."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetCard:
    """Description of a data set besides its images; the file `dataset.json`."""

    format: Literal["bewarenav-dataset-1"] = "bewarenav-dataset-1"
    """Format of the folder."""
    class_names: tuple[str, ...]
    """Class names of the labels 1, 2, …; void has no name."""
    depth: DepthStatistics
    """Mean and standard deviation over the measured pixels of the train split, or of all images
    without such a split."""
    counts: Counts = Counts()
    """Number of images per split."""
    sizes: tuple[tuple[int, int], ...] = ()
    """Distinct sizes (height, width) of the images, pixels."""
    source: Mapping[str, object] = dataclasses.field(default_factory=dict)
    """Origin of the images, as recorded by the program that made the data set."""

    def __post_init__(self) -> None:
        folded = [name.strip().casefold() for name in self.class_names]
        if not 0 < len(folded) <= MAX_CLASSES or "" in folded or len(set(folded)) != len(folded):
            raise BadConfiguration(
                f"data set: expected 1 to {MAX_CLASSES} class names, unique and not empty, "
                f"got {self.class_names!r:.400}"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """A labelled RGB-D image; the arrays have the same height and width."""

    rgb: RgbArray
    """(H, W, 3) uint8 colours."""
    depth: DepthArray
    """(H, W) uint16 depth in data set units, 0 = not measured."""
    labels: LabelArray
    """(H, W) uint8 labels, 0 = void, else class + 1."""
    uncoloured: MaskArray | None = None
    """(H, W) pixels whose colour is not known, of which teaching counts no label; None where all
    are, and after a change of the image."""


@dataclass(slots=True, kw_only=True)
class DepthSums:
    """Exact sums for the mean and standard deviation of depth."""

    pixels: int = 0
    """Number of measured pixels."""
    total: int = 0
    """Sum of their depths."""
    squares: int = 0
    """Sum of their squared depths."""

    def add(self, depth: DepthArray) -> None:
        """Add the measured pixels of a depth image (H, W)."""
        measured = depth[depth > 0].astype(np.int64)
        self.pixels += measured.size
        self.total += int(measured.sum())
        self.squares += int((measured**2).sum())

    def include(self, other: DepthSums) -> None:
        """Add the sums of other images."""
        self.pixels += other.pixels
        self.total += other.total
        self.squares += other.squares

    def statistics(self, *, units_per_m: float, raw: bool = True) -> DepthStatistics:
        """Return the statistics; raises `BadConfiguration` if there is no variance."""
        variance = (self.squares * self.pixels - self.total**2) / max(1, self.pixels) ** 2
        if variance <= 0:
            raise BadConfiguration(
                f"data set: depth has no spread over {self.pixels} measured pixels; "
                "is it depth at all?"
            )
        return DepthStatistics(
            mean=self.total / self.pixels, std=math.sqrt(variance), units_per_m=units_per_m, raw=raw
        )


def check_sample(
    rgb: RgbArray, depth: DepthArray, labels: LabelArray, num_classes: int, where: str
) -> None:
    """Raise `BadConfiguration` unless types and sizes are right and all labels are known."""
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
            f"{where}: {given}; "
            "expected uint8 (H, W, 3), uint16 (H, W) and uint8 (H, W) of one size"
        )
    check_labels(labels, num_classes, where)


def check_labels(labels: LabelArray, num_classes: int, where: str) -> None:
    """Raise `BadConfiguration` for a label that stands for no class."""
    if int(labels.max()) > num_classes:
        raise BadConfiguration(f"{where}: label {labels.max()} is beyond the {num_classes} classes")
