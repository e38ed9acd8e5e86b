"""People: where they may be along a motion, and how fast the robot may be beside them.

Two rules, and either is enough when the other errs. The first predicts: at the moment the robot
would be at a pose, no person may be near it or about to reach it, whether the person walks on or
turns back now; a person who has only stopped may do either, or step aside. So the robot passes
behind a person, and only when it will have passed before the person is back; until then it waits
beside the line of the person. The second predicts nothing: the robot must be able to stop before
any person could reach it, in whatever direction they turn. While a person is out of sight, the disc
that the person may be in grows at walking speed about the position where they were lost, until they
have been gone for long. A robot that stood all that time would set off blindly at its end, so it
looks after them: a turn in place, for which they are taken to have walked on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from navcore.config.control import CONTROL_CONFIG, SocialConfig
from navcore.config.people import PeopleConfig
from navcore.control.people.walker_distance import are_clear, gaps
from navcore.geometry.arrays import Bools, Floats, Points
from navcore.geometry.transform import Pose2, Twist
from navcore.perception.people.track import Track
from navcore.robot.profile import RobotProfile

PEOPLE_CONFIG = PeopleConfig()
"""The default rules."""
SOCIAL_CONFIG = CONTROL_CONFIG.social
"""The default tolerances."""
_ROUNDING_M = 1e-6
"""Distance in metres far above the rounding error of a gap."""
_ANGLES = np.linspace(0.0, 2 * math.pi, 20, endpoint=False)
_OUTLINE = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
"""(20, 2) points on the outline of a person with a radius of 1 m."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeopleExpectations:
    """What the behaviours know of the people near the robot, and of the robot's wait for them."""

    walked: Points = field(default_factory=lambda: np.empty((0, 2)))
    """(W, 2) recent positions of people who walked, map frame."""
    away: frozenset[int] = frozenset()
    """Numbers of the tracks of people who stay away for a while."""
    away_s: float = 0.0
    """Time in seconds after they were lost from sight for which they do."""
    expects_return: bool = False
    """Whether a robot that waits for people goes on waiting, since they are about to be back."""
    leaves_lane: bool = False
    """Whether the robot backs off from the lane of a person, and may cross that lane instead."""
    is_cautious: bool = False
    """Whether the robot has just waited while a person was out of sight."""
    ignore_predictions: bool = False
    """Whether the robot, having waited long enough, waits only where people are and not where they
    may come to."""


NOTHING_EXPECTED = PeopleExpectations()
"""People of whom nothing is known but their tracks."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeopleState:
    """People in the base frame, as they are now."""

    walking: Floats
    """(P, 5) x, y, velocity along both, radius, in metres and m/s: a row for each motion that a
    person who walks, or has only stopped, may make from now on."""
    standing: Floats
    """(Q, 5) the same columns for people who stand; the velocities are 0."""
    reachable_discs: Floats = field(default_factory=lambda: np.empty((0, 4)))
    """(R, 4) x, y, walking speed, radius of the disc in which each of those who walk, or have only
    stopped, may be by now: about where the person is seen, or was lost from sight."""

    expected_discs: Floats = field(default_factory=lambda: np.empty((0, 4)))
    """(R, 4) the same columns for the disc in which each of these people is if they walked on."""
    walked: Points = field(default_factory=lambda: np.empty((0, 2)))
    """(W, 2) recent positions of people who walked."""
    walk_away: bool = False
    """Whether there are people who walk, and all of them are in view and walk away from the
    robot."""
    expectations: PeopleExpectations = NOTHING_EXPECTED
    """What the behaviours know of them."""

    @staticmethod
    def of(
        people: tuple[Track, ...],
        pose: Pose2,
        rules: PeopleConfig = PEOPLE_CONFIG,
        config: SocialConfig = SOCIAL_CONFIG,
        expectations: PeopleExpectations = NOTHING_EXPECTED,
    ) -> PeopleState:
        """Return the tracked people, and where people recently walked, as seen from a pose of the
        robot in the map frame. Those who stay away walk on for half of that time, and then back."""
        away, away_s = expectations.away, expectations.away_s
        moving = [person for person in people if may_walk(person, rules)]
        standing = [person for person in people if person not in moving]
        motions = [
            motion
            for person in moving
            if not (person.id in away and config.in_view_s < person.unseen_s < away_s)
            for motion in _motions(person, rules, config)[: 1 if rules.non_cooperative else None]
        ]
        return PeopleState(
            walking=_in_base(pose, motions, columns=5),
            standing=_in_base(
                pose, [(p.x_m, p.y_m, 0.0, 0.0, p.radius_m) for p in standing], columns=5
            ),
            reachable_discs=_in_base(
                pose,
                [
                    _reachable_disc(person, config, away_s if person.id in away else 0.0)
                    for person in moving
                ],
                columns=4,
            ),
            expected_discs=_in_base(
                pose,
                [(p.x_m, p.y_m, _walking_speed(p, config), p.radius_m) for p in moving],
                columns=4,
            ),
            walked=pose.from_parent(expectations.walked),
            walk_away=bool(moving) and all(_walks_away(person, pose, config) for person in moving),
            expectations=expectations,
        )

    def reversed(self) -> PeopleState:
        """Return the same people as seen from a robot that faces the other way."""
        sign = np.array([-1.0, -1.0, -1.0, -1.0, 1.0])
        return replace(
            self,
            walking=self.walking * sign,
            standing=self.standing * sign,
            reachable_discs=self.reachable_discs * np.array([-1.0, -1.0, 1.0, 1.0]),
            expected_discs=self.expected_discs * np.array([-1.0, -1.0, 1.0, 1.0]),
            walked=-self.walked,
        )

    def standing_still(self) -> PeopleState:
        """Return the same people as if each who walks stood still in the disc they may be in by
        now."""
        stopped = np.zeros((len(self.reachable_discs), 5))
        stopped[:, :2], stopped[:, 4] = self.reachable_discs[:, :2], self.reachable_discs[:, 3]
        standing = np.vstack([self.standing, stopped])
        return replace(self, walking=self.walking[:0], standing=standing)

    def as_expected(self, around_m: float) -> PeopleState:
        """Return the same people as if those out of sight had walked on, but for those whose way
        led within `around_m` metres of the robot's middle: they may have stopped before it.

        Where people have walked as near recently, all of them may: they walk to and fro.
        """
        body_m = self.expected_discs[:, 3].max(initial=0.0)
        if (np.hypot(*self.walked.T) - body_m <= around_m).any():
            return self
        lost, expected = self.reachable_discs[:, :2], self.expected_discs[:, :2]
        way = expected - lost
        squared = np.maximum((way**2).sum(axis=1), 1e-9)
        share = np.clip(-(lost * way).sum(axis=1) / squared, 0.0, 1.0)
        nearest_m = np.hypot(*(lost + share[:, None] * way).T) - self.expected_discs[:, 3]
        walked_on = (nearest_m > around_m)[:, None]
        return replace(
            self, reachable_discs=np.where(walked_on, self.expected_discs, self.reachable_discs)
        )

    def outlines(self) -> Points:
        """(N, 2) points around the people who stand: obstacles like any other."""
        circles = (person[:2] + person[4] * _OUTLINE for person in self.standing)
        return np.vstack([np.empty((0, 2)), *circles])


NO_PEOPLE = PeopleState(walking=np.empty((0, 5)), standing=np.empty((0, 5)))


def may_walk(person: Track, rules: PeopleConfig) -> bool:
    """Whether a person walks, or has walked and may set out again; out of sight they may always."""
    since_s = person.unseen_s + (0.0 if person.is_brisk() else person.stood_s)
    return person.speed_mps + person.walking_speed_mps > 0 and since_s < rules.settled_s


def _walks_away(person: Track, pose: Pose2, config: SocialConfig) -> bool:
    """Whether a person is seen to walk away from a robot at a pose in the map frame."""
    x, y = person.x_m - pose.x_m, person.y_m - pose.y_m
    along = x * person.vx_mps + y * person.vy_mps
    is_away = along > config.away_cosine * math.hypot(x, y) * person.speed_mps
    return is_away and person.is_brisk() and person.unseen_s < config.in_view_s


def _walking_speed(person: Track, config: SocialConfig) -> float:
    return max(person.speed_mps, person.walking_speed_mps, config.min_walking_mps)


def _motions(person: Track, rules: PeopleConfig, config: SocialConfig) -> list[tuple[float, ...]]:
    """x, y, velocity along both and radius, map frame, for each motion that a person may make."""
    x, y, radius = person.x_m, person.y_m, person.radius_m
    speed = _walking_speed(person, config)
    course = (
        person.course_rad if person.walking_speed_mps else math.atan2(person.vy_mps, person.vx_mps)
    )
    vx, vy = speed * math.cos(course), speed * math.sin(course)
    back = (x, y, -vx, -vy, radius)
    if person.is_brisk():
        return [(x, y, person.vx_mps, person.vy_mps, radius), back]
    return [(x, y, vx, vy, radius), back, (x, y, 0.0, 0.0, radius + speed * rules.passing_s)]


def _reachable_disc(person: Track, config: SocialConfig, away_s: float) -> tuple[float, ...]:
    """x, y, map frame, walking speed and radius of the disc in which a person may be by now, who
    stays away for a while."""
    late_s = max(person.unseen_s - away_s, 0.0)
    on_s = min(person.unseen_s, max(away_s - person.unseen_s, 0.0))
    speed, (x, y) = _walking_speed(person, config), person.at(on_s - person.unseen_s)
    return x, y, speed, person.radius_m + speed * late_s


def _in_base(pose: Pose2, rows: list[tuple[float, ...]], *, columns: int) -> Floats:
    """(N, columns) the rows in the base frame: x, y and, of five columns, the velocity too."""
    array = np.array(rows).reshape(-1, columns)
    array[:, :2] = pose.from_parent(array[:, :2])
    if columns == 5:
        array[:, 2:4] = Pose2(x_m=0.0, y_m=0.0, yaw_rad=pose.yaw_rad).from_parent(array[:, 2:4])
    return array


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
    turns = abs(twist.w_radps) * profile.circumscribed_radius_m > abs(twist.v_mps)

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
        gap_m = profile.gap_m(x, y) - radius - config.stopped_gap_m
        limit = min(limit, _stopping_speed(gap_m, speed, approaches(x), rules))
    return 0.0 if limit < config.min_speed_mps else limit


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
