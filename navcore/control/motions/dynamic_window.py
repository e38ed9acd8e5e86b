"""Rollouts among moving obstacles that do not give way: to stop before them would not help.

Pairs of velocities, one driven for a moment and then another, are rolled out with the platform's
accelerations against the predicted positions of everyone near. Of those that meet no person, or
meet one latest, the one that ends nearest to the path ahead is driven; obstacles and unobserved
cells constrain it as ever.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from navcore.compiled import compiled
from navcore.config.control import CONTROL_CONFIG, DynamicWindowConfig
from navcore.control.collision.collision_checker import CollisionChecker, stopping_trajectory
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.arrays import Floats, Points
from navcore.geometry.polyline import metres_along, points_at
from navcore.geometry.transform import STANDSTILL, Twist
from navcore.robot.profile import RobotProfile


class _Costs(NamedTuple):
    """The costs of meeting people as the compiled loop takes them."""

    horizon_s: float
    step_s: float
    collision: float
    early_per_s: float
    near_m: float
    near: float
    near_delay_s: float


def avoid(checker: CollisionChecker, path: Points, now: Twist) -> Motion:
    """Choose the velocity that leads on along the (N, 2) path, base frame, and away from everyone
    near; standing where none is free.

    `now` is the measured velocity.
    """
    config, profile = checker.control.dynamic_window, checker.profile
    pairs = _pairs(profile.max_speed_mps, checker.local.turn_rate_radps, config)
    poses = _poses(profile, pairs, now, config)
    ahead_m = np.array([config.horizon_s * profile.max_speed_mps])
    aim = points_at(path, metres_along(path), ahead_m)[0]
    change = np.abs(pairs[:, 0] - now.v_mps) + profile.circumscribed_radius_m * np.abs(
        pairs[:, 1] - now.w_radps
    )
    left_m = np.hypot(poses[:, -1, 0] - aim[0], poses[:, -1, 1] - aim[1])
    cost = _meeting_cost(checker, poses) + left_m + config.change_cost * change
    order = np.argsort(cost, kind="stable")
    for start in range(0, len(order), config.batch):
        batch = order[start : start + config.batch]
        free = checker.clearance(poses[batch])[:, -1] > checker.padding_m
        for index in batch[free].tolist():
            twist = Twist(v_mps=float(pairs[index, 0]), w_radps=float(pairs[index, 1]))
            if checker.is_free(stopping_trajectory(twist, profile), checker.padding_m / 2):
                stands = twist == STANDSTILL
                state = ControllerState.WAIT_FOR_PEOPLE if stands else ControllerState.AVOID
                return Motion(twist=twist, outcome=state)
    return Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)


def will_collide(checker: CollisionChecker, twist: Twist, now: Twist) -> bool:
    """Return whether any person comes too near to a robot that goes on with a velocity."""
    config = checker.control.dynamic_window
    pair = np.array([[twist.v_mps, twist.w_radps] * 2])
    poses = _poses(checker.profile, pair, now, config)
    return bool(_meeting_cost(checker, poses)[0] >= config.collision_cost)


def _poses(profile: RobotProfile, pairs: Floats, now: Twist, config: DynamicWindowConfig) -> Floats:
    """(A, S, 3) the rollout of each pair of velocities, base frame."""
    limits = profile.max_accel_mps2, profile.max_yaw_accel_radps2
    steps = math.floor(config.horizon_s / config.step_s + 1e-6)
    return np.asarray(
        _rollouts(pairs, now.v_mps, now.w_radps, *limits, steps, config.step_s, config.first_s)
    )


def _meeting_cost(checker: CollisionChecker, poses: Floats) -> Floats:
    """(A,) cost in metres of meeting people along each rollout."""
    profile, rules = checker.profile, checker.people_config
    return np.asarray(
        _meeting(
            poses,
            checker.people.walking,
            profile.length_m / 2,
            profile.width_m / 2,
            rules.personal_m,
            rules.personal_per_s,
            _costs(checker.control.dynamic_window),
        )
    )


def _costs(config: DynamicWindowConfig) -> _Costs:
    return _Costs(
        horizon_s=config.horizon_s,
        step_s=config.step_s,
        collision=config.collision_cost,
        early_per_s=config.early_cost_per_s,
        near_m=config.near_m,
        near=config.near_cost,
        near_delay_s=config.near_delay_s,
    )


@lru_cache(maxsize=8)
def _pairs(max_speed_mps: float, turn_rate_radps: float, config: DynamicWindowConfig) -> Floats:
    """(A, 4) speed and yaw rate at first, and afterwards: the same speed, the highest one, or
    standing."""
    found = list[tuple[float, float, float, float]]()
    for speed in config.speed_shares:
        for turn in config.turn_shares:
            found.append((speed, turn, 0.0, 0.0))
            for after in sorted({speed, 1.0} - {0.0}):
                found += [(speed, turn, after, then) for then in config.turn_shares]
    return np.asarray(np.array(found) * np.array([max_speed_mps, turn_rate_radps] * 2))


@compiled
def _rollouts(
    pairs: Floats,
    v: float,
    w: float,
    accel: float,
    yaw_accel: float,
    steps: int,
    step_s: float,
    first_s: float,
) -> Floats:
    """(A, S, 3) poses along which each pair of velocities takes the robot, from its present one."""
    poses = np.empty((len(pairs), steps, 3))
    for a in range(len(pairs)):
        x, y, heading, speed, turn = 0.0, 0.0, 0.0, v, w
        for s in range(steps):
            first = s * step_s < first_s
            goal_v, goal_w = (pairs[a, 0], pairs[a, 1]) if first else (pairs[a, 2], pairs[a, 3])
            before_v, before_w = speed, turn
            speed += min(max(goal_v - speed, -accel * step_s), accel * step_s)
            turn += min(max(goal_w - turn, -yaw_accel * step_s), yaw_accel * step_s)
            mean_v, mean_w = (speed + before_v) / 2, (turn + before_w) / 2
            x += mean_v * step_s * math.cos(heading + mean_w * step_s / 2)
            y += mean_v * step_s * math.sin(heading + mean_w * step_s / 2)
            heading += mean_w * step_s
            poses[a, s, 0], poses[a, s, 1], poses[a, s, 2] = x, y, heading
    return poses


@compiled
def _meeting(
    poses: Floats,
    walking: Floats,
    half_length: float,
    half_width: float,
    distance: float,
    distance_per_s: float,
    costs: _Costs,
) -> Floats:
    """(A,) cost of meeting (P, 5) people who walk, or passing close to them, along each rollout."""
    count, steps = poses.shape[0], poses.shape[1]
    cost = np.zeros(count)
    for a in range(count):
        met = False
        for s in range(steps):
            t = (s + 1) * costs.step_s
            cos, sin = math.cos(poses[a, s, 2]), math.sin(poses[a, s, 2])
            for p in range(len(walking)):
                dx = walking[p, 0] + t * walking[p, 2] - poses[a, s, 0]
                dy = walking[p, 1] + t * walking[p, 3] - poses[a, s, 1]
                out_x = max(abs(cos * dx + sin * dy) - half_length, 0.0)
                out_y = max(abs(cos * dy - sin * dx) - half_width, 0.0)
                gap = math.hypot(out_x, out_y) - walking[p, 4] - distance - distance_per_s * t
                if gap < 0.0 and not met:
                    met = True
                    cost[a] += costs.collision + costs.early_per_s * (costs.horizon_s - t)
                if gap < costs.near_m:
                    near = costs.step_s * costs.near * (costs.near_m - gap) ** 2
                    cost[a] += near / costs.near_m**2 / (costs.near_delay_s + t)
    return cost


def warm(profile: RobotProfile) -> None:
    """Compile the compiled functions before the robot moves."""
    config = CONTROL_CONFIG.dynamic_window
    poses = _poses(profile, np.zeros((1, 4)), STANDSTILL, config)
    _meeting(poses, np.zeros((1, 5)), 0.5, 0.35, 0.25, 0.1, _costs(config))
