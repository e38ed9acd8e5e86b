"""The operator's state, and the interface of what holds it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Mission, Phase
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.robot.driver import Command

MOVING = (Phase.DRIVING, Phase.LEAVING)
"""Phases of a mission in which the robot may move."""


class PlaceSearch(StrEnum):
    """State of the turn by which the robot looks for its place in the map."""

    NONE = "none"
    """It was not asked for, or has ended."""
    TURNING = "turning"
    """The robot turns round."""
    FAILED = "failed"
    """The robot could not turn round."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorState:
    """Everything that operators have asked for at one moment."""

    mission: Mission
    """Goals, and whether to drive to them."""
    beware: BewareList
    """Beware list in force."""
    site: str = ""
    """Name of the site whose goals, zones and list these are, as at the last change of site."""
    site_id: str = ""
    """What that site is called by in requests."""
    zones: tuple[Zone, ...] = ()
    """Zones in force, in the order in which they were first stored."""
    stopped_by: str | None = None
    """Source of the latched emergency stop; None when it is not latched."""
    stops: int = 0
    """Number of emergency stops since the start, also of those while one was latched."""
    by_hand: Command | None = None
    """Newest command of teleoperation; None when there is none."""
    search: PlaceSearch = PlaceSearch.NONE
    """State of the turn by which the robot looks for its place in the map."""
    unknown_price: float | None = None
    """Cost of a metre of path over unseen floor, in metres of seen floor; None for that of the
    configuration."""

    @property
    def searching(self) -> bool:
        """Whether the robot turns round to find its place in the map."""
        return self.search is PlaceSearch.TURNING

    @property
    def drives(self) -> bool:
        """Whether the robot may move by itself: a mission drives, or it turns round."""
        return self.mission.phase in MOVING or self.searching

    @property
    def request(self) -> NavigationRequest:
        """What the navigator is asked for."""
        goal = self.mission.goal
        return NavigationRequest(
            goal=(goal.x_m, goal.y_m) if goal else None,
            beware=self.beware,
            zones=self.zones,
            goal_yaw_rad=goal.yaw_rad if goal else None,
            leave=self.mission.phase is Phase.LEAVING,
            unknown_price=self.unknown_price,
        )


class StateHolder(Protocol):
    """A holder of the operator's state; `robot_controller.RobotController` is one."""

    @property
    def intent(self) -> OperatorState:
        """The present state."""

    def change(self, edit: Callable[[OperatorState], OperatorState]) -> OperatorState:
        """Replace the state by `edit(state)` in one step; nothing changes when `edit` raises."""
