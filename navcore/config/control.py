"""Configuration of the local planner."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from navcore.errors import BadConfiguration
from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalPlannerConfig:
    """How the local planner moves."""

    primitives: Literal["arcs", "falco"] = "arcs"
    """What the next motion is chosen from: arcs of constant curvature, or Falco's paths and, where
    none is free, the arcs."""
    padding_m: float = ranged(0.0, 0.5, default=0.05)
    """Room kept around the footprint wherever the robot has it."""
    lookahead_m: float = ranged(0.2, 3.0, default=0.8)
    """How far ahead on the path the robot aims."""
    arrival_m: float = ranged(0.02, 0.3, default=0.12)
    """A goal this near is reached."""
    nearly_m: float = ranged(0.0, 0.5, default=0.25)
    """And one this near where the robot would have to manoeuvre to come nearer."""
    aligned_deg: float = ranged(1.0, 45.0, default=5.0)
    """A heading this near to the one asked for is reached."""
    braking_mps2: float = ranged(0.1, 5.0, default=0.8)
    """Deceleration that speeds are planned with; the platform brakes harder."""
    turn_from_deg: float = ranged(10.0, 170.0, default=50.0)
    """Turn in place when the path leads off by more than this …"""
    turn_until_deg: float = ranged(1.0, 60.0, default=12.0)
    """… and go on turning until it is less than this."""
    turn_rate_radps: float = ranged(0.1, 2.0, default=0.9)
    """Largest yaw rate when turning in place."""
    back_off_m: float = ranged(0.1, 3.0, default=0.5)
    """How far the robot backs off once it does, before it tries the path again."""

    @property
    def reach_m(self) -> float:
        """What stands farther away than this from the body is of no account."""
        return 2.0 if self.primitives == "arcs" else 4.25

    def __post_init__(self) -> None:
        if self.turn_until_deg >= self.turn_from_deg:
            raise BadConfiguration(
                f"local: turn_until_deg {self.turn_until_deg:g} must be below turn_from_deg {self.turn_from_deg:g}"
            )
