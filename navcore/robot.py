"""The robot's body and limits, the velocity it is asked for, and the port every robot satisfies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from navcore.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Twist:
    """Planar velocity of a differential drive."""

    v_mps: float
    """Forward speed."""
    w_radps: float
    """Yaw rate, counter-clockwise."""


STANDSTILL = Twist(v_mps=0.0, w_radps=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """A twist that expires: the gate never sends one older than its life."""

    twist: Twist
    """What the local planner asks for."""
    stamp_ns: int
    """When it was decided, on the robot's monotonic clock."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotProfile:
    """Body and limits of a platform; the origin of the base is the middle of the footprint, on the floor."""

    name: str
    """Platform, as in `robot` of reports."""
    length_m: float
    """Footprint along x."""
    width_m: float
    """Footprint along y; the vehicle width w_v of the paper's Algorithm 1."""
    max_speed_mps: float
    """Largest forward speed."""
    max_yaw_rate_radps: float
    """Largest yaw rate."""
    max_accel_mps2: float
    """Largest change of speed, both ways."""
    max_yaw_accel_radps2: float
    """Largest change of yaw rate."""

    @property
    def circumscribed_radius_m(self) -> float:
        """Radius of the circle that the footprint sweeps when it turns in place."""
        return float(np.hypot(self.length_m, self.width_m)) / 2

    def footprint(self, padding_m: float = 0.0) -> npt.NDArray[np.float64]:
        """(4, 2) corners in the base frame, counter-clockwise, grown by `padding_m` on every side."""
        x, y = self.length_m / 2 + padding_m, self.width_m / 2 + padding_m
        return np.array([[x, y], [-x, y], [-x, -y], [x, -y]])


HUSKY = RobotProfile(
    name="husky",
    length_m=1.0,
    width_m=0.7,
    max_speed_mps=1.0,
    max_yaw_rate_radps=2.0,
    max_accel_mps2=3.0,
    max_yaw_accel_radps2=6.0,
)


class Robot(Protocol):
    """What a robot back end offers: newest senses, and a wheel command it forgets by itself after 0.25 s."""

    def now_ns(self) -> int:
        """The robot's monotonic clock."""

    def newest_frame(self) -> Frame | None:
        """The last picture taken, or None before the first."""

    def send(self, twist: Twist) -> None:
        """Ask the wheels for a velocity; holds for at most the driver's time-out."""

    def close(self) -> None:
        """Stop the wheels and let the robot go."""
