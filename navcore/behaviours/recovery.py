"""What a robot does that is boxed in: wait, back off along the driven path, look round, call the
way closed, give up plainly.

A value with its transition, one for each tick. Each means is tried once at a place, the mildest
first, and the path is tried again after each; who comes away from the place begins anew the next
time.
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


class RecoveryAction(IntEnum):
    """What is tried, the mildest first."""

    NONE = 0
    """Nothing: the path is followed."""
    WAIT = 1
    """What stands in the way may go."""
    BACK = 2
    """Back off along the driven path, to where there was room."""
    LOOK = 3
    """Turn once round in place: the camera has not been everywhere."""
    CLOSE = 4
    """Take the way for closed, and have another planned."""
    GIVE_UP = 5
    """Nothing has helped: say so, and stand until the path can be followed after all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """Where it stands with the recovery; nothing is wrong, as it is made."""

    means: RecoveryAction = RecoveryAction.NONE
    """What is being tried."""
    tried: RecoveryAction = RecoveryAction.NONE
    """The last that was tried at this place; the next is a stronger one."""
    at: Pose2 | None = None
    """Where the robot was boxed in; None when it was not."""
    began: Pose2 | None = None
    """Where it began with the means of now."""
    since_ns: int = 0
    """When it did."""
    turned_rad: float = 0.0
    """How far it has turned since."""
    heading_rad: float = 0.0
    """Its heading at the last tick."""
    backs: int = 0
    """How often at this place it has backed off a little, or manoeuvred, and come no farther …"""
    backed_from: Pose2 | None = None
    """… the last time from here."""

    def after(self, motion: Motion, pose: Pose2, stamp_ns: int, rules: RecoveryConfig) -> Recovery:
        """With the motion of one more tick, decided at a pose of the map frame."""
        if self.at is not None and self.at.distance_to(pose.x_m, pose.y_m) > rules.left_m:
            return Recovery()
        turned = self.turned_rad + abs(wrap_angle(pose.yaw_rad - self.heading_rad))
        now = dataclasses.replace(
            self._counted(motion, pose), turned_rad=turned, heading_rad=pose.yaw_rad
        )
        stuck = motion.outcome is ControllerState.BOXED_IN or now.backs >= rules.tries
        lasts_s = (stamp_ns - self.since_ns) / 1e9
        if self.means is RecoveryAction.NONE:
            return now._enter(RecoveryAction.WAIT, pose, stamp_ns) if stuck else now
        if self.means is RecoveryAction.GIVE_UP:
            return (
                dataclasses.replace(now, means=RecoveryAction.NONE)
                if motion.outcome in ONWARD
                else now
            )
        if self.means is RecoveryAction.WAIT:
            if not stuck:
                return dataclasses.replace(now, means=RecoveryAction.NONE)
            return (
                now._enter(RecoveryAction(max(self.tried, RecoveryAction.WAIT) + 1), pose, stamp_ns)
                if lasts_s >= rules.wait_s
                else now
            )
        if (
            motion.outcome is ControllerState.BOXED_IN
            or lasts_s >= rules.manoeuvre_s
            or now._is_done(pose, rules)
        ):
            return dataclasses.replace(now, means=RecoveryAction.NONE, tried=self.means, backs=0)
        return now

    def _counted(self, motion: Motion, pose: Pose2) -> Recovery:
        if (
            self.means is not RecoveryAction.NONE
            or motion.began is None
            or motion.began == self.backed_from
        ):
            return self
        again = (
            self.backed_from is None
            or self.backed_from.distance_to(motion.began.x_m, motion.began.y_m) < AGAIN_M
        )
        return dataclasses.replace(
            self, at=self.at or pose, backs=self.backs + again, backed_from=motion.began
        )

    def _enter(self, means: RecoveryAction, pose: Pose2, stamp_ns: int) -> Recovery:
        return dataclasses.replace(
            self,
            means=means,
            at=self.at or pose,
            began=pose,
            since_ns=stamp_ns,
            turned_rad=0.0,
            heading_rad=pose.yaw_rad,
        )

    def _is_done(self, pose: Pose2, rules: RecoveryConfig) -> bool:
        if self.means is RecoveryAction.BACK:
            return (
                self.began is not None
                and self.began.distance_to(pose.x_m, pose.y_m) >= rules.back_m
            )
        return self.means is RecoveryAction.CLOSE or self.turned_rad >= 2 * math.pi


ONWARD = (
    ControllerState.FOLLOW,
    ControllerState.TURN,
    ControllerState.ALIGN,
    ControllerState.ARRIVED,
)
"""Who can do one of these after having given up has found a way after all."""
AGAIN_M = 0.5
"""What is begun nearer than this to where it was begun before has not helped."""
TRAIL_STEP_M, TRAIL_POINTS = 0.1, 50
"""The driven path is remembered so densely, and for so many points."""
CLOSED_M = 0.2
"""Half the side of the square that closes a way."""


def trail_with(trail: Points, pose: Pose2) -> Points:
    """(N, 2) the driven path, newest first, with one more pose of the map frame; without the loops
    in it.

    A robot that is back where it was before has come no further: what it drove in between is not on
    its way back.
    """
    here = np.array([[pose.x_m, pose.y_m]])
    again = np.flatnonzero(np.hypot(*(trail - here).T) < TRAIL_STEP_M)
    return trail[again[-1] :] if len(again) else np.vstack([here, trail[: TRAIL_POINTS - 1]])


def closed_way(path: Points, at: Pose2, profile: RobotProfile) -> Zone:
    """A place not to be in: there the (N, 2) path, map frame, goes on before a robot that was boxed
    in there.

    So far from it that the robot does not stand in that place itself, whichever way it has turned
    meanwhile.
    """
    away = np.hypot(path[:, 0] - at.x_m, path[:, 1] - at.y_m)
    nearest = int(np.argmin(away))
    beyond = np.flatnonzero(
        away[nearest:] >= profile.circumscribed_radius_m + math.sqrt(2) * CLOSED_M + 0.05
    )
    x, y = path[nearest + beyond[0] if len(beyond) else -1].tolist()
    corners = (
        (x + a * CLOSED_M, y + b * CLOSED_M) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    )
    return Zone(
        id=f"closed {x:.2f} {y:.2f}",
        name="a way that was found closed",
        polygon=tuple(corners),
        colour=OWN_COLOUR,
    )
