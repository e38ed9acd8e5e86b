"""Following the path: of the motion primitives the one that gets furthest along it, as fast as what
stands near allows."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.control.collision_checker import CollisionChecker, stopping_trajectory
from navcore.control.motion import ControllerState, Motion
from navcore.control.primitives.arcs import ALONG_M, along
from navcore.control.primitives.library import Primitives
from navcore.control.social import clear_of_people, waiting_index
from navcore.geometry.transform import Twist

Points = npt.NDArray[np.float64]


def follow(near: CollisionChecker, path: Points, among: Primitives) -> Motion | None:
    """Drive the primitive that gets furthest along the path while staying near it; None when every
    one is blocked at once.

    Where somebody walks they are tried at several speeds: what is blocked by him now may be free a
    moment later.
    """
    rules, bends, poses = near.rules, among.bends_1pm, among.poses
    if not len(poses):
        return None
    clear = near.clear(poses)
    free = (clear > near.padding_m) & near.is_observed(poses)
    progress, aside, askew = along(path, poses, rules.lookahead_m)
    narrow = 0.6 * np.maximum(0.0, 0.25 - clear) + 2.0 * np.maximum(
        0.0, CLOSE * rules.padding_m - clear
    )
    gain = progress - aside - 0.15 * askew - narrow - 0.02 * np.abs(bends)[:, None]
    free, gain, fastest = _apart_from_people(near, among, free, gain)
    best, step = np.unravel_index(int(np.argmax(gain)), gain.shape)
    goal_m = float(np.hypot(*path[-1]))
    if not np.isfinite(gain[best, step]) or progress[best, step] < min(0.05, 0.5 * goal_m):
        return None
    free_m = float(ALONG_M[free[best]].max())
    if len(near.people.walking) and not free[best, -1]:
        waiting = waiting_index(
            near.people,
            poses[best][free[best]],
            ALONG_M[free[best]] / fastest,
            near.profile,
            near.people_config,
        )
        if waiting < 0:
            return None
        fastest = min(fastest, math.sqrt(2 * rules.braking_mps2 * float(ALONG_M[waiting])))
    # free_m ends where the padding would be touched; the padding itself is what is left after
    # braking.
    speed = min(
        fastest,
        math.sqrt(2 * rules.braking_mps2 * max(free_m - 0.04, 0.02)),
        math.sqrt(2 * 0.5 * rules.braking_mps2 * goal_m) + 0.02,
        near.profile.max_speed_mps * (0.3 + 2.0 * float(clear[best, : step + 1].min())),
        rules.turn_rate_radps / max(abs(float(bends[best])), 1e-6),
    )
    twist = Twist(v_mps=speed, w_radps=speed * float(bends[best]))
    held = _kept_clear(near, twist) if among.pursued else twist
    if held is None:
        return None
    return Motion(
        twist=held,
        outcome=ControllerState.FOLLOW,
        arc=int(best),
        among=among if among.pursued else None,
    )


def _apart_from_people(
    near: CollisionChecker, among: Primitives, free: npt.NDArray[np.bool_], gain: Points
) -> tuple[npt.NDArray[np.bool_], Points, float]:
    """Which (A, S) poses are free of people too, what they gain, and at which speed: of those tried
    the one that gains most."""
    fastest = near.profile.max_speed_mps
    if not len(near.people.walking):
        return free, np.where(free, gain, -np.inf), fastest
    best = None
    for share in SPEEDS:
        speeds = np.minimum(
            share * fastest, near.rules.turn_rate_radps / np.maximum(np.abs(among.bends_1pm), 1e-6)
        )
        clear = free & clear_of_people(
            near.people, among.poses, ALONG_M / speeds[:, None], near.profile, near.people_config
        )
        gained = np.where(clear, gain - 0.3 * (1 - share), -np.inf)
        if best is None or gained.max() > best[1].max():
            best = clear, gained, share * fastest
    assert best is not None
    return best


def _kept_clear(near: CollisionChecker, twist: Twist) -> Twist | None:
    """The twist, so slow that it stays clear until it expires, though it leaves a primitive whose
    bend changes; or None."""
    for share in (1.0, 0.75, 0.5, 0.3, 0.15):
        slower = Twist(v_mps=share * twist.v_mps, w_radps=share * twist.w_radps)
        soon = stopping_trajectory(slower, near.profile)
        if (near.clear(soon) > near.padding_m).all() and near.is_observed(soon).all():
            return slower
    return None


CLOSE = 2.4
"""Nearer to anything than so many paddings the robot goes only where it gains by it: odometry and
the map err by as much."""
SPEEDS = (1.0, 0.6, 0.35)
"""Shares of the full speed at which the way past somebody is tried."""
