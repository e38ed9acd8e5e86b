"""How margins of zones follow the uncertainty of the robot's position."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneMarginConfig:
    """Growth of zones in the map, for planner and local planner: at least that of the safety gate,
    whose configuration says by how many standard deviations."""

    step_m: float = ranged(0.001, 0.5, default=0.015)
    """Standard deviation in metres that is added to what is needed at present, so that the growth
    changes in steps: every change costs a new costmap."""
    slack: float = ranged(0.0, 2.0, default=0.25)
    """Share of the variance that is added for the same reason."""
    kept_ratio: float = ranged(1.15, 10.0, default=1.25)
    """Ratio to what is needed at present, and to `step_m` besides, above which the growth is given
    back: a robot that has come back to a known place must not be kept from a passage there by what
    it was uncertain before."""
    negligible_m: float = ranged(0.0, 0.1, default=0.01)
    """Growth in metres that is left out: the safety margin covers it."""
    trail_spacing_m: float = ranged(0.1, 10.0, default=0.5)
    """Distance in metres between the places of which the uncertainty is remembered: a zone drawn
    later belongs to the nearest."""
    clearance_step_m: float = ranged(0.01, 0.5, default=0.05)
    """Step in metres of the clearance of zones beside which the position is too uncertain, for the
    same reason."""
    body_gap_m: float = ranged(0.0, 0.5, default=0.1)
    """Least distance in metres between the body and that clearance, and between the body and what
    is left of a growth that the robot is in: both give way to the robot."""
    within_m: float = ranged(0.0, 0.5, default=0.08)
    """Distance in metres between the body and a grown zone below which the robot is in the growth:
    it drives out of it before it goes on."""
