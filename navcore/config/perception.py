"""Configuration of the perception: which measurements count."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.errors import BadConfiguration
from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservationConfig:
    """Which measurements count."""

    obstacle_height_m: float = ranged(0.02, 1.0, default=0.10)
    """Anything higher is an obstacle (the paper's 10 cm)."""
    ceiling_m: float = ranged(0.2, 2.8, default=1.5)
    """Anything higher than this is above the robot and none of its business."""
    drop_m: float = ranged(0.05, 2.0, default=0.15)
    """Floor that lies deeper than this is no floor to drive on: a stair down, a kerb, a pit."""
    max_slope: float = ranged(0.0, 0.5, default=0.2)
    """What rises or falls by no more than this per metre is ground; with 0 only the plane on which
    the robot stands is."""
    max_range_m: float = ranged(0.5, 20.0, default=5.0)
    """Depth beyond this is too coarse to be put on the map."""
    min_support: int = ranged(1, 100, default=2)
    """Pixels that must agree on a voxel before it counts."""

    def __post_init__(self) -> None:
        if self.ceiling_m <= self.obstacle_height_m:
            raise BadConfiguration(
                f"points: ceiling_m {self.ceiling_m:g} must be above obstacle_height_m {self.obstacle_height_m:g}, "
                "or nothing would ever be an obstacle"
            )
