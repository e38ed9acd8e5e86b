"""One turn on the spot, by which a robot that is lost sees what is around it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from navcore.geometry.transform import Pose2, Twist, wrap_angle

TURN_RAD = math.radians(400.0)
"""Turn in radians after which all around has been seen, with an overlap."""
RATE_RADPS = 0.5
"""Yaw rate in rad/s."""
GAIN_RAD, PATIENCE_NS = math.radians(5.0), 20_000_000_000
"""Turn in radians that the robot gains at least within this time in nanoseconds; else it does not
turn any more: it is wedged, or what is beside it keeps it from turning."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchTurn:
    """How far the robot has turned."""

    turned_rad: float = 0.0
    """Turn so far in radians."""
    pose: Pose2 | None = None
    """T_odom_base of the newest frame; None before the first."""
    stamp_ns: int = 0
    """Stamp in nanoseconds of the newest frame."""
    gained_rad: float = 0.0
    """Turn in radians at the last frame at which it had gained `GAIN_RAD`."""
    gained_ns: int = 0
    """Stamp in nanoseconds of that frame."""

    def after(self, pose: Pose2, stamp_ns: int) -> SearchTurn:
        """Return the state after one more frame, by odometry's pose and the frame's stamp."""
        if self.pose is None:
            return replace(self, pose=pose, stamp_ns=stamp_ns, gained_ns=stamp_ns)
        turned_rad = self.turned_rad + wrap_angle(pose.yaw_rad - self.pose.yaw_rad)
        turn = replace(self, turned_rad=turned_rad, pose=pose, stamp_ns=stamp_ns)
        if abs(turned_rad - self.gained_rad) < GAIN_RAD:
            return turn
        return replace(turn, gained_rad=turned_rad, gained_ns=stamp_ns)

    @property
    def is_over(self) -> bool:
        """Whether the turn is complete."""
        return abs(self.turned_rad) >= TURN_RAD

    @property
    def has_failed(self) -> bool:
        """Whether the robot has turned no further for so long that it cannot."""
        return not self.is_over and self.stamp_ns - self.gained_ns >= PATIENCE_NS

    @property
    def twist(self) -> Twist:
        """The velocity of the turn."""
        return Twist(v_mps=0.0, w_radps=0.0 if self.is_over else RATE_RADPS)
