"""How long the robot has waited for people at one place, and whether it has waited enough.

A robot that waits in somebody's lane may wait for ever: he comes up to it, waits for it, turns
round and is soon back. So after a while it asks no longer where he may be by the time it gets
there, and goes on as if he stood still where he is; but never faster than it can stop before he
reaches it (`navcore.yielding.speed_limit_near_people`). A value with its transition, one for each
tick.
"""

from __future__ import annotations

from dataclasses import dataclass

from navcore.config.people import PeopleConfig
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.transform import Pose2

HERE_M = 1.0
"""Who has moved no farther than this still waits at the same place."""
STEP_S = 0.3
"""Between two pictures further apart than this nobody was seen to wait."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WaitingTimer:
    """Where the robot waits, and for how long it has."""

    at: Pose2 | None = None
    """Where it waited first."""
    waited_s: float = 0.0
    """For how long there, in all."""
    now_ns: int = 0
    """Stamp of the newest tick."""

    def after(self, motion: Motion, pose: Pose2, stamp_ns: int) -> WaitingTimer:
        """With the motion of one more tick, decided at a pose of the map frame."""
        if self.at is None or self.at.distance_to(pose.x_m, pose.y_m) > HERE_M:
            return WaitingTimer(at=pose, now_ns=stamp_ns)
        step_s = min(max((stamp_ns - self.now_ns) / 1e9, 0.0), STEP_S)
        waits = motion.outcome is ControllerState.YIELD
        return WaitingTimer(at=self.at, waited_s=self.waited_s + step_s * waits, now_ns=stamp_ns)

    def is_over(self, people_config: PeopleConfig) -> bool:
        """Whether it has waited enough, until it has come away from the place."""
        return self.waited_s >= people_config.patience_s
