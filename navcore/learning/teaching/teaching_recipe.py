"""Configuration of the teaching of classes. Imports no slow package."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class TeachingRecipe:
    """Configuration of the teaching of classes."""

    steps: int = ranged(1, 100_000, default=60)
    """Largest number of steps of L-BFGS; it ends before when five steps take less than 2 % off the
    loss."""
    l2_penalty: float = ranged(0.0, 1.0, default=1e-4)
    """Weight of the squared change of the rows of the taught classes in the loss, in units of the
    features' deviation."""
    confidence_threshold: float = ranged(0.0, 1.0, default=0.6)
    """Confidence from which the network's own label of a taught class is a target where the
    annotation says nothing; its label of any other class always is."""
    rehearsal: int = ranged(0, 1000, default=40)
    """Number of rendered images on which the known classes are rehearsed."""
    rendered_test: int = ranged(0, 1000, default=40)
    """Number of other rendered images on which the known classes are compared."""
    seed: int = ranged(0, 2**31 - 1, default=0)
    """Random seed of the rendered images."""
