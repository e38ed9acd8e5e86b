"""Configuration of a training run, and its learning rate at every step.

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
from navcore.learning.data.photometry import NEUTRAL_K
from navcore.perception.esanet.network.limits import STRIDE
from navcore.perception.esanet.network.preprocess import Size, check_size
from navcore.perception.esanet.network.variants import stem_channels, variant_named
from navcore.toml_config import from_table, ranged, read_toml

REFERENCE_BATCH = 8
"""Batch size that the learning rate refers to; the rate grows with the batch."""
WARM_SHARE, START_DIVISOR, END_DIVISOR = 0.1, 25.0, 1e4
"""One-cycle schedule: share of the warm-up steps, and divisors of the largest rate at both ends."""
MOMENTUM, LEAST_MOMENTUM, CONSTANT_MOMENTUM = 0.95, 0.85, 0.9
"""Range of the momentum, which runs against the learning rate; and the momentum without a cycle."""

ADDED_AUGMENTATIONS = ("exposure", "white_k", "blur", "reduced", "filtered")
"""Fields that earlier versions did not have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Augmentation:
    """Random changes of the training images."""

    scale: tuple[float, float] = ranged(1.0, 4.0, default=(1.0, 1.4))
    """Range of the factor by which an image is enlarged before it is cropped to the working size.
    """
    hsv: tuple[float, float] = ranged(0.0, 4.0, default=(0.9, 1.1))
    """Range of the factors of hue, saturation and value."""
    flip: float = ranged(0.0, 1.0, default=0.5)
    """Share of the images that are mirrored."""
    focus: float = ranged(0.0, 1.0, default=0.0)
    """Share of the images that are cropped around a pixel of a random class, preferring small
    classes."""

    exposure: tuple[float, float] = ranged(0.02, 50.0, default=(1.0, 1.0))
    """Range of the amount of light relative to that of the image, drawn on a logarithmic scale."""
    white_k: tuple[float, float] = ranged(2000.0, 15_000.0, default=(NEUTRAL_K, NEUTRAL_K))
    """Range of the colour temperature of the light in kelvin that the camera takes for neutral."""
    blur: tuple[float, float] = ranged(0.0, 0.2, default=(0.0, 0.0))
    """Range of the motion across the columns during the exposure, as a share of the width."""
    reduced: float = ranged(0.0, 1.0, default=0.0)
    """Share of the images that are reduced instead of enlarged, until the crop just fits: slow
    machines feed the network smaller images."""
    filtered: float = ranged(0.0, 1.0, default=0.0)
    """Share of the images whose edges and textures a random kernel changes, so that less depends on
    how rendered surfaces look from near."""

    def __post_init__(self) -> None:
        for name in ("scale", "hsv", "exposure", "white_k", "blur"):
            low, high = getattr(self, name)
            if low > high:
                raise BadConfiguration(
                    f"{name}: from {low:g} to {high:g}; expected the smaller one first"
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """Configuration of a training run; the TOML file of `bewarenav train`."""

    variant: str = "r18-nbt1d"
    """Variant of the network, as `navcore.build_esanet` takes it."""
    width: float = ranged(0.0, 2.0, default=0.5)
    """Number of channels relative to the paper, in steps of 1/8."""
    size: Size = field(default_factory=lambda: Size(height=480, width=640))
    """Working size of the network, which images are resized to."""
    crop: Size | None = None
    """Size of the crops of the resized images; the working size if left out. Smaller ones train
    faster."""
    epochs: int = ranged(1, 100_000, default=100)
    """Number of passes over the train split."""
    batch: int = ranged(2, 4096, default=8)
    """Images per step over all processes; batch norm needs two per process."""
    learning_rate: float = ranged(1e-9, 10.0, default=0.01)
    """Largest learning rate for 8 images per step; scaled with the batch."""
    weight_decay: float = ranged(0.0, 1.0, default=1e-4)
    """Weight decay of all weights."""
    schedule: Literal["epoch", "batch"] = "epoch"
    """Whether the learning rate changes per epoch, as in the reference, or per batch, which is
    smoother for few epochs."""
    cycle_momentum: bool = True
    """Whether the momentum runs from 0.95 to 0.85 and back; else it is 0.9."""
    class_weights: Literal["median", "logarithmic", "none"] = "median"
    """Weighting of rare classes: by median frequency, by 1/ln(1.02 + share), or none."""
    weight_power: float = ranged(0.0, 1.0, default=1.0)
    """Exponent of the class weights; below 1 rare classes count for less, which gives fewer false
    detections."""
    jaccard: float = ranged(0.0, 10.0, default=0.0)
    """Weight of the soft Jaccard loss besides the cross entropies; for rare and thin classes."""
    augmentation: Augmentation = field(default_factory=Augmentation)
    """Random changes of the training images."""
    he_init: bool = True
    """Whether to start from He's initialisation; else from torch's own."""
    averaging: float = ranged(0.0, 0.99999, default=0.0)
    """Decay per step of an exponential average of the weights, which is then validated and saved;
    0 = off."""
    precision: Literal["auto", "float32", "bfloat16"] = "auto"
    """Arithmetic of the training: `auto` is bfloat16 where the machine has it. Weights stay
    float32."""
    selection: Literal["valid", "test", "last"] = "valid"
    """Split whose mIoU chooses the saved epoch (`test` in the reference), or `last` for the last
    epoch."""
    validate_every: int = ranged(1, 100_000, default=1)
    """Number of epochs between two validations; the last epoch is always validated."""
    seed: int = ranged(0, 2**32 - 1, default=0)
    """Random seed; with the images of a data set the same seed gives the same run on the same
    machine."""

    def __post_init__(self) -> None:
        variant_named(self.variant)
        stem_channels(self.width)
        check_size(self.size, STRIDE)
        if self.crop is not None:
            check_size(self.crop, STRIDE)
            if self.crop.height > self.size.height or self.crop.width > self.size.width:
                raise BadConfiguration(
                    f"crop: {self.crop} is larger than the working size {self.size}"
                )

    def identity(
        self, card: DatasetCard, *, start: str | None = None, source: str | None = None
    ) -> str:
        """Return the identity of the run: a SHA-256 of the recipe, the data set's card, the SHA-256
        of the initial weights, and what it learns from if not from the train split.

        Only values that differ from the defaults are hashed, so that a setting added later does not
        change the identity of old runs.
        """
        defaults, own = dataclasses.asdict(Recipe()), dataclasses.asdict(self)
        for name in ADDED_AUGMENTATIONS:
            if own["augmentation"][name] == defaults["augmentation"].pop(name):
                del own["augmentation"][name]
        content: dict[str, object] = {
            "recipe": {key: value for key, value in own.items() if value != defaults[key]},
            "data": dataclasses.asdict(card),
        }
        if start is not None:
            content["start"] = start
        if source is not None:
            content["source"] = source
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def load_recipe(path: Path) -> Recipe:
    """Read a TOML file; raises `BadConfiguration` naming what is unknown or out of range."""
    return from_table(Recipe, read_toml(path), str(path))


def learning_rate(recipe: Recipe, step: int, steps: int) -> float:
    """Return the learning rate of a step: one cycle (Smith 2018) with cosine ramps, up from a 25th
    in the first tenth of the steps, then down to almost zero.

    `step` is from 0 to `steps` − 1.
    """
    largest = recipe.learning_rate * recipe.batch / REFERENCE_BATCH
    return _one_cycle(
        step, steps, largest / START_DIVISOR, largest, largest / START_DIVISOR / END_DIVISOR
    )


def momentum(recipe: Recipe, step: int, steps: int) -> float:
    """Return the momentum of a step: 0.95 → 0.85 → 0.95 against the learning rate, or constant."""
    return (
        _one_cycle(step, steps, MOMENTUM, LEAST_MOMENTUM, MOMENTUM)
        if recipe.cycle_momentum
        else CONSTANT_MOMENTUM
    )


def _one_cycle(step: int, steps: int, start: float, middle: float, end: float) -> float:
    """Interpolate from `start` to `middle` at the end of the warm-up, then to `end` at the last
    step, as torch's OneCycleLR."""
    warm = WARM_SHARE * steps - 1
    if warm > 0 and step <= warm:
        return _cosine(start, middle, step / warm)
    warm = max(0.0, warm)
    return _cosine(middle, end, (step - warm) / max(1.0, steps - 1 - warm))


def _cosine(start: float, end: float, share: float) -> float:
    return end + (start - end) / 2 * (1 + math.cos(math.pi * share))
