"""Path following: the motion primitive that gets furthest along the path, as fast as obstacles and
people allow."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.control import CONTROL_CONFIG, ControlConfig, LocalPlannerConfig
from navcore.control.collision.collision_checker import CollisionChecker
from navcore.control.motion import ControllerState, Motion
from navcore.control.motion_primitives import Primitives, arcs, errors_to_path
from navcore.control.people.social import clear_of_people, waiting_index
from navcore.costmap.local_costmap import outside
from navcore.geometry.arrays import Bools, Floats, Indices, Points
from navcore.geometry.transform import Twist
from navcore.robot.profile import RobotProfile


def follow(checker: CollisionChecker, path: Points, primitives: Primitives) -> Motion | None:
    """Drive the primitive that gains most along the (N, 2) path, base frame; None if all are
    blocked.

    Where people walk, several speeds are tried: a primitive that a person blocks now may be free a
    moment later.
    """
    config = checker.control.path_follower
    clearance = checker.clearance(primitives.poses)
    free = (clearance > checker.padding_m) & checker.is_observed(primitives.poses)
    progress, gain = _scores(checker, path, primitives, clearance)
    free, gain, fastest = _clear_of_people(checker, primitives, free, gain)
    best, step = (int(index) for index in np.unravel_index(int(np.argmax(gain)), gain.shape))
    goal_m = float(np.hypot(*path[-1]))
    least = min(config.min_progress_m, config.min_progress_share * goal_m)
    if not np.isfinite(gain[best, step]) or progress[best, step] < least:
        return None
    if len(checker.people.walking) and not free[best, -1]:
        waits_m = _waiting_distance(checker, primitives, best, free[best], fastest)
        if waits_m is None:
            return None
        fastest = min(fastest, math.sqrt(2 * checker.local.braking_mps2 * waits_m))
    curvature = float(primitives.curvatures_1pm[best])
    speed = min(
        fastest,
        _braking_speed(checker, float(primitives.distances_m[free[best]].max()), goal_m),
        checker.profile.max_speed_mps
        * (
            config.contact_speed_share
            + config.speed_share_per_m * float(clearance[best, : step + 1].min())
        ),
        checker.local.turn_rate_radps / max(abs(curvature), 1e-6),
    )
    twist = Twist(v_mps=speed, w_radps=speed * curvature)
    return Motion(twist=twist, outcome=ControllerState.FOLLOW, arc=best)


def _scores(
    checker: CollisionChecker, path: Points, primitives: Primitives, clearance: Floats
) -> tuple[Floats, Floats]:
    """(A, S) progress along the path in metres, and what it is worth after all penalties."""
    config, local = checker.control.path_follower, checker.local
    progress, lateral, heading = errors_to_path(
        path,
        primitives.poses,
        horizon_m=config.horizon_factor * local.lookahead_m,
        tangent_m=config.tangent_m,
    )
    narrow = config.clearance_weight * np.maximum(
        0.0, config.clearance_m - clearance
    ) + config.padding_weight * np.maximum(0.0, config.padding_factor * local.padding_m - clearance)
    bends = config.curvature_weight * np.abs(primitives.curvatures_1pm)[:, None]
    return progress, progress - lateral - config.heading_weight * heading - narrow - bends


def _clear_of_people(
    checker: CollisionChecker, primitives: Primitives, free: Bools, gain: Floats
) -> tuple[Bools, Floats, float]:
    """(A, S) poses that are free of people too and their gain, at the speed in m/s of those tried
    at which the best one gains most."""
    fastest = checker.profile.max_speed_mps
    if not len(checker.people.walking):
        return free, np.where(free, gain, -np.inf), fastest
    config = checker.control.path_follower
    bends = np.maximum(np.abs(primitives.curvatures_1pm), 1e-6)
    best: tuple[Bools, Floats, float] | None = None
    for share in config.speed_shares:
        speeds = np.minimum(share * fastest, checker.local.turn_rate_radps / bends)
        clear = free & clear_of_people(
            checker.people,
            primitives.poses,
            primitives.distances_m / speeds[:, None],
            checker.profile,
            checker.people_config,
            checker.control.social,
        )
        gained = np.where(clear, gain - config.slowness_weight * (1 - share), -np.inf)
        if best is None or gained.max() > best[1].max():
            best = clear, gained, share * fastest
    assert best is not None
    return best


def _waiting_distance(
    checker: CollisionChecker, primitives: Primitives, best: int, free: Bools, speed_mps: float
) -> float | None:
    """Distance in metres along a primitive at which the robot can wait for people; None if there is
    none."""
    distances_m = primitives.distances_m[free]
    waiting = waiting_index(
        checker.people,
        primitives.poses[best][free],
        distances_m / speed_mps,
        checker.profile,
        checker.people_config,
        checker.control.social,
    )
    return None if waiting < 0 else float(primitives.distances_m[waiting])


def _braking_speed(checker: CollisionChecker, free_m: float, goal_m: float) -> float:
    """Speed in m/s from which the robot stops before the free stretch ends, and at the goal.

    The free stretch ends where the padding would be touched; the padding itself is what is left
    after braking.
    """
    config, braking_mps2 = checker.control.path_follower, checker.local.braking_mps2
    stopping_m = max(free_m - config.stop_margin_m, config.min_free_m)
    return min(
        math.sqrt(2 * braking_mps2 * stopping_m),
        math.sqrt(2 * config.goal_braking_share * braking_mps2 * goal_m) + config.goal_speed_mps,
    )


def candidates(
    *,
    geometric: Points,
    forbidden: Points,
    profile: RobotProfile,
    local: LocalPlannerConfig,
    cell_m: float,
    control: ControlConfig = CONTROL_CONFIG,
) -> tuple[Floats, Indices]:
    """Return what the local planner chooses from: (A, S, 2) points of the motion primitives, base
    frame, and (A,) the number of poses of each that are free.

    `geometric` and `forbidden` are (N, 2) centres of cells of side `cell_m`. People who walk and
    unobserved cells are left out, since they depend on speed and on the tick.
    """
    geometric = geometric[outside(geometric, profile, -cell_m / 2)]
    checker = CollisionChecker(
        obstacles=np.vstack([geometric, forbidden]),
        unseen=np.empty((0, 2)),
        cell_radius_m=cell_m * math.sqrt(0.5),
        profile=profile,
        local=local,
        control=control,
    )
    poses = arcs(control.arcs).poses
    free = checker.clearance(poses) > checker.padding_m
    count = np.where(free.all(axis=1), free.shape[1], np.argmin(free, axis=1))
    return poses[..., :2], count.astype(np.int64)
