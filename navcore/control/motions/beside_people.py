"""What a robot beside people does besides keeping clear of them: it is slow, and keeps them in
view."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navcore.control.collision.collision_checker import CollisionChecker
from navcore.control.motion import ControllerState, Motion
from navcore.control.motions.turning import turn_with_room
from navcore.control.people.social import speed_limit_near_people
from navcore.geometry.transform import STANDSTILL, Twist, wrap_angle
from navcore.robot.profile import RobotProfile


def slow_beside_people(checker: CollisionChecker, motion: Motion) -> Motion:
    """The same motion, no faster than the people near allow."""
    limit_mps = speed_limit_near_people(
        checker.people, motion.twist, checker.profile, checker.people_config, checker.control.social
    )
    if limit_mps == 0.0 and motion.twist != STANDSTILL:
        yields = ControllerState.WAIT_FOR_PEOPLE
        return dataclasses.replace(motion, twist=STANDSTILL, outcome=yields, arc=None)
    return no_faster(motion, limit_mps, checker.profile)


def no_faster(motion: Motion, limit_mps: float, profile: RobotProfile) -> Motion:
    """The same motion with no point of the body faster than a limit."""
    twist, fastest_mps = motion.twist, profile.fastest_mps(motion.twist)
    if fastest_mps <= limit_mps:
        return motion
    share = limit_mps / fastest_mps
    slower = Twist(v_mps=share * twist.v_mps, w_radps=share * twist.w_radps)
    return dataclasses.replace(motion, twist=slower)


def face_person(checker: CollisionChecker, motion: Motion) -> Motion:
    """While waiting, turn to keep the nearest person in view, also one who has just left it: out of
    sight they could be anywhere. A robot with a scanner sees them all round.

    One whose way led by the robot is not looked for, neither soon nor before it sets off: one who
    comes back walks into the turning robot as often as into one that sets off unseeing, and where
    people walk to and fro beside it, it would wait twice as long. Beside a person, whom a corner
    would swing towards, in a door or another narrow place it does not turn either.
    """
    sought = checker.people.expected_discs[:, :2] - (checker.profile.camera.x_m, 0.0)
    if len(sought) == 0 or checker.profile.scanner is not None:
        return motion
    x, y = sought[np.hypot(*sought.T).argmin()].tolist()
    bearing, in_view = math.atan2(y, x), math.radians(checker.control.turn.face_person_deg)
    if abs(bearing) <= in_view:
        return motion
    turn = turn_with_room(checker, bearing)
    if turn is None or _is_beside_people(checker):
        return motion
    around_m = checker.profile.circumscribed_radius_m + checker.people_config.personal_m
    checker = dataclasses.replace(checker, people=checker.people.as_expected(around_m))
    return slow_beside_people(checker, dataclasses.replace(motion, twist=turn.twist))


def loses_sight(checker: CollisionChecker, angle: float) -> bool:
    """Return whether a turn in place by an angle takes a person who walks, or may walk on, out of
    view, and they could be beside the robot before it has driven on: it would stand there and wait
    for a person whom it does not see come back."""
    if checker.profile.scanner is not None or checker.people.expectations.ignore_predictions:
        return False
    rules, turning = checker.people_config, checker.control.turn
    ahead, in_view = math.radians(turning.face_person_deg), math.radians(turning.in_view_deg)
    needed_s = abs(angle) / checker.local.turn_rate_radps + rules.waiting_s
    for x, y, speed_mps, radius_m in checker.people.reachable_discs.tolist():
        now = math.atan2(y, x - checker.profile.camera.x_m)
        then = abs(wrap_angle(now - angle))
        leaves_view = abs(now) <= in_view and then > max(ahead, abs(now))
        if leaves_view and checker.profile.gap_m(x, y) - radius_m < speed_mps * needed_s:
            return True
    return False


def _is_beside_people(checker: CollisionChecker) -> bool:
    """Return whether a person who walks is within twice the personal distance of the body, or may
    be if they have walked on: so near the camera sees only a part of them."""
    beside_m = 2.0 * checker.people_config.personal_m
    return any(
        checker.profile.gap_m(x, y) - radius <= beside_m
        for x, y, _, radius in checker.people.expected_discs.tolist()
    )
