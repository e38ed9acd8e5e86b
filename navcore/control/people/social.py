"""People: where they may be along a motion, and how fast the robot may be beside them.

Two rules, and either is enough when the other errs. The first predicts: at the moment the robot
would be at a pose, no person may be near it or about to reach it, whether the person walks on or
turns back now; a person who has only stopped may do either, or step aside. So the robot passes
behind a person, and only when it will have passed before the person is back; until then it waits
beside the line of the person. The second predicts nothing: the robot must be able to stop before
any person could reach it, in whatever direction they turn; before they could reach its leading edge
if it drives straight on and they were lost behind it. While a person is out of sight, the disc
that the person may be in grows at walking speed about the position where they were lost, until they
have been gone for long. A robot that stood all that time would set off blindly at its end, so it
looks after them: a turn in place, for which they are taken to have walked on.
"""

from __future__ import annotations

import math

import numpy as np

from navcore.config.control import SocialConfig
from navcore.config.people import PeopleConfig
from navcore.control.people.people_state import SOCIAL_CONFIG, PeopleState
from navcore.control.people.walker_distance import are_clear, gaps
from navcore.geometry.arrays import Bools, Floats
from navcore.geometry.transform import Twist
from navcore.robot.profile import RobotProfile

_STRAIGHT = 0.35
"""Share of the speed along the heading below which a turn moves no point of the body, for the robot
to count as driving straight on."""
_ROUNDING_M = 1e-6
"""Distance in metres far above the rounding error of a gap."""


def clear_of_people(
    people: PeopleState,
    poses: Floats,
    times_s: Floats,
    profile: RobotProfile,
    rules: PeopleConfig,
    config: SocialConfig = SOCIAL_CONFIG,
) -> Bools:
    """Return (A, S) whether the motion up to each of (A, S, 3) poses, base frame, reached at (A, S)
    times in seconds, keeps clear of all people who walk."""
    return np.asarray(
        are_clear(
            people.walking,
            poses,
            times_s,
            (profile.length_m / 2, profile.width_m / 2),
            (rules.personal_m, rules.personal_per_s),
            _later_s(rules.headway_s, config.sample_s),
        )
    )


def waiting_index(
    people: PeopleState,
    poses: Floats,
    times_s: Floats,
    profile: RobotProfile,
    rules: PeopleConfig,
    config: SocialConfig = SOCIAL_CONFIG,
) -> int:
    """Return the index of the last of (S, 3) poses, base frame, reached at (S,) times in seconds,
    where the robot can wait in the path of no person; −1 without one.

    A robot that is in the path of a person already may wait where it obstructs no more than now,
    or it would stay there for ever.
    """
    here, *later_m = gaps(
        people.walking,
        np.vstack([np.zeros((1, 3)), poses])[None],
        np.concatenate([[0.0], times_s])[None],
        (profile.length_m / 2, profile.width_m / 2),
        _later_s(rules.waiting_s, config.sample_s),
    )[0].tolist()
    enough = rules.personal_m + config.waiting_margin_m
    waiting = np.flatnonzero(np.array(later_m) > enough).max(initial=-1)
    if waiting < 0 and here <= enough:
        waiting = np.flatnonzero(np.array(later_m) >= here).max(initial=-1)
    return int(waiting)


def recedes(
    people: PeopleState,
    poses: Floats,
    times_s: Floats,
    profile: RobotProfile,
    rules: PeopleConfig,
    config: SocialConfig = SOCIAL_CONFIG,
) -> bool:
    """Return whether a motion through (S, 3) poses, base frame, reached at (S,) times in seconds,
    comes no nearer to anyone than standing still would, wherever they walk or have stopped out of
    sight, or stays a personal distance away; and whether no one is about to touch the body, nor may
    have come up to it out of sight.

    To a robot that stands in the way of people such a motion only gains distance, even where they
    could reach it before it stops.
    """
    out_of_sight = people.reachable_discs[:, 3] > people.expected_discs[:, 3]
    for x, y, _, radius in people.reachable_discs[out_of_sight].tolist():
        if profile.gap_m(x, y) - radius <= config.stopped_gap_m:
            return False
    half = profile.length_m / 2, profile.width_m / 2
    lost = np.zeros((len(people.reachable_discs), 5))
    lost[:, :2], lost[:, 4] = people.reachable_discs[:, :2], people.expected_discs[:, 3]
    motions, moments = np.stack([poses, np.zeros_like(poses)]), np.stack([times_s, times_s])
    enough_m = rules.personal_m + rules.personal_per_s * times_s
    soon = times_s <= rules.headway_s
    for index, person in enumerate(np.vstack([people.walking, lost])):
        moved_m, stood_m = gaps(person[None], motions, moments, half, np.zeros(1))
        # Who has come up to a robot that stood does not walk on through it.
        until = np.logical_and.accumulate(stood_m > config.stopped_gap_m)
        if (moved_m < np.minimum(stood_m, enough_m) - _ROUNDING_M)[until].any():
            return False
        walks = index < len(people.walking)
        if walks and (moved_m[soon] < config.stopped_gap_m).any():
            return False
    return True


def speed_limit_near_people(
    people: PeopleState,
    twist: Twist,
    profile: RobotProfile,
    rules: PeopleConfig,
    config: SocialConfig = SOCIAL_CONFIG,
) -> float:
    """Return the speed limit in m/s of any point of the body in a motion, for the people near it; 0
    to stand, infinite without people."""
    limit = math.inf
    along_mps, rim_mps = abs(twist.v_mps), abs(twist.w_radps) * profile.circumscribed_radius_m
    turns, is_straight = rim_mps > along_mps, rim_mps < _STRAIGHT * along_mps

    def approaches(x: float) -> bool:
        """Whether the body may come nearer to x: when it turns, its corners do all round."""
        return turns or (x < 0 if twist.v_mps < 0 else x > 0)

    for x, y, vx, vy, radius in np.vstack([people.walking, people.standing]).tolist():
        gap_m = profile.gap_m(x, y) - radius
        limit = min(limit, rules.near_mps + max(0.0, gap_m - rules.near_m))
        if vx or vy:
            speed = max(math.hypot(vx, vy), config.min_walking_mps)
            limit = min(
                limit,
                _stopping_speed(gap_m - config.stopped_gap_m, speed, approaches(x), rules),
            )
    for x, y, speed, radius in people.reachable_discs.tolist():
        along = math.copysign(1.0, twist.v_mps) * x
        is_left_behind = is_straight and along < 0.0
        away_m = _to_leading_edge_m(along, y, profile) if is_left_behind else profile.gap_m(x, y)
        gap_m = away_m - radius - config.stopped_gap_m
        limit = min(limit, _stopping_speed(gap_m, speed, approaches(x), rules))
    return 0.0 if limit < config.min_speed_mps else limit


def _to_leading_edge_m(x: float, y: float, profile: RobotProfile) -> float:
    """Return the distance in metres from a point to the edge of the body that leads, where x is
    negative behind the robot: a robot that drives straight on drives into no one who has not
    walked past it."""
    beside = max(abs(y) - profile.width_m / 2, 0.0)
    return math.hypot(profile.length_m / 2 - x, beside)


def _stopping_speed(gap_m: float, walker_mps: float, ahead: bool, rules: PeopleConfig) -> float:
    """The speed v from which the robot stands before a walker has crossed the gap between them.

    The walker needs walker · (reaction + v / braking) of it; the robot itself drives v · reaction +
    v² / (2 braking) towards a walker ahead.
    """
    left = gap_m - walker_mps * rules.reaction_s
    if left <= 0:
        return 0.0
    linear = walker_mps / rules.braking_mps2 + (rules.reaction_s if ahead else 0.0)
    square = 1 / (2 * rules.braking_mps2) if ahead else 0.0
    # square · v² + linear · v = left
    return 2 * left / (linear + math.sqrt(linear**2 + 4 * square * left))


def _later_s(headway_s: float, sample_s: float) -> Floats:
    """Return the moments from 0 to a headway, in seconds, at which a person is looked at."""
    moments = max(math.ceil(headway_s / sample_s), 1)
    return np.asarray(headway_s * np.arange(moments + 1) / moments)
