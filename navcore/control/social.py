"""Keeping clear of people: where they may be along a motion, and how fast the robot may be beside
them.

Two rules, and either is enough by itself when the other errs. The first looks ahead: at the moment
the robot would be at a pose nobody may be near it, nobody may be about to come there, and that
whether he walks on as he does or turns back this moment; who has only stopped on his way may do
either, or step aside. So the robot passes behind somebody, and only once it would be past before he
is back; until then it waits off his line. The second looks at no prediction: the robot must be able
to stand still before anybody could reach it, wherever he turns. Out of sight the room that he may
be in grows at his pace, about where he was lost, until he has been gone for long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numba
import numpy as np
import numpy.typing as npt

from navcore.config.people import PeopleConfig
from navcore.geometry.transform import Pose2, Twist
from navcore.perception.people.track import BRISK, Track
from navcore.robot.profile import RobotProfile

Floats = npt.NDArray[np.float64]


PEOPLE_CONFIG = PeopleConfig()

SHORT_M = 0.05
"""Left between somebody who turns towards the robot and the robot that has stopped."""
SLOWEST_MPS = 0.5
"""Whoever walks may walk at least this fast the next moment."""
ASIDE_M = 0.2
"""Who waits leaves so much more room, for nobody walks quite straight."""
LEAST_MPS = 0.05
"""Slower than this the robot stands."""
MOMENT_S = 0.25
"""So close together are the moments of the headway that are looked at."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeopleState:
    """People in the base frame, as they are now."""

    walking: Floats
    """(P, 5) x, y, velocity along both, radius; each as often as there are ways for him to go.
    Whoever walks goes on, or turns back this moment; who has only stopped on his way does either,
    or sets out somewhere while the robot passes."""
    standing: Floats
    """(Q, 5) the same; the velocities are 0."""
    reachable_discs: Floats = field(default_factory=lambda: np.empty((0, 4)))
    """(R, 4) x, y, pace, radius of where each of those who walk, or have only stopped, may be by
    now: where he is seen, or about where he was lost from sight, however far he can have come since
    then."""

    @staticmethod
    def of(
        people: tuple[Track, ...], pose: Pose2, rules: PeopleConfig = PEOPLE_CONFIG
    ) -> PeopleState:
        """As seen from a pose of the robot in the map frame."""
        moving = [person for person in people if _is_restless(person, rules)]
        standing = [person for person in people if person not in moving]
        ways = [
            way
            for person in moving
            for way in (_ways(person, rules)[:1] if rules.non_cooperative else _ways(person, rules))
        ]
        return PeopleState(
            walking=_seen_from(pose, ways, columns=5),
            standing=_seen_from(
                pose, [(p.x_m, p.y_m, 0.0, 0.0, p.radius_m) for p in standing], columns=5
            ),
            reachable_discs=_seen_from(pose, [_reach(person) for person in moving], columns=4),
        )

    def reversed_motion(self) -> PeopleState:
        """The same people, seen from a robot that faces the other way."""
        sign = np.array([-1.0, -1.0, -1.0, -1.0, 1.0])
        reachable_discs = self.reachable_discs * np.array([-1.0, -1.0, 1.0, 1.0])
        return PeopleState(
            walking=self.walking * sign,
            standing=self.standing * sign,
            reachable_discs=reachable_discs,
        )

    def as_they_stand(self) -> PeopleState:
        """The same people, as if whoever walks stood still where he may be by now."""
        stopped = np.zeros((len(self.reachable_discs), 5))
        stopped[:, :2], stopped[:, 4] = self.reachable_discs[:, :2], self.reachable_discs[:, 3]
        return PeopleState(
            walking=self.walking[:0],
            standing=np.vstack([self.standing, stopped]),
            reachable_discs=self.reachable_discs,
        )

    def outlines(self) -> Floats:
        """(N, 2) points around everybody who stands: obstacles like any other."""
        angles = np.linspace(0.0, 2 * math.pi, 20, endpoint=False)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        return np.vstack(
            [np.empty((0, 2)), *(body[:2] + body[4] * circle for body in self.standing)]
        )


def _is_restless(person: Track, rules: PeopleConfig) -> bool:
    """Whether he walks, or has walked and may set out again; out of sight nobody is seen to stand."""
    since_s = person.unseen_s + (0.0 if _walks(person) else person.stood_s)
    return person.speed_mps + person.pace_mps > 0 and since_s < rules.settled_s


def _walks(person: Track) -> bool:
    """Whether he walks on briskly; slower he is about to stop or to turn."""
    return person.speed_mps > BRISK * person.pace_mps


def _pace_mps(person: Track) -> float:
    return max(person.speed_mps, person.pace_mps, SLOWEST_MPS)


def _ways(person: Track, rules: PeopleConfig) -> list[tuple[float, ...]]:
    """x, y, velocity along both and radius, map frame, for each way that he may go from now on."""
    pace, course = (
        _pace_mps(person),
        person.course_rad if person.pace_mps else math.atan2(person.vy_mps, person.vx_mps),
    )
    vx, vy = pace * math.cos(course), pace * math.sin(course)
    back = (person.x_m, person.y_m, -vx, -vy, person.radius_m)
    if _walks(person):
        return [(person.x_m, person.y_m, person.vx_mps, person.vy_mps, person.radius_m), back]
    aside = (person.x_m, person.y_m, 0.0, 0.0, person.radius_m + pace * rules.passing_s)
    return [(person.x_m, person.y_m, vx, vy, person.radius_m), back, aside]


def _reach(person: Track) -> tuple[float, ...]:
    """x, y, map frame, pace and radius of where he may be: where he is seen, or about where he was
    lost, since then."""
    pace, (x, y) = _pace_mps(person), person.at(-person.unseen_s)
    return x, y, pace, person.radius_m + pace * person.unseen_s


def _seen_from(pose: Pose2, rows: list[tuple[float, ...]], columns: int) -> Floats:
    """(N, columns) the rows in the base frame: x, y and, if there are five columns, the velocity
    along both are turned."""
    array = np.array(rows).reshape(-1, columns)
    array[:, :2] = pose.from_parent(array[:, :2])
    if columns == 5:
        array[:, 2:4] = Pose2(x_m=0.0, y_m=0.0, yaw_rad=pose.yaw_rad).from_parent(array[:, 2:4])
    return array


NOBODY = PeopleState(walking=np.empty((0, 5)), standing=np.empty((0, 5)))


def clear_of_people(
    bodies: PeopleState, poses: Floats, times_s: Floats, profile: RobotProfile, rules: PeopleConfig
) -> npt.NDArray[np.bool_]:
    """(A, S) whether the way to each of (A, S, 3) poses, reached at (A, S) times, keeps clear of
    everybody who walks."""
    room = _room(
        bodies.walking, poses, times_s, profile.length_m / 2, profile.width_m / 2, rules.headway_s
    )
    return np.asarray(
        np.logical_and.accumulate(room > rules.personal_m + rules.personal_per_s * times_s, axis=1)
    )


def waiting_index(
    bodies: PeopleState, poses: Floats, times_s: Floats, profile: RobotProfile, rules: PeopleConfig
) -> int:
    """Index of the last of (S, 3) poses, reached at (S,) times, where the robot can wait in
    nobody's way; −1 if none.

    Where it is in somebody's way already, one where it is no more so will do: else it would stay
    there for ever.
    """
    half_length, half_width = profile.length_m / 2, profile.width_m / 2
    with_here = np.vstack([np.zeros((1, 3)), poses])[None], np.concatenate([[0.0], times_s])[None]
    here, *room = _room(bodies.walking, *with_here, half_length, half_width, rules.waiting_s)[
        0
    ].tolist()
    enough = rules.personal_m + ASIDE_M
    waiting = np.flatnonzero(np.array(room) > enough).max(initial=-1)
    return int(
        waiting
        if waiting >= 0 or here > enough
        else np.flatnonzero(np.array(room) >= here).max(initial=-1)
    )


def speed_limit_near_people(
    bodies: PeopleState, twist: Twist, profile: RobotProfile, rules: PeopleConfig
) -> float:
    """How fast any point of the body may be in such a motion, for the people near; 0 to stand,
    infinite with nobody near."""
    most, turns = math.inf, abs(twist.w_radps) * profile.circumscribed_radius_m > abs(twist.v_mps)

    def will_collide(x: float) -> bool:
        """Whether the body may itself come nearer to him: when it turns, its corners do all round."""
        return turns or (x < 0 if twist.v_mps < 0 else x > 0)

    for x, y, vx, vy, radius in np.vstack([bodies.walking, bodies.standing]).tolist():
        gap_m = _gap(x, y, profile) - radius
        most = min(most, rules.near_mps + max(0.0, gap_m - rules.near_m))
        if vx or vy:
            most = min(
                most,
                _stoppable(
                    gap_m - SHORT_M, max(math.hypot(vx, vy), SLOWEST_MPS), will_collide(x), rules
                ),
            )
    for x, y, pace_mps, radius in bodies.reachable_discs.tolist():
        most = min(
            most,
            _stoppable(_gap(x, y, profile) - radius - SHORT_M, pace_mps, will_collide(x), rules),
        )
    return 0.0 if most < LEAST_MPS else most


def _stoppable(room_m: float, walker_mps: float, ahead: bool, rules: PeopleConfig) -> float:
    """The speed v from which the robot stands before a walker has crossed the room between them.

    He needs walker · (reaction + v / braking); the robot itself goes v · reaction + v² / (2
    braking) if he is ahead of it.
    """
    left = room_m - walker_mps * rules.reaction_s
    if left <= 0:
        return 0.0
    linear = walker_mps / rules.braking_mps2 + (rules.reaction_s if ahead else 0.0)
    square = 1 / (2 * rules.braking_mps2) if ahead else 0.0
    # square · v² + linear · v = left
    return 2 * left / (linear + math.sqrt(linear**2 + 4 * square * left))


def _gap(x: float, y: float, profile: RobotProfile) -> float:
    return math.hypot(
        max(abs(x) - profile.length_m / 2, 0.0), max(abs(y) - profile.width_m / 2, 0.0)
    )


@numba.njit(cache=True, nogil=True)
def _room(
    walking: Floats,
    poses: Floats,
    times_s: Floats,
    half_length: float,
    half_width: float,
    headway_s: float,
) -> Floats:
    """(A, S) least distance of the footprint at each pose to where anybody is then, or comes within
    the headway."""
    arcs, steps = times_s.shape
    room, moments = np.full((arcs, steps), np.inf), max(math.ceil(headway_s / MOMENT_S), 1)
    for a in range(arcs):
        for s in range(steps):
            cos, sin = math.cos(poses[a, s, 2]), math.sin(poses[a, s, 2])
            for p in range(len(walking)):
                for moment in range(moments + 1):
                    t = times_s[a, s] + headway_s * moment / moments
                    dx = walking[p, 0] + t * walking[p, 2] - poses[a, s, 0]
                    dy = walking[p, 1] + t * walking[p, 3] - poses[a, s, 1]
                    out_x = max(abs(cos * dx + sin * dy) - half_length, 0.0)
                    out_y = max(abs(cos * dy - sin * dx) - half_width, 0.0)
                    room[a, s] = min(room[a, s], math.hypot(out_x, out_y) - walking[p, 4])
    return room
