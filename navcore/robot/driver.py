"""The port every robot satisfies, and the command that it is sent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from navcore.geometry.transform import Twist

if TYPE_CHECKING:
    from navcore.robot.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """A twist that expires: the gate never sends one older than its life."""

    twist: Twist
    """What the local planner asks for."""
    stamp_ns: int
    """When it was decided, on the robot's monotonic clock."""


class Robot(Protocol):
    """What a robot back end offers: newest senses, and a wheel command it forgets by itself after
    0.25 s."""

    def now_ns(self) -> int:
        """The robot's monotonic clock."""

    def newest_frame(self) -> Frame | None:
        """The last picture taken, or None before the first."""

    def send(self, twist: Twist) -> None:
        """Ask the wheels for a velocity; holds for at most the driver's time-out."""

    def close(self) -> None:
        """Stop the wheels and let the robot go."""
