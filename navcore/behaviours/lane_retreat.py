"""Retreat from the lane of a person who walks to and fro.

A robot that came up to such a lane and has to wait may stand in it, or so near that it cannot turn
to look after the person: they come up to it again and again, and between two visits it has no time
to pass. So after a while it backs off along the path it has driven, to where its turning circle is
clear of the lane, and looks from there for a moment to cross.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from navcore.config.behaviours import BehavioursConfig
from navcore.config.people import PeopleConfig
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.arrays import Floats, Points
from navcore.geometry.transform import Pose2
from navcore.robot.profile import RobotProfile

_DEFAULT = BehavioursConfig()


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneRetreat:
    """A value with its transition, one for each tick."""

    active: bool = False
    """Whether the robot backs off along the driven path."""
    since_ns: int = 0
    """Stamp in nanoseconds at which it began."""
    free_ns: int = 0
    """Stamp in nanoseconds at which its way back was free last."""
    failed_at: Pose2 | None = None
    """Pose, map frame, where the last retreat failed; no other begins there."""

    def after(
        self,
        motion: Motion,
        pose: Pose2,
        stamp_ns: int,
        *,
        walked: Points,
        trail: Points,
        waited_s: float,
        profile: RobotProfile,
        people_config: PeopleConfig,
        config: BehavioursConfig = _DEFAULT,
    ) -> LaneRetreat:
        """Return the state after one more tick; `pose`, the (N, 2) recent positions of people who
        `walked` and the (M, 2) driven `trail`, newest first, are in the map frame. `waited_s` is
        the time in seconds for which the robot has waited at this position."""
        rules = config.lane_retreat
        clear_m = (
            profile.circumscribed_radius_m
            + config.lanes.person_radius_m
            + people_config.personal_m
            + rules.margin_m
        )
        here = np.array([[pose.x_m, pose.y_m]])
        in_lane = bool(_apart_m(here, walked)[0] <= clear_m)
        # Who stands in the lane itself gets out of it either way; once it backs off, it goes on.
        in_way_m = profile.circumscribed_radius_m + config.lanes.person_radius_m
        stays_m = math.inf if self.active else in_way_m
        possible = in_lane and _leads_out(trail, walked, clear_m, rules.longest_m, stays_m)
        if self.active:
            free = motion.outcome is not ControllerState.BLOCKED
            now = replace(self, free_ns=stamp_ns) if free else self
            lasts_s, blocked_s = ((stamp_ns - t) / 1e9 for t in (now.since_ns, now.free_ns))
            if possible and lasts_s < rules.longest_s and blocked_s < rules.blocked_s:
                return now
            return LaneRetreat(failed_at=pose if in_lane else None)
        failed = self.failed_at
        if failed is not None and failed.distance_to(pose.x_m, pose.y_m) < rules.retry_m:
            return self
        waits = motion.outcome is ControllerState.WAIT_FOR_PEOPLE
        if waits and possible and waited_s >= people_config.lane_s:
            return LaneRetreat(active=True, since_ns=stamp_ns, free_ns=stamp_ns)
        return replace(self, failed_at=None)


def _leads_out(
    trail: Points, walked: Points, clear_m: float, longest_m: float, stays_m: float
) -> bool:
    """Return whether the driven path leads out of the lane within a distance, and, from farther
    than `stays_m` from where people walked, no nearer than that: a robot that has crossed the lane
    would back into it."""
    steps_m = np.hypot(*np.diff(trail, axis=0).T)
    apart_m = _apart_m(trail, walked)
    clear = np.flatnonzero((apart_m[1:] > clear_m) & (np.cumsum(steps_m) <= longest_m))
    if len(clear) == 0:
        return False
    return bool(apart_m[0] <= stays_m or (apart_m[: clear[0] + 1] > stays_m).all())


def _apart_m(points: Points, walked: Points) -> Floats:
    """(N,) distance of each point from where people walked; infinite where none did."""
    apart = points[:, None] - walked
    least: Floats = np.hypot(apart[..., 0], apart[..., 1]).min(axis=1, initial=np.inf)
    return least
