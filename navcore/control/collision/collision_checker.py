"""Collision check: the clearance of the oriented footprint to obstacles and to unobserved cells
along any motion."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from navcore.config.control import CONTROL_CONFIG, ControlConfig, LocalPlannerConfig
from navcore.config.people import PeopleConfig
from navcore.config.safety import GateConfig
from navcore.control.collision.footprint_distance import FAR_M, contact_slack, footprint_distances
from navcore.control.people.people_state import NO_PEOPLE, PEOPLE_CONFIG, PeopleState
from navcore.costmap.local_costmap import outside
from navcore.geometry.arrays import Bools, Floats, Points
from navcore.geometry.kinematics import chord_lengths
from navcore.geometry.transform import Twist
from navcore.robot.profile import RobotProfile

COMMAND_LIFE_S = GateConfig().command_life_s
"""Time in seconds that a twist is driven unless another one arrives."""
_BESIDE_M = 1e-4
"""Clearance in metres beyond the padding that contacts leave at poses at which they are kept."""
_ROUNDING_M = 1e-6
"""Error in metres of the distances of contacts."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CollisionChecker:
    """Everything near the robot that its footprint may not touch; base frame."""

    obstacles: Points
    """(N, 2) centres of occupied cells, and points on the outlines of people who stand."""
    unseen: Points
    """(U, 2) centres of the unobserved cells next to observed ones."""
    cell_radius_m: float
    """Distance in metres from the centre of a cell to its corners."""
    profile: RobotProfile
    """Footprint and limits."""
    local: LocalPlannerConfig
    """Padding, braking and turning."""
    people: PeopleState = NO_PEOPLE
    """People near the robot."""
    people_config: PeopleConfig = PEOPLE_CONFIG
    """Rules beside people."""
    control: ControlConfig = CONTROL_CONFIG
    """Tuning of the control stage."""
    padding_m: float = field(init=False)
    """Clearance in metres to keep: the one asked for, or the present one if that is smaller, since
    a robot that is closer to an obstacle may leave it but not come nearer."""
    contacts: Points = field(init=False)
    """(C, 2) obstacles nearer than any padding: a person has come up to the robot, an operator drew
    a zone beside it, or it was switched on with its back to a wall. Each may come no nearer than it
    is, so that the robot can drive away."""
    kept_m: Floats = field(init=False)
    """(C,) distance in metres from the footprint to keep from the middle of each of them, negative
    under it."""
    others: Points = field(init=False)
    """(M, 2) obstacles that are no contacts."""
    unseen_clearance_m: float = field(init=False)
    """Clearance in metres to keep to the centres of unobserved cells, which may be obstacles up to
    their edge; less where the body is nearer to one already."""

    def __post_init__(self) -> None:
        config, here = self.control.collision, np.zeros((1, 1, 3))
        object.__setattr__(self, "contacts", self.obstacles[:0])
        object.__setattr__(self, "kept_m", np.zeros(0))
        object.__setattr__(self, "others", self.obstacles)
        clearance_m = float(self.clearance(here)[0, 0]) - config.tolerance_m
        if clearance_m < config.least_padding_m:
            clearance_m = self._split_contacts() - config.tolerance_m
        padding_m = np.clip(
            clearance_m,
            config.least_padding_m,
            max(self.local.padding_m, config.least_padding_m),
        )
        unseen_m = np.clip(
            self._unseen_clearance(here)[0, 0] - config.tolerance_m, 0.0, self.cell_radius_m
        )
        object.__setattr__(self, "padding_m", float(padding_m))
        object.__setattr__(self, "unseen_clearance_m", float(unseen_m))

    @property
    def farthest_m(self) -> float:
        """Largest clearance in metres that is measured."""
        return FAR_M - self.cell_radius_m

    def clearance(self, poses: Floats) -> Floats:
        """(A, S) clearance in metres to the nearest obstacle on the motion up to each of (A, S, 3)
        poses, at most `farthest_m`."""
        body = self.profile.length_m / 2, self.profile.width_m / 2
        clearance = footprint_distances(self.others, poses, *body) - self.cell_radius_m
        if not len(self.contacts):
            return np.asarray(clearance)
        slack, distances = contact_slack(self.contacts, self.kept_m, poses, *body)
        least_m = np.maximum(distances - self.cell_radius_m, self.padding_m + _BESIDE_M)
        return np.where(slack < 0.0, slack, np.minimum(clearance, least_m))

    def _split_contacts(self) -> float:
        """Note the contacts, and return the clearance in metres from all other obstacles."""
        config, now_m = self.control.collision, self.profile.distances_m(self.obstacles)
        touch = now_m < self.cell_radius_m + config.least_padding_m + config.tolerance_m
        # A corner swings out when the robot turns away from a wall, by what the cells leave of it.
        kept_m = np.minimum(now_m[touch], self.cell_radius_m)
        object.__setattr__(self, "others", self.obstacles[~touch])
        clearance_m = float(self.clearance(np.zeros((1, 1, 3)))[0, 0])
        object.__setattr__(self, "contacts", self.obstacles[touch])
        object.__setattr__(self, "kept_m", kept_m - _ROUNDING_M)
        return clearance_m

    def is_observed(self, poses: Floats) -> Bools:
        """(A, S) whether the body covers nothing unobserved on the motion up to each of (A, S, 3)
        poses."""
        return np.asarray(self._unseen_clearance(poses) > self.unseen_clearance_m)

    def _unseen_clearance(self, poses: Floats) -> Floats:
        half_length_m, half_width_m = self.profile.length_m / 2, self.profile.width_m / 2
        return footprint_distances(self.unseen, poses, half_length_m, half_width_m)

    def can_turn_to(self, headings: Floats) -> Bools:
        """(A, S) whether the body can turn in place through all of (A, S) headings in rad, row by
        row, up to each."""
        poses = np.zeros((*headings.shape, 3))
        poses[..., 2] = headings
        padding_m = self.padding_m * self.control.collision.turn_padding_share
        return np.asarray((self.clearance(poses) > padding_m) & self.is_observed(poses))

    def is_free(self, poses: Floats, padding_m: float) -> bool:
        """Whether at all of (A, S, 3) poses the body keeps the padding and covers nothing
        unobserved."""
        return bool((self.clearance(poses) > padding_m).all() and self.is_observed(poses).all())

    def reversed(self) -> CollisionChecker:
        """Return the surroundings as seen from a robot that faces the other way."""
        return dataclasses.replace(
            self,
            people=self.people.reversed(),
            obstacles=-self.obstacles,
            unseen=-self.unseen,
        )

    def without_front_contacts(self) -> CollisionChecker:
        """Return the surroundings without the obstacles that touch the front, from which reversing
        only leads away.

        Such an obstacle has come up without a motion of the robot: an operator drew a zone, or the
        camera recognised only now what it sees.
        """
        reach_m = self.cell_radius_m + self.control.collision.front_contact_m
        touched = ~outside(self.obstacles, self.profile, reach_m)
        in_front = self.obstacles[:, 0] > self.profile.length_m / 2
        return dataclasses.replace(self, obstacles=self.obstacles[~(touched & in_front)])

    def without_people(self) -> CollisionChecker:
        """Return the surroundings without the people who walk."""
        return dataclasses.replace(self, people=NO_PEOPLE)

    def with_people_standing(self) -> CollisionChecker:
        """Return the surroundings as if everyone stood still, obstacles like any other."""
        people = self.people.standing_still()
        outlines = people.outlines()
        outlines = outlines[outside(outlines, self.profile, 0.0)]
        return dataclasses.replace(
            self, people=people, obstacles=np.vstack([self.obstacles, outlines])
        )

    def all_observed(self) -> CollisionChecker:
        """Return the surroundings as if the camera had seen all of them."""
        return dataclasses.replace(self, unseen=self.unseen[:0])


def stopping_trajectory(twist: Twist, profile: RobotProfile) -> Floats:
    """Return (1, S, 3) poses, base frame, of a robot that holds a twist until it expires and then
    brakes."""
    braking_s = max(
        abs(twist.v_mps) / profile.max_accel_mps2, abs(twist.w_radps) / profile.max_yaw_accel_radps2
    )
    moments = np.linspace(0.0, COMMAND_LIFE_S + 0.5 * braking_s, 9)[1:]
    turned = twist.w_radps * moments
    chord = chord_lengths(twist.v_mps * moments, turned)
    return np.stack([chord * np.cos(turned / 2), chord * np.sin(turned / 2), turned], axis=1)[None]
