"""Turns in place, as far as the footprint has room for them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navcore.control.collision.collision_checker import CollisionChecker
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.transform import Twist

_POSES = 12
"""Number of poses at which the clearance of a turn is measured."""
_ABOUT_M = 0.1
"""Clearance in metres from the middles of cells with which the robot turns all round."""
_LONGER_RAD = math.radians(90.0)
"""Angle by which a turn may be longer to end past where people have walked."""


def turn_in_place(
    checker: CollisionChecker, bearing: float, *, both_directions: bool = True
) -> Motion | None:
    """Turn in place towards the bearing, in the longer direction if the shorter one is blocked, or
    the longer one ends past more of where people have walked; None when neither is free."""
    config = checker.control.turn
    for angle in _directions(checker, bearing) if both_directions else (bearing,):
        count = max(2, math.ceil(abs(angle) / math.radians(config.step_deg)))
        if checker.can_turn_to(np.linspace(0.0, angle, count)[None]).all():
            rate = min(
                checker.local.turn_rate_radps,
                config.base_rate_radps + config.gain_per_s * abs(angle),
            )
            twist = Twist(v_mps=0.0, w_radps=math.copysign(rate, angle))
            return Motion(twist=twist, outcome=ControllerState.TURN)
    return None


def turn_with_room(checker: CollisionChecker, bearing: float) -> Motion | None:
    """Turn in place to the bearing, the shorter way, as long as there is room; None where the turn
    would bring the body close to an obstacle: what it comes to see there might keep it from turning
    on or back."""
    poses = np.zeros((1, _POSES, 3))
    poses[..., 2] = np.linspace(0.0, bearing, _POSES)
    close_m = min(
        checker.control.path_follower.padding_factor * checker.local.padding_m,
        checker.farthest_m - checker.control.collision.tolerance_m,
    )
    if not (checker.clearance(poses) > close_m).all():
        return None
    return turn_in_place(checker, bearing, both_directions=False)


def can_turn_about(checker: CollisionChecker) -> bool:
    """Return whether the robot could turn all round where it is: in a door a part of a turn leaves
    it askew between the posts."""
    radius_m = checker.profile.circumscribed_radius_m + _ABOUT_M
    return len(checker.obstacles) == 0 or bool(np.hypot(*checker.obstacles.T).min() > radius_m)


def spin(checker: CollisionChecker) -> Motion | None:
    """Turn on in place, to the left where that is free; None where neither direction is."""
    step_rad = math.radians(checker.control.turn.spin_check_deg)
    for bearing in (step_rad, -step_rad):
        turn = turn_in_place(checker, bearing, both_directions=False)
        if turn is not None:
            return dataclasses.replace(turn, outcome=ControllerState.SPIN)
    return None


def turned_by(motion: Motion, bearing: float) -> float:
    """Return by which angle a motion that turns in place comes to a bearing."""
    is_shorter = motion.twist.w_radps * bearing >= 0.0
    return bearing if is_shorter else bearing - math.copysign(2 * math.pi, bearing)


def _directions(checker: CollisionChecker, bearing: float) -> tuple[float, float]:
    """Return the angles of both turns to a bearing, in the order in which they are tried.

    Who walks to and fro is soon back, and the robot that turns about is about to cross their way:
    the turn comes to its bearing past the side of it on which more of them have walked, out of view
    there. The sides are those of the bearing, so that the turn goes on as it has begun.
    """
    other = bearing - math.copysign(2 * math.pi, bearing)
    walked = checker.people.walked
    is_long = abs(other) - abs(bearing) > _LONGER_RAD
    if is_long or len(walked) == 0 or checker.profile.scanner is not None:
        return bearing, other
    seen = np.arctan2(walked[:, 1], walked[:, 0]) - bearing
    aside = np.arctan2(np.sin(seen), np.cos(seen))
    in_view_rad = math.radians(checker.control.turn.in_view_deg)
    left, right = (int((side * aside > in_view_rad).sum()) for side in (1.0, -1.0))
    # Past the left of the bearing the robot turns to the right.
    if left != right and (left > right) == (bearing > 0.0):
        return other, bearing
    return bearing, other
