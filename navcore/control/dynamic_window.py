"""Getting out of the way of what moves and looks out for nobody: to stand still before it would not
help.

Pairs of velocities, one driven for a moment and then another, are rolled out with the platform's
accelerations against where everybody will be if he goes on as he does. Of those that nobody meets,
or meets latest, the one that ends nearest to the path ahead is driven; what stands near and what
was not seen yet bind as they always do.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numba
import numpy as np
import numpy.typing as npt

from navcore.control.collision_checker import CollisionChecker, stopping_trajectory
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.polyline import metres_along, points_at
from navcore.geometry.transform import STANDSTILL, Twist
from navcore.robot.profile import RobotProfile

Floats = npt.NDArray[np.float64]

HORIZON_S, STEP_S = 2.0, 0.1
"""So far ahead the velocities are rolled out, and in such steps."""
FIRST_S = 0.6
"""The first velocity of a pair is driven for so long."""
SPEEDS = (-0.5, 0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the platform's speed, in reverse too …"""
TURNS = (-1.0, -0.6, -0.3, -0.12, 0.0, 0.12, 0.3, 0.6, 1.0)
"""… and of its yaw rate in a turn, that are tried."""
MET_COST, PER_S_COST = 50.0, 100.0
"""In metres of way, what being met costs, and each second sooner that one is."""
NEAR_M, NEAR_COST = 0.3, 10.0
"""Somebody this near beyond the room kept from him costs something, the more the sooner and the
nearer."""
BATCH = 32
"""So many of the best are looked at together for what stands near."""


def avoid(near: CollisionChecker, path: Floats, now: Twist) -> Motion:
    """The velocity that gets on along the (N, 2) path, base frame, and out of everybody's way;
    standing where none is free.

    `now` is the velocity that the robot has.
    """
    profile = near.profile
    pairs = _pairs(profile.max_speed_mps, near.rules.turn_rate_radps)
    poses = _poses(profile, pairs, now)
    aim = _ahead(path, HORIZON_S * profile.max_speed_mps)
    change = np.abs(pairs[:, 0] - now.v_mps) + profile.circumscribed_radius_m * np.abs(
        pairs[:, 1] - now.w_radps
    )
    cost = _meeting_cost(near, poses) + _way_left(poses, aim) + 0.05 * change
    order = np.argsort(cost, kind="stable")
    for start in range(0, len(order), BATCH):
        batch = order[start : start + BATCH]
        free = near.clear(poses[batch])[:, -1] > near.padding_m
        for index in batch[free].tolist():
            twist = Twist(v_mps=float(pairs[index, 0]), w_radps=float(pairs[index, 1]))
            soon = stopping_trajectory(twist, profile)
            if (near.clear(soon) > near.padding_m / 2).all() and near.is_observed(soon).all():
                return Motion(
                    twist=twist,
                    outcome=ControllerState.YIELD if twist == STANDSTILL else ControllerState.DODGE,
                )
    return Motion(twist=STANDSTILL, outcome=ControllerState.YIELD)


def will_collide(near: CollisionChecker, twist: Twist, now: Twist) -> bool:
    """Whether anybody comes too near to a robot that goes on with a velocity."""
    pair = np.array([[twist.v_mps, twist.w_radps] * 2])
    return bool(_meeting_cost(near, _poses(near.profile, pair, now))[0] >= MET_COST)


def _poses(profile: RobotProfile, pairs: Floats, now: Twist) -> Floats:
    limits = profile.max_accel_mps2, profile.max_yaw_accel_radps2
    return np.asarray(
        _rollouts(pairs, now.v_mps, now.w_radps, *limits, round(HORIZON_S / STEP_S), STEP_S)
    )


def _meeting_cost(near: CollisionChecker, poses: Floats) -> Floats:
    half_length_m, half_width_m = near.profile.length_m / 2, near.profile.width_m / 2
    room_m, per_s = near.people_config.personal_m, near.people_config.personal_per_s
    return np.asarray(
        _meeting(poses, near.people.walking, half_length_m, half_width_m, room_m, per_s)
    )


@lru_cache(maxsize=8)
def _pairs(max_speed_mps: float, turn_rate_radps: float) -> Floats:
    """(A, 4) speed and yaw rate at first, and afterwards: on at that speed, or at the highest, or
    standing."""
    found = list[tuple[float, float, float, float]]()
    for speed in SPEEDS:
        for turn in TURNS:
            found.append((speed, turn, 0.0, 0.0))
            for after in sorted({speed, 1.0} - {0.0}):
                found += [(speed, turn, after, then) for then in TURNS]
    return np.asarray(np.array(found) * np.array([max_speed_mps, turn_rate_radps] * 2))


def _ahead(path: Floats, metres: float) -> Floats:
    """(2,) the point of the path so far along it, or its end."""
    return np.asarray(points_at(path, metres_along(path), np.array([metres]))[0])


def _way_left(poses: Floats, aim: Floats) -> Floats:
    """(A,) metres from the end of each rollout to the aim."""
    return np.asarray(np.hypot(poses[:, -1, 0] - aim[0], poses[:, -1, 1] - aim[1]))


@numba.njit(cache=True, nogil=True)
def _rollouts(
    pairs: Floats, v: float, w: float, accel: float, yaw_accel: float, steps: int, step_s: float
) -> Floats:
    """(A, S, 3) where each pair of velocities takes the robot, from the velocity that it has."""
    poses = np.empty((len(pairs), steps, 3))
    for a in range(len(pairs)):
        x, y, heading, speed, turn = 0.0, 0.0, 0.0, v, w
        for s in range(steps):
            first = s * step_s < FIRST_S
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


@numba.njit(cache=True, nogil=True)
def _meeting(
    poses: Floats,
    walking: Floats,
    half_length: float,
    half_width: float,
    room: float,
    room_per_s: float,
) -> Floats:
    """(A,) what being met by (P, 5) walking people costs, or passing close to them, along each
    rollout."""
    arcs, steps = poses.shape[0], poses.shape[1]
    cost = np.zeros(arcs)
    for a in range(arcs):
        met = False
        for s in range(steps):
            t = (s + 1) * STEP_S
            cos, sin = math.cos(poses[a, s, 2]), math.sin(poses[a, s, 2])
            for p in range(len(walking)):
                dx = walking[p, 0] + t * walking[p, 2] - poses[a, s, 0]
                dy = walking[p, 1] + t * walking[p, 3] - poses[a, s, 1]
                out_x = max(abs(cos * dx + sin * dy) - half_length, 0.0)
                out_y = max(abs(cos * dy - sin * dx) - half_width, 0.0)
                gap = math.hypot(out_x, out_y) - walking[p, 4] - room - room_per_s * t
                if gap < 0.0 and not met:
                    met = True
                    cost[a] += MET_COST + PER_S_COST * (HORIZON_S - t)
                if gap < NEAR_M:
                    cost[a] += STEP_S * NEAR_COST * (NEAR_M - gap) ** 2 / NEAR_M**2 / (0.5 + t)
    return cost


def warm(profile: RobotProfile) -> None:
    """Compile what is compiled, before the robot moves."""
    poses = _rollouts(
        np.zeros((1, 4)), 0.0, 0.0, profile.max_accel_mps2, profile.max_yaw_accel_radps2, 2, STEP_S
    )
    _meeting(poses, np.zeros((1, 5)), 0.5, 0.35, 0.25, 0.1)
