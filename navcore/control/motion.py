"""The decision of the local planner: a velocity and the state it belongs to."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from navcore.control.manoeuvre.manoeuvre import Manoeuvre
from navcore.geometry.transform import STANDSTILL, Pose2, Twist


class ControllerState(StrEnum):
    """State of the controller, as operators read it."""

    FOLLOW = "following the path"
    TURN = "turning in place"
    LOOK = "turning to look where the path leads"
    BACK = "backing off"
    MANOEUVRE = "manoeuvring in a tight place"
    ALIGN = "turning to the heading asked for"
    ARRIVED = "arrived"
    IDLE = "no path to follow"
    BLOCKED = "blocked: no motion keeps clear of what is near"
    IN_ZONE = "standing in a beware area"
    WAIT_FOR_PEOPLE = "waiting for a person to pass"
    AVOID = "getting out of the path of a person"
    SPIN = "spinning to look for a path"
    GIVEN_UP = "given up: waiting, backing off and spinning have opened no path"


DRIVES_ON = (ControllerState.FOLLOW, ControllerState.TURN, ControllerState.LOOK)
"""States in which the robot gets on along the path."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """The motion until the next frame."""

    twist: Twist
    """Velocity to command."""
    outcome: ControllerState
    """State of the controller."""
    began: Pose2 | None = None
    """Pose at which a manoeuvre or a retreat began that is carried through before the path is tried
    again; None for any other motion."""
    arc: int | None = None
    """Index of the motion primitive that is driven; None for a motion that is none of them, such as
    turning in place."""
    manoeuvre: Manoeuvre | None = None
    """Rest of the manoeuvre that the motion belongs to."""
    unseen: bool = False
    """Whether nothing but floor that was not observed keeps a blocked robot from its path."""


ARRIVED = Motion(twist=STANDSTILL, outcome=ControllerState.ARRIVED)
IDLE = Motion(twist=STANDSTILL, outcome=ControllerState.IDLE)
BLOCKED = Motion(twist=STANDSTILL, outcome=ControllerState.BLOCKED)
