"""Configuration of the recovery behaviours."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryConfig:
    """How patiently each means is tried."""

    wait_s: float = ranged(0.0, 60.0, default=2.0)
    """How long the robot waits before it does anything else."""
    back_m: float = ranged(0.1, 5.0, default=1.0)
    """How far it backs off."""
    left_m: float = ranged(0.5, 20.0, default=2.5)
    """Farther than this from where it was boxed in the robot has come away."""
    manoeuvre_s: float = ranged(1.0, 120.0, default=20.0)
    """A manoeuvre that takes longer has failed."""
    tries: int = ranged(1, 20, default=3)
    """So often at one place the robot may back off a little or begin to manoeuvre, before that
    counts as boxed in."""
