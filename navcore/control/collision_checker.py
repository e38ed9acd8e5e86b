"""How much room the footprint keeps to what stands near, and to what was not seen yet, along any
motion."""

from __future__ import annotations

import copy
import math

import numpy as np
import numpy.typing as npt

from navcore.config.control import LocalPlannerConfig
from navcore.config.people import PeopleConfig
from navcore.control.footprint_distance import clearances
from navcore.control.manoeuvre import Manoeuvre, ManoeuvreProblem, manoeuvre_along, manoeuvre_to_see
from navcore.control.primitives.library import Primitives, all_arcs, likeliest
from navcore.control.social import NOBODY, PEOPLE_CONFIG, PeopleState
from navcore.costmap.local_costmap import outside
from navcore.geometry.transform import Pose2, Twist
from navcore.robot.profile import RobotProfile

Points = npt.NDArray[np.float64]


class CollisionChecker:
    """What stands near, and how much room the footprint keeps to it along a motion."""

    def __init__(
        self,
        *,
        obstacles: Points,
        unseen: Points,
        reach_m: float,
        profile: RobotProfile,
        rules: LocalPlannerConfig,
        people: PeopleState,
        people_config: PeopleConfig,
    ) -> None:
        self.profile, self.rules, self.people, self.people_config = (
            profile,
            rules,
            people,
            people_config,
        )
        self._obstacles, self._unseen, self._reach_m = obstacles, unseen, reach_m
        self.padding_m = self._padding_m()
        # A thing may fill an unseen cell to its rim; where the body is nearer to one already, it
        # must not come nearer yet.
        self.unseen_clearance_m = float(
            np.clip(self._unseen_room(np.zeros((1, 1, 3)))[0, 0] - 0.002, 0.0, reach_m)
        )

    def _padding_m(self) -> float:
        """The padding asked for, or what there is: the robot may leave a tight place but not make
        it tighter.

        Never nothing: between two sampled poses of an arc a corner of the body bulges out by some
        millimetres.
        """
        here = float(self.clear(np.zeros((1, 1, 3)))[0, 0])
        return float(np.clip(here - 0.002, 0.005, max(self.rules.padding_m, 0.005)))

    def clear(self, poses: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """(A, S) room left to the nearest obstacle on the way to each of (A, S, 3) poses, in
        metres, at most about `FAR_M`."""
        half_length, half_width = self.profile.length_m / 2, self.profile.width_m / 2
        return np.asarray(
            clearances(self._obstacles, poses, half_length, half_width) - self._reach_m
        )

    def is_observed(self, poses: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """(A, S) whether the body covers nothing unseen on the way to each of (A, S, 3) poses."""
        return np.asarray(self._unseen_room(poses) > self.unseen_clearance_m)

    def _unseen_room(self, poses: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return clearances(self._unseen, poses, self.profile.length_m / 2, self.profile.width_m / 2)

    def may_turn_to(self, headings: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """(A, S) whether the body can turn in place through all of (A, S) headings, row by row, up
        to each."""
        poses = np.zeros((*headings.shape, 3))
        poses[..., 2] = headings
        # Turning sweeps the corners past what stands beside the robot; half the padding is enough
        # where it barely moves.
        return np.asarray((self.clear(poses) > self.padding_m / 2) & self.is_observed(poses))

    def primitives(self, path: Points, now: Twist) -> Primitives:
        """What to choose from, to follow a path, (N, 2) in the base frame, at the velocity that the
        robot has."""
        if self.rules.primitives == "arcs":
            return all_arcs()
        room_m = self._reach_m + self.rules.padding_m / 2
        return likeliest(
            self._obstacles[outside(self._obstacles, self.profile, room_m)],
            self.falco_headings(),
            path,
            body_m=(self.profile.length_m / 2, self.profile.width_m / 2),
            room_m=room_m,
            speed=now.v_mps / self.profile.max_speed_mps,
        )

    def falco_headings(self) -> npt.NDArray[np.bool_]:
        """(36,) to which of `HEADINGS_RAD` the body can turn in place, the shorter way."""
        half = np.radians(np.arange(2.0, 181.0, 2.0))
        left, right = self.may_turn_to(np.stack([half, -half]))[:, 4::5]
        return np.concatenate([right[::-1], [True], left[:-1]])

    def manoeuvre(self, path: Points, pose: Pose2) -> Manoeuvre | None:
        """The cheapest one that leads on along the path, or to where one sees how it goes on; with
        as much room as ever."""
        tight = ManoeuvreProblem(
            obstacles=self._obstacles,
            reach_m=self._reach_m,
            unseen=self._unseen,
            unseen_clearance_m=self.unseen_clearance_m,
            profile=self.profile,
            room_m=self.padding_m + 0.01,
        )
        return manoeuvre_along(path, tight, pose) or manoeuvre_to_see(path, tight, pose)

    def reversed_motion(self) -> CollisionChecker:
        """The same place, seen from a robot that faces the other way."""
        about = copy.copy(self)
        about.people, about._obstacles, about._unseen = (
            self.people.reversed_motion(),
            -self._obstacles,
            -self._unseen,
        )
        return about

    def without_front_contacts(self) -> CollisionChecker:
        """The same place without what the body touches before its front, from which reversing only
        leads away.

        Such a thing has come up there by itself: somebody drew a zone, or the camera saw only now
        what it is.
        """
        away = copy.copy(self)
        touched = ~outside(self._obstacles, self.profile, self._reach_m + 0.007)
        away._obstacles = self._obstacles[
            ~(touched & (self._obstacles[:, 0] > self.profile.length_m / 2))
        ]
        away.padding_m = away._padding_m()
        return away

    def without_people(self) -> CollisionChecker:
        """The same place with nobody walking about."""
        alone = copy.copy(self)
        alone.people = NOBODY
        return alone

    def as_they_stand(self) -> CollisionChecker:
        """The same place, as if whoever walks about stood still where he is: an obstacle like any
        other."""
        still = copy.copy(self)
        still.people = self.people.as_they_stand()
        bodies = still.people.outlines()
        still._obstacles = np.vstack([self._obstacles, bodies[outside(bodies, self.profile, 0.0)]])
        still.padding_m = still._padding_m()
        return still

    def all_seen(self) -> CollisionChecker:
        """The same place, as if the camera had been everywhere."""
        seen = copy.copy(self)
        seen._unseen = self._unseen[:0]
        return seen


def candidates(
    *,
    geometric: Points,
    ruled: Points,
    profile: RobotProfile,
    rules: LocalPlannerConfig,
    cell_m: float,
    among: Primitives | None = None,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """What `plan_motion` chooses from, (A, S, 2) in the base frame, and (A,) how many poses of each
    are clear.

    These are the arcs, unless a motion was chosen `among` others. What stands near counts as there;
    people who walk and what is unseen do not, since they depend on speed and on the tick.
    """
    geometric = geometric[outside(geometric, profile, -cell_m / 2)]
    near = CollisionChecker(
        obstacles=np.vstack([geometric, ruled]),
        unseen=np.empty((0, 2)),
        reach_m=cell_m * math.sqrt(0.5),
        profile=profile,
        rules=rules,
        people=NOBODY,
        people_config=PEOPLE_CONFIG,
    )
    poses = (among or all_arcs()).poses
    clear = near.clear(poses) > near.padding_m
    return poses[..., :2], np.where(
        clear.all(axis=1), clear.shape[1], np.argmin(clear, axis=1)
    ).astype(np.int64)


def stopping_trajectory(twist: Twist, profile: RobotProfile) -> npt.NDArray[np.float64]:
    """(1, S, 3) where the robot comes, base frame, before a twist that is held until it expires has
    been braked."""
    braking_s = max(
        abs(twist.v_mps) / profile.max_accel_mps2, abs(twist.w_radps) / profile.max_yaw_accel_radps2
    )
    moments = np.linspace(0.0, HOLD_S + 0.5 * braking_s, 9)[1:]
    turned = twist.w_radps * moments
    chord = twist.v_mps * moments * np.sinc(turned / 2 / math.pi)
    return np.stack([chord * np.cos(turned / 2), chord * np.sin(turned / 2), turned], axis=1)[None]


HOLD_S = 0.25
"""A twist is driven so long unless another comes."""
