"""Reversing: a few steps back from what blocks the robot, or back along the driven path."""

from __future__ import annotations

import numpy as np

from navcore.control.collision.collision_checker import CollisionChecker
from navcore.control.motion import BLOCKED, ControllerState, Motion
from navcore.control.motion_primitives import arcs
from navcore.control.motions.beside_people import no_faster, slow_beside_people
from navcore.control.motions.path_follower import follow
from navcore.control.people.social import recedes
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2, Twist


def back_off(checker: CollisionChecker, began: Pose2) -> Motion:
    """Reverse along the clearest arc, slowly, over ground that was observed or driven before."""
    config, primitives = checker.control.reverse, arcs(checker.control.arcs)
    checker, curvatures = checker.without_front_contacts(), primitives.curvatures_1pm
    behind = primitives.poses[:, : config.poses] * np.array([-1.0, 1.0, -1.0])
    free = (checker.clearance(behind) > checker.padding_m) & checker.is_observed(behind)
    count = free.sum(axis=1)
    # In so tight a bend a corner of the front moves forward.
    count[np.abs(curvatures) * checker.profile.width_m / 2 >= 1] = 0
    arc = int(np.argmax(count - config.curvature_weight * np.abs(curvatures)))
    if count[arc] <= behind.shape[1] // 2:  # an arc may have fewer poses than are to be checked
        return BLOCKED
    speed = config.speed_mps
    twist = Twist(v_mps=-speed, w_radps=-speed * float(curvatures[arc]))
    return Motion(twist=twist, outcome=ControllerState.BACK, began=began)


def retreat(checker: CollisionChecker, driven: Points) -> Motion:
    """Reverse along the driven path, (N, 2) in the base frame; stand where that is blocked or may
    bring the body nearer to a person.

    Seen from a robot that faces the other way it is a path like any other: the footprint is the
    same from both ends.
    """
    behind, primitives = checker.reversed(), arcs(checker.control.arcs)
    speed_mps = checker.control.reverse.speed_mps
    alone = follow(behind.without_people(), -driven, primitives) if len(driven) > 1 else None
    if alone is None or alone.arc is None:
        return BLOCKED
    if len(checker.people.walking) == 0:
        return slow_beside_people(checker, _backwards(alone, speed_mps))
    receding = recedes(
        behind.people,
        primitives.poses[alone.arc],
        primitives.distances_m / speed_mps,
        checker.profile,
        checker.people_config,
        checker.control.social,
    )
    if receding:
        slowly = _backwards(alone, speed_mps)
        return no_faster(slowly, checker.people_config.near_mps, checker.profile)
    motion = follow(behind, -driven, primitives)
    if motion is None:
        return Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
    return slow_beside_people(checker, _backwards(motion, speed_mps))


def _backwards(motion: Motion, speed_mps: float) -> Motion:
    """The motion of a robot that faces the other way, no faster than a speed."""
    twist = motion.twist
    share = min(1.0, speed_mps / max(twist.v_mps, speed_mps))
    return Motion(
        twist=Twist(v_mps=-share * twist.v_mps, w_radps=share * twist.w_radps),
        outcome=ControllerState.BACK,
    )
