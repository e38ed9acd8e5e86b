"""Outcome of the newest tick, as the threads of the controller share it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from navcore.geometry.transform import Matrix
from navcore.mission.order import NavigationRequest
from navcore.navigator import TickResult
from navcore.robot.driver import Command


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TickState:
    """Outcome of the newest tick."""

    decision: TickResult | None = None
    """Result of the newest accepted frame; None before the first."""
    frame_ns: int | None = None
    """Capture time in nanoseconds of the frame by which the motion was decided, or which was
    refused; None before the first. It is newer than that of the decision where the robot was
    steered since."""
    command: Command | None = None
    """Command of the newest decision; None when it asks for nothing."""
    request: NavigationRequest | None = None
    """Request that the command was decided for."""
    zone_covariances: Mapping[str, Matrix] = field(default_factory=dict)
    """(2, 2) covariance of the robot's position relative to each zone by its id, square metres."""
    waits_for_correction: bool = False
    """Whether the robot stands so that its place on the map can be corrected."""
    bad_frame: str | None = None
    """Reason for which the newest frame was refused; None when it was not."""
    failure: str | None = None
    """Error of the newest tick; None when it succeeded."""
