"""What the operator wants at the moment of a tick."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationRequest:
    """What the operator wants at the moment of a tick."""

    goal: tuple[float, float] | None
    """(x, y) in the map frame to drive to; None to stand and look."""
    beware: BewareList
    """What must not be touched."""
    zones: tuple[Zone, ...]
    """Where the robot must not be."""
    goal_yaw_rad: float | None = None
    """Heading in the map frame to stand in at the goal; None for any."""
    leave: bool = False
    """Whether to leave the beware area that the robot stands in, by the shortest way; then there is
    no goal."""
