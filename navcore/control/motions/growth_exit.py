"""Driving out of the growth of a zone: the growth came over a robot beside the zone when its
position became uncertain.

The velocity is chosen that gains most distance from the zones among those on which the footprint
comes nearer to none, which are those that the safety gate lets pass. Where none gains any, as
beside a zone's long edge, where every turn brings a corner nearer, the robot drives along it. It
does not turn for no gain: in a room without a place outside of the growth it would do so for ever.
"""

from __future__ import annotations

import numpy as np

from navcore.config.control import GrowthExitConfig
from navcore.control.collision.collision_checker import CollisionChecker
from navcore.control.motion import BLOCKED, ControllerState, Motion
from navcore.geometry.arrays import Bools, Floats
from navcore.geometry.kinematics import chord_lengths
from navcore.geometry.transform import Pose2, Twist
from navcore.mission.zone_growth import GrownZone

_ROUNDING = 1e-9
_LEAST_GAIN_M = 1e-3
"""Gain in metres below which a turn in place gains nothing."""


def drive_out(
    checker: CollisionChecker,
    around: tuple[GrownZone, ...],
    pose: Pose2,
    goal: Floats,
    previous: Motion,
) -> Motion:
    """Return the motion that leads a robot at a pose, map frame, out of the growth of the zones
    around it; standing where every motion comes nearer to one, or to an obstacle, or where all that
    is left is to turn for no gain.

    Of motions that gain as much the one is taken that comes nearer to the goal, (x, y) in the map
    frame.
    """
    config = checker.control.growth_exit
    twists = _candidates(config)
    paths = _paths(twists, config)
    clear = (checker.clearance(paths) > checker.padding_m) & checker.is_observed(paths)
    permitted, gained_m = _gains(around, paths, checker.profile.footprint(), pose)
    ends = pose.to_parent(paths[:, -1, :2])
    x_m, y_m = goal
    nearer_m = pose.distance_to(x_m, y_m) - np.hypot(*(ends - goal).T)
    keeps_on = twists[:, 0] * previous.twist.v_mps > 0
    if previous.twist.v_mps == 0:
        keeps_on = (twists[:, 0] == 0) & (twists[:, 1] * previous.twist.w_radps > 0)
    score = gained_m + config.goal_weight * nearer_m + config.keep_on_m * keeps_on
    score[~(clear.all(axis=1) & permitted)] = -np.inf
    best = int(np.argmax(score))
    v_mps, w_radps = twists[best].tolist()
    turns_in_vain = v_mps == 0 and gained_m[best] < _LEAST_GAIN_M
    if not np.isfinite(score[best]) or turns_in_vain:
        return BLOCKED
    state = ControllerState.FOLLOW if v_mps > 0 else ControllerState.BACK
    outcome = ControllerState.TURN if v_mps == 0 else state
    return Motion(twist=Twist(v_mps=v_mps, w_radps=w_radps), outcome=outcome)


def _candidates(config: GrowthExitConfig) -> Floats:
    """Return (C, 2) speeds and yaw rates: forward, backward and in place."""
    rates = np.linspace(-config.yaw_rate_radps, config.yaw_rate_radps, config.yaw_rates)
    speeds = (config.speed_mps, -config.speed_mps)
    moving = [(speed, rate) for speed in speeds for rate in rates]
    return np.array([*moving, (0.0, config.yaw_rate_radps), (0.0, -config.yaw_rate_radps)])


def _paths(twists: Floats, config: GrowthExitConfig) -> Floats:
    """Return (C, S, 3) poses along the velocities, base frame."""
    moments = np.linspace(0.0, config.horizon_s, config.poses + 1)[1:]
    turned = twists[:, 1:] * moments
    chord = chord_lengths(twists[:, :1] * moments, turned)
    return np.stack([chord * np.cos(turned / 2), chord * np.sin(turned / 2), turned], axis=-1)


def _gains(
    around: tuple[GrownZone, ...], paths: Floats, footprint: Floats, pose: Pose2
) -> tuple[Bools, Floats]:
    """Return (C,) whether the paths come nearer to no zone, and (C,) the distance in metres that
    they gain from the zone that they gain least from."""
    cos, sin = np.cos(paths[..., 2]), np.sin(paths[..., 2])
    turned = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)
    outlines = np.einsum("csij,kj->cski", turned, footprint) + paths[:, :, None, :2]
    outlines = pose.to_parent(outlines.reshape(-1, 2)).reshape(-1, *footprint.shape)
    permitted, gained_m = np.ones(len(paths), dtype=np.bool_), np.full(len(paths), np.inf)
    for one in around:
        now = float(one.relative_distance(pose.to_parent(footprint)[None])[0])
        later = one.relative_distance(outlines).reshape(paths.shape[:2])
        permitted &= later.min(axis=1) >= min(now, 1.0) - _ROUNDING
        gained_m = np.minimum(gained_m, (later[:, -1] - now) * one.growth_m)
    return permitted, gained_m
