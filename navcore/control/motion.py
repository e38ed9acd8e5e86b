"""What the local planner decides, and the rules that it moves by."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from navcore.control.manoeuvre import Manoeuvre
from navcore.control.primitives.library import Primitives
from navcore.geometry.transform import STANDSTILL, Pose2, Twist


class ControllerState(StrEnum):
    """What the local planner decided."""

    FOLLOW = "following the path"
    TURN = "turning in place"
    BACK = "backing off"
    MANOEUVRE = "manoeuvring in a tight place"
    ALIGN = "turning to the heading asked for"
    ARRIVED = "arrived"
    IDLE = "no path to follow"
    BOXED_IN = "boxed in: no motion keeps clear of what stands near"
    IN_ZONE = "standing in a beware area"
    YIELD = "waiting for somebody to pass"
    DODGE = "getting out of somebody's way"
    LOOK = "looking round for a way"
    GIVEN_UP = "given up: waiting, backing off and looking round have found no way"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """What to do until the next frame."""

    twist: Twist
    """Velocity to command."""
    outcome: ControllerState
    """Why."""
    began: Pose2 | None = None
    """Where a manoeuvre began that is carried through before the path is tried again; None for any
    other motion."""
    arc: int | None = None
    """Which of `candidates` it drives along; None for a motion that is none of them, such as
    turning in place."""
    among: Primitives | None = None
    """What it was chosen from, where that was not the arcs."""
    manoeuvre: Manoeuvre | None = None
    """What is left of the manoeuvre that it belongs to."""


ARRIVED = Motion(twist=STANDSTILL, outcome=ControllerState.ARRIVED)
IDLE = Motion(twist=STANDSTILL, outcome=ControllerState.IDLE)
BOXED_IN = Motion(twist=STANDSTILL, outcome=ControllerState.BOXED_IN)
