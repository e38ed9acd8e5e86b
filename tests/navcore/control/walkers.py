"""People who walk near the robot, and what one decision beside them must not do."""

from __future__ import annotations

import math

import numpy as np
import shapely

from navcore.control.motion import IDLE, ControllerState
from navcore.control.people.people_state import PEOPLE_CONFIG, PeopleState
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY
from tests.navcore.control.planning import ORIGIN, decide, footprints


def driven(pose: Pose2, twist: Twist, period_s: float) -> Pose2:
    """The pose of the robot after a period."""
    turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=twist.w_radps * period_s / 2)
    return pose @ turn @ Pose2(x_m=twist.v_mps * period_s, y_m=0.0, yaw_rad=0.0) @ turn


def crossing(x: float, y: float, vx: float, vy: float) -> PeopleState:
    """A person who walks, in the base frame."""
    return PeopleState(walking=np.array([[x, y, vx, vy, 0.3]]), standing=np.empty((0, 5)))


def closest(people: PeopleState, *, care: bool) -> tuple[float, float, float, set[ControllerState]]:
    """A drive past a person: the least gap while the robot moves, the robot's x and the person's y
    at that moment, and all controller states."""
    pose, motion, period_s = ORIGIN, IDLE, 0.1
    path = np.column_stack([np.linspace(0, 9, 91), np.zeros(91)])
    x, y, vx, vy, radius = people.walking[0].tolist()
    least, outcomes = (math.inf, 0.0, 0.0), set[ControllerState]()
    for _ in range(90):
        track = Track(
            id=1, x_m=x, y_m=y, vx_mps=vx, vy_mps=vy, radius_m=radius, age_s=1.0, last_seen_ns=0
        )
        motion = decide(
            path=path,
            pose=pose,
            previous=motion,
            people=PeopleState.of((track,) if care else (), pose),
        )
        outcomes.add(motion.outcome)
        pose = driven(pose, motion.twist, period_s)
        x, y = x + period_s * vx, y + period_s * vy
        gap_m = float(shapely.distance(footprints([pose])[0], shapely.Point(x, y))) - radius
        least = min(least, (gap_m, pose.x_m, y)) if motion.twist != STANDSTILL else least
    return *least, outcomes


BEHIND = np.column_stack([-np.linspace(0.0, 2.0, 21), np.zeros(21)])
"""A path driven to here."""


def walking_on(x: float, y: float, speed: float, heading: float, unseen_s: float) -> Track:
    """A person who was lost from sight at (x, y), as if they had walked on."""
    vx, vy = speed * math.cos(heading), speed * math.sin(heading)
    return Track(
        id=1,
        x_m=x + vx * unseen_s,
        y_m=y + vy * unseen_s,
        vx_mps=vx,
        vy_mps=vy,
        radius_m=0.3,
        age_s=9.0,
        last_seen_ns=0,
        unseen_s=unseen_s,
    )


def stops_in_time(twist: Twist, x: float, y: float, *, walked_m: float, speed_mps: float) -> bool:
    """Whether a robot stands before a person reaches it, who has walked so far towards it from
    (x, y) and goes on; of one that drives straight on, its leading edge counts for those behind."""
    rim_mps = abs(twist.w_radps) * HUSKY.circumscribed_radius_m
    fastest, along = abs(twist.v_mps) + rim_mps, math.copysign(x, x * twist.v_mps)
    is_behind = along < 0.0 and rim_mps < 0.35 * abs(twist.v_mps)
    beyond = 0.5 - along if is_behind else max(abs(x) - 0.5, 0)
    gap = math.hypot(beyond, max(abs(y) - 0.35, 0)) - 0.3 - walked_m
    return fastest == 0.0 or gap > speed_mps * (
        PEOPLE_CONFIG.reaction_s + fastest / HUSKY.max_accel_mps2
    )
