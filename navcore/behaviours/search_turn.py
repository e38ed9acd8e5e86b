"""One turn on the spot, by which a robot that is lost sees what is around it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from navcore.geometry.transform import Pose2, Twist, wrap_angle

TURN_RAD = math.radians(400.0)
"""Turn in radians after which all around has been seen, with an overlap."""
RATE_RADPS = 0.5
"""Yaw rate in rad/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchTurn:
    """How far the robot has turned."""

    turned_rad: float = 0.0
    """Turn so far in radians."""
    pose: Pose2 | None = None
    """T_odom_base of the newest frame; None before the first."""

    def after(self, pose: Pose2) -> SearchTurn:
        """Return the state after one more frame, by odometry's pose."""
        turn = 0.0 if self.pose is None else wrap_angle(pose.yaw_rad - self.pose.yaw_rad)
        return replace(self, turned_rad=self.turned_rad + turn, pose=pose)

    @property
    def is_over(self) -> bool:
        """Whether the turn is complete."""
        return abs(self.turned_rad) >= TURN_RAD

    @property
    def twist(self) -> Twist:
        """The velocity of the turn."""
        return Twist(v_mps=0.0, w_radps=0.0 if self.is_over else RATE_RADPS)
