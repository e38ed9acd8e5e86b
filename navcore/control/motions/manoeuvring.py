"""A manoeuvre among the obstacles and people near the robot: it is found, and driven step by
step."""

from __future__ import annotations

import numpy as np

from navcore.control.collision.collision_checker import CollisionChecker, stopping_trajectory
from navcore.control.manoeuvre.manoeuvre import (
    Manoeuvre,
    ManoeuvreProblem,
    manoeuvre_along,
    manoeuvre_to_see,
)
from navcore.control.manoeuvre.steering import steer
from navcore.control.motion import ControllerState, Motion
from navcore.control.people.social import clear_of_people
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2, Twist


def find_manoeuvre(checker: CollisionChecker, path: Points, pose: Pose2) -> Manoeuvre | None:
    """Find the cheapest manoeuvre that leads on along the (N, 2) path, base frame, or else to a
    viewpoint of how the path goes on; None without one."""
    problem = manoeuvre_problem(checker)
    return manoeuvre_along(path, problem, pose) or manoeuvre_to_see(path, problem, pose)


def manoeuvre_problem(checker: CollisionChecker) -> ManoeuvreProblem:
    """Return the surroundings as the search for a manoeuvre takes them."""
    # What touches the body would leave the search no first step; it is kept as each is driven.
    apart_m = checker.profile.distances_m(checker.contacts)
    beside = checker.contacts[apart_m > checker.cell_radius_m]
    return ManoeuvreProblem(
        obstacles=np.vstack([checker.others, beside]),
        cell_radius_m=checker.cell_radius_m,
        unseen=checker.unseen,
        unseen_clearance_m=checker.unseen_clearance_m,
        profile=checker.profile,
        clearance_m=checker.padding_m + checker.control.manoeuvre.extra_clearance_m,
        config=checker.control.manoeuvre,
        lattice=checker.control.lattice,
    )


def drive_manoeuvre(
    checker: CollisionChecker, manoeuvre: Manoeuvre, path: Points, pose: Pose2, *, began: Pose2
) -> Motion | None:
    """Drive one step of a manoeuvre; None where it is done, blocked, or belongs to another path."""
    config = checker.control.manoeuvre
    steered = steer(manoeuvre, pose, braking_mps2=checker.local.braking_mps2, config=config)
    if steered is None:
        return None
    twist, rest = steered
    poses = rest.in_base(pose)[None]
    target = pose.from_parent(np.array(rest.target))
    if float(np.hypot(*(path - target).T).min()) > config.path_distance_m:
        return None
    if not checker.is_free(poses, config.clearance_share * rest.clearance_m):
        return None
    if not _is_clear_of_people(checker, rest, pose):
        yields = ControllerState.WAIT_FOR_PEOPLE
        return Motion(twist=STANDSTILL, outcome=yields, began=began, manoeuvre=rest)
    padding_m = min(config.stop_clearance_share * rest.clearance_m, checker.padding_m)
    for share in config.speed_shares:
        slower = Twist(v_mps=share * twist.v_mps, w_radps=share * twist.w_radps)
        if checker.is_free(stopping_trajectory(slower, checker.profile), padding_m):
            state = ControllerState.MANOEUVRE
            return Motion(twist=slower, outcome=state, began=began, manoeuvre=rest)
    return None


def _is_clear_of_people(checker: CollisionChecker, rest: Manoeuvre, pose: Pose2) -> bool:
    if not len(checker.people.walking):
        return True
    clear = clear_of_people(
        checker.people,
        rest.in_base(pose)[None],
        rest.arrival_times_s(pose, checker.control.manoeuvre)[None],
        checker.profile,
        checker.people_config,
        checker.control.social,
    )
    return bool(clear.all())
