"""Configuration of the teaching of classes. Imports no slow package."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.errors import BadConfiguration
from navcore.perception.esanet.network.limits import STRIDE
from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class TeachingRecipe:
    """Configuration of the teaching of classes."""

    steps: int = ranged(1, 100_000, default=400)
    """Number of steps of the optimiser."""
    batch: int = ranged(1, 256, default=4)
    """Number of crops per step."""
    crop: int = ranged(32, 4096, default=192)
    """Side in pixels of the square crops, a multiple of 32; smaller ones train faster."""
    learning_rate: float = ranged(1e-9, 1.0, default=5e-3)
    """Largest learning rate of Adam."""
    jaccard: float = ranged(0.0, 10.0, default=0.5)
    """Weight of the soft Jaccard loss, for small objects, besides the cross entropy."""
    focus: float = ranged(0.0, 1.0, default=0.75)
    """Share of the crops around a pixel of a random class of the image, small ones first; the rest
    lie anywhere."""
    sure: float = ranged(0.0, 1.0, default=0.6)
    """Confidence from which the network's own label of a taught class is a target where the
    annotation says nothing; its label of any other class always is."""
    captured_share: float = ranged(0.0, 1.0, default=0.6)
    """Share of the crops that come from captured images; the rest rehearse."""
    rehearsal: int = ranged(0, 1000, default=40)
    """Number of rendered images on which the known classes are rehearsed."""
    rendered_test: int = ranged(0, 1000, default=40)
    """Number of other rendered images on which the known classes are compared."""
    validate_every: int = ranged(1, 100_000, default=50)
    """Number of steps between two validations; the last step is validated, too."""
    seed: int = ranged(0, 2**31 - 1, default=0)
    """Random seed; the same seed gives the same run on the same machine."""

    def __post_init__(self) -> None:
        if self.crop % STRIDE:
            raise BadConfiguration(f"teaching: crop: {self.crop}; expected a multiple of {STRIDE}")
