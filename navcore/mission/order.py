"""Request of the operator at the moment of a tick."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationRequest:
    """Goal, beware list and zones that hold at the moment of a tick."""

    goal: tuple[float, float] | None
    """(x, y) in metres of the map frame to drive to; None to stand and observe."""
    beware: BewareList
    """Objects that must not be touched."""
    zones: tuple[Zone, ...]
    """Keep-out and speed-limit zones."""
    goal_yaw_rad: float | None = None
    """Heading in radians of the map frame at the goal; None for any."""
    leave: bool = False
    """Whether to leave the beware area that the robot is in by the shortest path; then `goal` is
    None."""
    unknown_price: float | None = None
    """Cost of a metre of path over floor that was not seen yet, in metres of seen floor; None for
    `planning.unknown_price` of the configuration."""
