"""Recovery of a robot that is blocked: wait, back off along the driven path, spin, close the
passage, give up.

A value with its transition, one for each tick. Each action is tried once at a position, the mildest
first, and the path is tried again after each; a robot that gets away from the position starts
afresh the next time.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from navcore.config.behaviours import RecoveryConfig
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.mission.zone import OWN_COLOUR, Zone
from navcore.robot.profile import RobotProfile

_PASSED_M = 0.5
"""Distance in metres, beyond that over which the robot backs off, from where it waited, after which
it has passed who stood beside it there."""


class RecoveryAction(IntEnum):
    """Recovery actions, the mildest first."""

    NONE = 0
    """Follow the path."""
    WAIT = 1
    """Wait for the obstacle to move away."""
    BACK_UP = 2
    """Back off along the driven path."""
    SPIN = 3
    """Spin once in place: the camera has not looked everywhere."""
    CLOSE = 4
    """Take the passage for closed, and have another route planned."""
    GIVE_UP = 5
    """Report failure, and stand until the path can be followed after all, or only people are in the
    way: then everything is tried again once they have left."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """State of the recovery; the default is a robot that is not blocked."""

    action: RecoveryAction = RecoveryAction.NONE
    """Action that is being tried."""
    tried: RecoveryAction = RecoveryAction.NONE
    """Last action that failed at this position; the next one is stronger."""
    at: Pose2 | None = None
    """Pose where the robot was blocked, map frame; None when it was not."""
    began: Pose2 | None = None
    """Pose where the present action started."""
    since_ns: int = 0
    """Stamp in nanoseconds at which the present action started."""
    turned_rad: float = 0.0
    """Angle in radians that the robot has turned since."""
    heading_rad: float = 0.0
    """Heading in radians at the newest tick."""
    backs: int = 0
    """Number of short retreats or manoeuvres at this position that gained nothing."""
    backed_from: Pose2 | None = None
    """Pose where the last of those started."""
    waited_s: float = 0.0
    """Time in seconds for which people beside the robot have kept it from recovering here."""
    refused: ControllerState | None = None
    """What the controller asked for when the present action started; None for nothing."""
    was_held: bool = False
    """Whether the safety gate kept the robot from its motion then."""
    waited_at: Pose2 | None = None
    """Pose where it has waited, and the path was still blocked, until it is well away from there;
    None for none."""
    stands_s: float = 0.0
    """Time in seconds for which a robot that has given up stands, whatever it is asked for; then
    all is tried again."""

    def after(
        self,
        motion: Motion,
        pose: Pose2,
        stamp_ns: int,
        rules: RecoveryConfig,
        *,
        held: bool = False,
    ) -> Recovery:
        """Return the state after one more tick; `pose` is in the map frame, `held` whether the
        safety gate keeps the robot from its motion, which no waiting changes."""
        if self.at is not None and self.at.distance_to(pose.x_m, pose.y_m) > rules.left_m:
            return Recovery()
        turned = self.turned_rad + abs(wrap_angle(pose.yaw_rad - self.heading_rad))
        counted = self._counted(motion, pose, rules)
        now = dataclasses.replace(
            counted,
            turned_rad=turned,
            heading_rad=pose.yaw_rad,
            waited_at=None if self._has_passed(pose, rules) else self.waited_at,
        )
        stuck = motion.outcome is ControllerState.BLOCKED or now.backs >= rules.tries
        lasts_s = (stamp_ns - self.since_ns) / 1e9
        if self.action is RecoveryAction.NONE and held:
            return now._enter(now._stronger(), motion, pose, stamp_ns, held=True)
        if self.action is RecoveryAction.NONE:
            return now._enter(RecoveryAction.WAIT, motion, pose, stamp_ns) if stuck else now
        if self.action is RecoveryAction.GIVE_UP:
            if self.stands_s > 0.0:
                return now if lasts_s < self.stands_s else Recovery()
            if motion.outcome is ControllerState.WAIT_FOR_PEOPLE:
                return Recovery()  # without the people the path could be followed
            if self.was_held:
                # What it is asked for is no sign that the gate lets it pass: all is tried again.
                return Recovery() if lasts_s >= rules.again_s else now
            was_blocked = self.refused is ControllerState.BLOCKED
            if was_blocked and motion.outcome in _ASIDE:
                return Recovery()  # what was in its way has gone in part
            return now._ended() if motion.outcome in _ONWARD else now
        if self.action is RecoveryAction.WAIT:
            if not stuck:
                return now._ended()
            if lasts_s < rules.wait_s:
                return now
            waited = dataclasses.replace(now, waited_at=pose)
            return waited._enter(waited._stronger(), motion, pose, stamp_ns)
        blocked = held or motion.outcome is ControllerState.BLOCKED
        if blocked or lasts_s >= rules.manoeuvre_s or now._is_done(pose, rules):
            return dataclasses.replace(now._ended(), tried=self.action, backs=0)
        return now

    def beside_people(
        self, motion: Motion, pose: Pose2, step_s: float, rules: RecoveryConfig, *, held: bool
    ) -> Recovery | None:
        """Return the state after a tick of `step_s` seconds of a robot that is blocked or `held`
        beside a person who may walk on: it waits. None where it recovers as ever: it has begun to,
        or has waited so long for people here."""
        is_stopped = held or motion.outcome is ControllerState.BLOCKED
        waits = self.action in (RecoveryAction.NONE, RecoveryAction.WAIT)
        if not (is_stopped and waits):
            return None
        if self.at is not None and self.at.distance_to(pose.x_m, pose.y_m) > rules.left_m:
            return Recovery()
        if self.waited_s >= rules.people_s:
            return None
        waited_s = self.waited_s + step_s
        return dataclasses.replace(self._ended(), at=self.at or pose, waited_s=waited_s)

    def _has_passed(self, pose: Pose2, rules: RecoveryConfig) -> bool:
        """Return whether the robot has come away from where it waited, farther than it backs off to
        try again."""
        at = self.waited_at
        return at is not None and at.distance_to(pose.x_m, pose.y_m) > rules.back_m + _PASSED_M

    def _stronger(self) -> RecoveryAction:
        """Return the action after the last one that failed."""
        return RecoveryAction(max(self.tried, RecoveryAction.WAIT) + 1)

    def _ended(self) -> Recovery:
        return dataclasses.replace(self, action=RecoveryAction.NONE)

    def _counted(self, motion: Motion, pose: Pose2, rules: RecoveryConfig) -> Recovery:
        began, last = motion.began, self.backed_from
        if self.action is not RecoveryAction.NONE or began is None or began == last:
            return self
        again = last is None or last.distance_to(began.x_m, began.y_m) < rules.retry_m
        return dataclasses.replace(
            self, at=self.at or pose, backs=self.backs + again, backed_from=began
        )

    def _enter(
        self,
        action: RecoveryAction,
        motion: Motion,
        pose: Pose2,
        stamp_ns: int,
        *,
        held: bool = False,
    ) -> Recovery:
        return dataclasses.replace(
            self,
            action=action,
            at=self.at or pose,
            began=pose,
            since_ns=stamp_ns,
            turned_rad=0.0,
            heading_rad=pose.yaw_rad,
            refused=motion.outcome,
            was_held=held,
        )

    def _is_done(self, pose: Pose2, rules: RecoveryConfig) -> bool:
        if self.action is RecoveryAction.BACK_UP:
            began = self.began
            return began is not None and began.distance_to(pose.x_m, pose.y_m) >= rules.back_m
        return self.action is RecoveryAction.CLOSE or self.turned_rad >= 2 * math.pi


_ONWARD = (
    ControllerState.FOLLOW,
    ControllerState.TURN,
    ControllerState.LOOK,
    ControllerState.ALIGN,
    ControllerState.ARRIVED,
)
"""Controller states in which a robot that has given up can follow its path after all."""
_ASIDE = (ControllerState.MANOEUVRE, ControllerState.BACK)
"""Controller states in which a robot that could not move at all can move again."""
_DEFAULT = RecoveryConfig()


def trail_with(trail: Points, pose: Pose2, config: RecoveryConfig = _DEFAULT) -> Points:
    """Return the (N, 2) driven path in the map frame, newest first, extended by one pose.

    Loops are left out: a robot that returns to an earlier position has come no further, so what it
    drove in between is not part of its retreat.
    """
    here = np.array([[pose.x_m, pose.y_m]])
    again = np.flatnonzero(np.hypot(*(trail - here).T) < config.trail_step_m)
    if len(again):
        return trail[again[-1] :]
    return np.vstack([here, trail[: config.trail_points - 1]])


def closed_way(
    path: Points, at: Pose2, profile: RobotProfile, config: RecoveryConfig = _DEFAULT
) -> Zone | None:
    """Return a keep-out zone that closes the passage ahead of a pose where the robot was blocked.

    `path` is (N, 2) in the map frame. The zone lies on it, far enough ahead that the robot does not
    stand in it, whichever way it turns; None where the path ends before.
    """
    half = config.closed_half_side_m
    away = np.hypot(path[:, 0] - at.x_m, path[:, 1] - at.y_m)
    nearest = int(np.argmin(away))
    clear_m = profile.circumscribed_radius_m + math.sqrt(2) * half + config.closed_gap_m
    beyond = np.flatnonzero(away[nearest:] >= clear_m)
    if len(beyond) == 0:
        return None
    x, y = path[nearest + beyond[0]].tolist()
    corners = ((x + a * half, y + b * half) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return Zone(
        id=f"closed {x:.2f} {y:.2f}",
        name="a blocked passage",
        polygon=tuple(corners),
        colour=OWN_COLOUR,
    )
