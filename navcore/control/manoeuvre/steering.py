"""Steering along a manoeuvre: the velocity that carries it on from a pose."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navcore.config.control import CONTROL_CONFIG, ManoeuvreConfig
from navcore.control.manoeuvre.manoeuvre import TURN_GEAR, Manoeuvre
from navcore.control.manoeuvre.state_lattice import FORWARD
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2, Twist, wrap_angle


def steer(
    manoeuvre: Manoeuvre,
    pose: Pose2,
    *,
    braking_mps2: float,
    config: ManoeuvreConfig = CONTROL_CONFIG.manoeuvre,
) -> tuple[Twist, Manoeuvre] | None:
    """Compute the velocity that carries a manoeuvre on from a pose, and its rest; None if it is
    done or the robot has left it."""
    poses, gears = manoeuvre.in_base(pose), manoeuvre.gears
    done = 0
    while done < len(gears) and _is_passed(poses[done], int(gears[done]), config):
        done += 1
    if done == len(gears):
        return None
    gear = int(gears[done])
    changes = np.flatnonzero(gears[done:] != gear)
    leg = poses[done : done + changes[0]] if len(changes) else poses[done:]
    if abs(gear) == TURN_GEAR:
        twist = _steer_turn(leg, gear, config)
    else:
        twist = _steer_leg(leg, gear, braking_mps2, config)
    if twist is None:
        return None
    rest = dataclasses.replace(manoeuvre, poses=manoeuvre.poses[done:], gears=gears[done:])
    return twist, rest


def _steer_turn(leg: Points, gear: int, config: ManoeuvreConfig) -> Twist | None:
    """The velocity of a turn in place; None for a robot that has left it."""
    if math.hypot(*leg[0, :2]) > config.max_error_m:
        return None
    left_rad = abs(wrap_angle(leg[0, 2])) + abs(leg[-1, 2] - leg[0, 2])
    rate = min(config.turn_radps, config.turn_base_radps + config.turn_gain_per_s * left_rad)
    return Twist(v_mps=0.0, w_radps=math.copysign(rate, gear))


def _steer_leg(
    leg: Points, gear: int, braking_mps2: float, config: ManoeuvreConfig
) -> Twist | None:
    """The velocity along a leg, forward or in reverse; None for a robot that has left it."""
    ahead = gear * leg
    if abs(ahead[0, 1]) > config.max_error_m:
        return None
    left_m = float(ahead[0, 0] + np.hypot(*np.diff(leg[:, :2], axis=0).T).sum())
    braking = math.sqrt(2 * config.braking_share * braking_mps2 * left_m)
    speed = min(
        config.forward_mps if gear == FORWARD else config.reverse_mps, braking + config.creep_mps
    )
    curvature = _curvature(ahead[:, :2], leg[-1, 2], config)
    speed = min(speed, config.turn_radps / max(abs(curvature), 1e-6))
    return Twist(v_mps=gear * speed, w_radps=speed * curvature)


def _is_passed(pose: Points, gear: int, config: ManoeuvreConfig) -> bool:
    if abs(gear) == TURN_GEAR:
        left = wrap_angle(float(pose[2])) * math.copysign(1, gear)
        return -math.pi / 2 < left <= math.radians(config.reached_deg)
    return float(gear * pose[0]) <= config.reached_m


def _curvature(points: Points, end_heading_rad: float, config: ManoeuvreConfig) -> float:
    """The curvature, in 1/m, of the arc to the point a lookahead distance ahead on a leg, which
    goes straight on at its end."""
    metres = np.concatenate(
        [[math.hypot(*points[0])], np.hypot(*np.diff(points, axis=0).T)]
    ).cumsum()
    if metres[-1] >= config.lookahead_m:
        x, y = points[int(np.searchsorted(metres, config.lookahead_m))]
    else:
        beyond = config.lookahead_m - metres[-1]
        direction = np.array([math.cos(end_heading_rad), math.sin(end_heading_rad)])
        x, y = points[-1] + beyond * direction
    largest = config.max_curvature_1pm
    return float(np.clip(2 * y / max(x * x + y * y, 1e-6), -largest, largest))
