"""The people near the robot as seen from it: where each of them may walk, and may be by now."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from navcore.config.control import CONTROL_CONFIG, SocialConfig
from navcore.config.people import PeopleConfig
from navcore.geometry.arrays import Floats, Points
from navcore.geometry.transform import Pose2
from navcore.perception.people.track import Track

PEOPLE_CONFIG = PeopleConfig()
"""The default rules."""
SOCIAL_CONFIG = CONTROL_CONFIG.social
"""The default tolerances."""
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
    passes_close: bool = False
    """Whether the robot, which has waited in vain, slowly passes those who stand beside it within
    their margin."""
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
