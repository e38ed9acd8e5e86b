"""One turn on the spot, by which a robot that is lost sees what is around it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from navcore.geometry.transform import Pose2, Twist, wrap_angle

TURN_RAD = math.radians(400.0)
"""Turn in radians after which all around has been seen, with an overlap."""
RATE_RADPS = 0.5
"""Yaw rate in rad/s."""
LONGEST_NS = round(3 * TURN_RAD / RATE_RADPS * 1e9)
"""Time in nanoseconds after which a robot that has not turned round by then does not turn any
more: it is wedged, or what is beside it keeps it from turning."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchTurn:
    """How far the robot has turned."""

    turned_rad: float = 0.0
    """Turn so far in radians."""
    pose: Pose2 | None = None
    """T_odom_base of the newest frame; None before the first."""
    began_ns: int = 0
    """Stamp in nanoseconds of the first frame."""
    lasts_ns: int = 0
    """Time in nanoseconds from the first frame to the newest."""

    def after(self, pose: Pose2, stamp_ns: int) -> SearchTurn:
        """Return the state after one more frame, by odometry's pose and the frame's stamp."""
        if self.pose is None:
            return replace(self, pose=pose, began_ns=stamp_ns)
        turn = wrap_angle(pose.yaw_rad - self.pose.yaw_rad)
        return replace(
            self,
            turned_rad=self.turned_rad + turn,
            pose=pose,
            lasts_ns=stamp_ns - self.began_ns,
        )

    @property
    def is_over(self) -> bool:
        """Whether the turn is complete."""
        return abs(self.turned_rad) >= TURN_RAD

    @property
    def has_failed(self) -> bool:
        """Whether the robot has tried to turn for so long that it cannot."""
        return not self.is_over and self.lasts_ns >= LONGEST_NS

    @property
    def twist(self) -> Twist:
        """The velocity of the turn."""
        return Twist(v_mps=0.0, w_radps=0.0 if self.is_over else RATE_RADPS)
