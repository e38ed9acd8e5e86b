"""Timer of how long the robot has waited for people at one position.

A robot that waits in the lane of a person may wait for ever: the person comes up to it, waits too,
turns round and is soon back. So after `patience_s` the robot no longer avoids where people may come
to, only where they are; it is still never faster than it can stop before a person reaches it
(`navcore.control.people.social.speed_limit_near_people`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from navcore.config.behaviours import WaitingConfig
from navcore.config.people import PeopleConfig
from navcore.control.motion import DRIVES_ON, ControllerState, Motion
from navcore.geometry.transform import Pose2

_DEFAULT = WaitingConfig()


@dataclass(frozen=True, slots=True, kw_only=True)
class WaitingTimer:
    """A value with its transition, one for each tick."""

    at: Pose2 | None = None
    """Pose where the robot started to wait, map frame."""
    waited_s: float = 0.0
    """Time in seconds for which it has waited there in all."""
    driven_s: float = math.inf
    """Time in seconds for which it has got on along its path since it last waited, anywhere, while
    a person who walks was out of sight; infinite before that."""
    now_ns: int = 0
    """Stamp of the newest tick in nanoseconds."""

    def after(
        self,
        motion: Motion,
        pose: Pose2,
        stamp_ns: int,
        config: WaitingConfig = _DEFAULT,
        *,
        is_lost: bool = False,
    ) -> WaitingTimer:
        """Return the timer after one more tick; `pose` is in the map frame, and `is_lost` tells
        whether a person who walks is out of sight."""
        waits = motion.outcome is ControllerState.WAIT_FOR_PEOPLE
        step_s = elapsed_s(self.now_ns, stamp_ns, config)
        # A robot that backs off or manoeuvres is still where it waited.
        driven_s = self.driven_s + step_s * (motion.outcome in DRIVES_ON)
        if waits and is_lost:
            driven_s = 0.0
        if self.at is None or self.at.distance_to(pose.x_m, pose.y_m) > config.position_m:
            return WaitingTimer(at=pose, driven_s=driven_s, now_ns=stamp_ns)
        waited_s = self.waited_s + step_s * waits
        return WaitingTimer(at=self.at, waited_s=waited_s, driven_s=driven_s, now_ns=stamp_ns)

    def has_just_ended(self, people_config: PeopleConfig) -> bool:
        """Return whether the robot has hardly driven on since it waited, and a person was out of
        sight."""
        return self.driven_s < people_config.cautious_s

    def is_over(self, people_config: PeopleConfig) -> bool:
        """Return whether the robot has waited long enough, until it leaves the position."""
        return self.waited_s >= people_config.patience_s


def elapsed_s(before_ns: int, now_ns: int, config: WaitingConfig) -> float:
    """Return the seconds between two ticks that count as watched, 0 to `max_gap_s`."""
    return min(max((now_ns - before_ns) / 1e9, 0.0), config.max_gap_s)
