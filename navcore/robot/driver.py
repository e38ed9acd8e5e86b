"""Robot interface: the protocol of every back end, and the expiring command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from navcore.geometry.transform import Twist

if TYPE_CHECKING:
    from navcore.robot.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """Velocity command with a time stamp; the gate drops one that has expired."""

    twist: Twist
    """Velocity that the local planner asks for."""
    stamp_ns: int
    """Time of the decision in nanoseconds of the robot's monotonic clock."""


class Robot(Protocol):
    """Robot back end: delivers the newest frame and takes wheel commands, which expire after the
    driver's time-out of 0.25 s."""

    def now_ns(self) -> int:
        """Return the time of the robot's monotonic clock in nanoseconds."""

    def newest_frame(self) -> Frame | None:
        """Return the newest frame, or None before the first."""

    def send(self, twist: Twist) -> None:
        """Command a velocity to the wheels; it holds for at most the driver's time-out."""

    def close(self) -> None:
        """Stop the wheels and release the robot."""
