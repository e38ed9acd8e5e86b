"""Configuration of the inference: which engine runs the network, and when it is fast enough."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class InferenceConfig:
    """How the engine of the network is measured and chosen."""

    min_agreement: float = ranged(0.0, 1.0, default=0.999)
    """Smallest share of pixels in which an engine must decide as torch in f32 does."""
    min_agreement_int8: float = ranged(0.0, 1.0, default=0.99)
    """Smallest share of such pixels in eight bits, whose cost in mean IoU was measured when the
    ranges were (`weights quantise`)."""
    fast_enough_ms: float = ranged(0.0, 1000.0, default=50.0)
    """99th percentile of the time per image in milliseconds up to which the first accurate engine
    is taken and no other is tried; of a fifteenth of a second it leaves a quarter to everything
    else."""
    clear_advantage: float = ranged(0.0, 1.0, default=0.9)
    """Ratio of the 99th percentiles of the times above which the more exact of two engines is
    taken, so that noise does not choose."""
    trial_s: float = ranged(0.0, 60.0, default=1.0)
    """Duration of the measurement of each engine in seconds."""
    min_runs: int = ranged(1, 1000, default=5)
    """Smallest number of images that measure an engine."""
    max_runs: int = ranged(1, 100_000, default=200)
    """Largest number of images that measure an engine."""
    reduced_side: float = ranged(0.1, 1.0, default=0.77)
    """Ratio of the sides of the reduced working size, for machines too slow for the trained one."""
