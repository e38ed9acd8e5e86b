"""How a network is taught: every knob of a training run, and the learning rate at every step.

The defaults are those of the official repository, except for the size of the network and the number
of epochs.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from navcore.errors import BadConfiguration
from navcore.learning.data.card import DatasetCard
from navcore.perception.esanet.network.model import STRIDE
from navcore.perception.esanet.network.preprocess import Size, check_size
from navcore.perception.esanet.network.variants import stem_channels, variant_named
from navcore.toml_config import from_table, ranged, read_toml

REFERENCE_BATCH = 8
"""The learning rate is said for this many pictures and grows with the batch."""
WARM_SHARE, START_DIVISOR, END_DIVISOR = 0.1, 25.0, 1e4
"""Of the one-cycle schedule: share of the steps that warm up, and what the largest rate is divided
by at its two ends."""
MOMENTUM, LEAST_MOMENTUM = 0.95, 0.85
"""Runs against the learning rate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Augmentation:
    """How a picture is changed before the network sees it."""

    scale: tuple[float, float] = ranged(1.0, 4.0, default=(1.0, 1.4))
    """Enlarged by a factor between these two, then cropped to the working size."""
    hsv: tuple[float, float] = ranged(0.0, 4.0, default=(0.9, 1.1))
    """Hue, saturation and value are each multiplied by a factor between these two."""
    flip: float = ranged(0.0, 1.0, default=0.5)
    """Share of the pictures that are mirrored."""
    focus: float = ranged(0.0, 1.0, default=0.0)
    """Share of the pictures that are cropped around a pixel of a random class in them, small
    classes first."""

    def __post_init__(self) -> None:
        for name, (low, high) in (("scale", self.scale), ("hsv", self.hsv)):
            if low > high:
                raise BadConfiguration(
                    f"augmentation.{name}: from {low:g} to {high:g}; expected the smaller one first"
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """A training run; what a TOML file for `bewarenav train` may say."""

    variant: str = "r18-nbt1d"
    """As `navcore.esanet.build` takes it."""
    width: float = ranged(0.0, 2.0, default=0.5)
    """Channels relative to the paper's, in steps of 1/8."""
    size: Size = field(default_factory=lambda: Size(height=480, width=640))
    """What pictures are resized to; the size the network works at."""
    crop: Size | None = None
    """What a step sees of a resized picture; the whole size if not said. Smaller ones train faster.
    """
    epochs: int = ranged(1, 100_000, default=100)
    """Times that the train split is seen."""
    batch: int = ranged(2, 4096, default=8)
    """Pictures per step, over all processes together; batch norm needs two per process."""
    learning_rate: float = ranged(1e-9, 10.0, default=0.01)
    """The largest one, for 8 pictures per step; scaled with the batch."""
    weight_decay: float = ranged(0.0, 1.0, default=1e-4)
    """On all weights."""
    schedule: Literal["epoch", "batch"] = "epoch"
    """How often the learning rate changes. The reference does it per epoch; with few epochs `batch`
    is smoother."""
    cycle_momentum: bool = True
    """Whether the momentum runs from 0.95 to 0.85 and back, else it is 0.9."""
    class_weights: Literal["median", "logarithmic", "none"] = "median"
    """How rare classes are made to count: by median frequency, by 1/ln(1.02 + share), or not at
    all."""
    weight_power: float = ranged(0.0, 1.0, default=1.0)
    """Power the class weights are raised to; below 1 rare classes count for less, so fewer false
    alarms."""
    jaccard: float = ranged(0.0, 10.0, default=0.0)
    """Weight of the soft Jaccard loss beside the cross entropies; for rare and thin classes."""
    augmentation: Augmentation = field(default_factory=Augmentation)
    """Changes to the pictures."""
    he_init: bool = True
    """Whether to start from He's initialisation, else from torch's own."""
    averaging: float = ranged(0.0, 0.99999, default=0.0)
    """Decay per step of an exponential average of the weights, which is then validated and kept; 0
    = off."""
    precision: Literal["auto", "float32", "bfloat16"] = "auto"
    """Of the arithmetic while training: `auto` is bfloat16 where the machine is fast at it. Weights
    stay float32."""
    selection: Literal["valid", "test", "last"] = "valid"
    """The split whose mIoU chooses the epoch that is kept (the reference takes `test`), or simply
    the last epoch."""
    validate_every: int = ranged(1, 100_000, default=1)
    """Epochs between two validations; the last epoch always has one."""
    seed: int = ranged(0, 2**32 - 1, default=0)
    """The same seed gives the same run on the same machine."""

    def __post_init__(self) -> None:
        variant_named(self.variant)
        stem_channels(self.width)
        check_size(self.size, STRIDE)
        if self.crop is not None:
            check_size(self.crop, STRIDE)
            if self.crop.height > self.size.height or self.crop.width > self.size.width:
                raise BadConfiguration(
                    f"training: crop: {self.crop} is larger than the working size {self.size}"
                )

    def identity(self, card: DatasetCard, start: str | None = None) -> str:
        """SHA-256 of this recipe, the data set's card and the SHA-256 of the weights it starts
        from: which run this is.

        Only what differs from the defaults is hashed, so that a setting added later leaves the
        identity of old runs alone.
        """
        usual = dataclasses.asdict(Recipe())
        told: dict[str, object] = {
            "recipe": {
                key: value for key, value in dataclasses.asdict(self).items() if value != usual[key]
            },
            "data": dataclasses.asdict(card),
        }
        if start is not None:
            told["start"] = start
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def load_recipe(path: Path) -> Recipe:
    """Read a TOML file; raises `BadConfiguration` naming what is unknown or out of range."""
    return from_table(Recipe, read_toml(path), str(path))


def learning_rate(recipe: Recipe, step: int, steps: int) -> float:
    """One cycle (Smith 2018) with cosine ramps: up from a 25th in the first tenth of the steps,
    then down to almost nothing.

    `step` from 0 to `steps` − 1.
    """
    largest = recipe.learning_rate * recipe.batch / REFERENCE_BATCH
    return _one_cycle(
        step, steps, largest / START_DIVISOR, largest, largest / START_DIVISOR / END_DIVISOR
    )


def momentum(recipe: Recipe, step: int, steps: int) -> float:
    """0.95 → 0.85 → 0.95 against the learning rate, or 0.9 throughout."""
    return (
        _one_cycle(step, steps, MOMENTUM, LEAST_MOMENTUM, MOMENTUM)
        if recipe.cycle_momentum
        else 0.9
    )


def _one_cycle(step: int, steps: int, start: float, middle: float, end: float) -> float:
    """From `start` to `middle` at the end of the warm-up, then to `end` at the last step; as
    torch's OneCycleLR."""
    warm = WARM_SHARE * steps - 1
    if warm > 0 and step <= warm:
        return _cosine(start, middle, step / warm)
    warm = max(0.0, warm)
    return _cosine(middle, end, (step - warm) / max(1.0, steps - 1 - warm))


def _cosine(start: float, end: float, share: float) -> float:
    return end + (start - end) / 2 * (1 + math.cos(math.pi * share))
