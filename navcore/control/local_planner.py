"""The local planner: from the path to a velocity, by motion primitives that are scored against
obstacles with the robot's oriented footprint.

The primitives are arcs that start at the robot; it also turns in place and backs off. A primitive
is driven only as far as the padded footprint stays clear of every occupied cell along it; zones and
beware points count like walls. Where no primitive leads on, a sequence of them may: then a
manoeuvre is searched for, and carried through.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from navcore.config.control import CONTROL_CONFIG, ControlConfig, LocalPlannerConfig
from navcore.config.people import PeopleConfig
from navcore.control.collision.collision_checker import CollisionChecker
from navcore.control.manoeuvre.manoeuvre import manoeuvre_to_see, visible_by_turning
from navcore.control.motion import ARRIVED, BLOCKED, DRIVES_ON, ControllerState, Motion
from navcore.control.motion_primitives import arcs
from navcore.control.motions.beside_people import (
    face_person,
    loses_sight,
    no_faster,
    slow_beside_people,
)
from navcore.control.motions.dynamic_window import avoid, will_collide
from navcore.control.motions.growth_exit import drive_out
from navcore.control.motions.manoeuvring import drive_manoeuvre, find_manoeuvre, manoeuvre_problem
from navcore.control.motions.path_follower import follow
from navcore.control.motions.reversing import back_off, retreat
from navcore.control.motions.turning import (
    can_turn_about,
    spin,
    turn_in_place,
    turn_with_room,
    turned_by,
)
from navcore.control.people.people_state import NO_PEOPLE, PEOPLE_CONFIG, PeopleState
from navcore.costmap.local_costmap import footprint_overlaps, outside
from navcore.geometry.arrays import Points
from navcore.geometry.polyline import metres_along, path_from
from navcore.geometry.transform import STANDSTILL, Pose2, Twist, wrap_angle
from navcore.mission.zone_growth import GrownZone
from navcore.robot.profile import RobotProfile

_STRUGGLES = (ControllerState.MANOEUVRE, ControllerState.BACK, ControllerState.BLOCKED)
"""States that are not worth the last centimetres to the goal."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalPlannerInput:
    """The input of one step of the local planner."""

    geometric: Points
    """(N, 2) centres of occupied cells near the robot, base frame."""
    people_cells: Points = dataclasses.field(default_factory=lambda: np.empty((0, 2)))
    """(P, 2) centres of the cells of people who stand, with their margins. Those that the body
    overlaps do not hold it: a person has come up to the robot, and walks on."""
    forbidden: Points
    """(M, 2) centres of cells that the operator's rules forbid, base frame."""
    unseen: Points
    """(U, 2) centres of unobserved cells next to observed ones, base frame. The planner of paths
    counts them as free, but no part of the body is swept over them."""
    cell_m: float
    """Side of a cell in metres."""
    path: Points
    """(K, 2) path in the map frame; its last point is the goal."""
    pose: Pose2
    """T_map_base."""
    twist: Twist = STANDSTILL
    """Measured velocity."""
    previous: Motion
    """Motion of the previous step."""
    profile: RobotProfile
    """Footprint and limits."""
    local: LocalPlannerConfig
    """Settings of the operator."""
    control: ControlConfig = CONTROL_CONFIG
    """Tuning of the control stage."""
    people: PeopleState = NO_PEOPLE
    """People near the robot, base frame."""
    people_config: PeopleConfig = PEOPLE_CONFIG
    """Rules beside people."""
    goal_yaw_rad: float | None = None
    """Heading in the map frame to take at the goal; None for any."""
    around: tuple[GrownZone, ...] = ()
    """Zones whose growth the robot is in, and drives out of first; they are not in `forbidden`."""
    retreat: Points | None = None
    """(R, 2) driven path in the map frame, newest first, to back off along; None otherwise."""
    spin: bool = False
    """Whether to turn on in place and look around."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Goal:
    """The goal as seen from the robot."""

    distance_m: float
    heading_error_rad: float
    reached: bool
    aligned: bool


def compute_velocity(inputs: LocalPlannerInput) -> Motion:
    """Compute the motion that follows the path best without touching anything, slower or standing
    where people are near."""
    path = path_from(inputs.path, inputs.pose)
    goal = _goal(inputs, path)
    if goal.reached and goal.aligned and not inputs.around:
        return ARRIVED
    if footprint_overlaps(inputs.forbidden, inputs.profile, inputs.cell_m):
        return Motion(twist=STANDSTILL, outcome=ControllerState.IN_ZONE)
    checker = _collision_checker(inputs)
    motion = _select(inputs, checker, path, goal)
    if inputs.people_config.non_cooperative:
        walked = len(inputs.people.walking) > 0
        collides = walked and will_collide(checker, motion.twist, inputs.twist)
        return avoid(checker, path, inputs.twist) if collides else motion
    if inputs.retreat is None:
        motion = slow_beside_people(checker, motion)
    waited = inputs.previous.outcome is ControllerState.WAIT_FOR_PEOPLE
    expected = inputs.people.expectations
    if (
        expected.expects_return
        and not expected.ignore_predictions
        and waited
        and motion.outcome in DRIVES_ON
    ):
        motion = Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
    if motion.outcome is ControllerState.WAIT_FOR_PEOPLE:
        return face_person(checker, motion)
    if expected.is_cautious or (expected.passes_close and len(inputs.people_cells)):
        return no_faster(motion, inputs.people_config.cautious_mps, checker.profile)
    return motion


def _goal(inputs: LocalPlannerInput, path: Points) -> _Goal:
    local, yaw_rad = inputs.local, inputs.goal_yaw_rad
    error = 0.0 if yaw_rad is None else wrap_angle(yaw_rad - inputs.pose.yaw_rad)
    # Skidding wheels carry a turning robot off the goal; it does not drive back for every
    # centimetre.
    aligning = inputs.previous.outcome is ControllerState.ALIGN
    tolerance_m = local.arrival_m * (inputs.control.turn.goal_drift_factor if aligning else 1.0)
    distance_m = float(np.hypot(*path[-1]))
    return _Goal(
        distance_m=distance_m,
        heading_error_rad=error,
        reached=distance_m <= tolerance_m,
        aligned=abs(error) <= math.radians(local.aligned_deg),
    )


def _collision_checker(inputs: LocalPlannerInput) -> CollisionChecker:
    """The surroundings; a geometric cell inside the body is noise, a forbidden one never is. Cells
    of people in it are of those who have come up to it."""
    profile, outlines = inputs.profile, inputs.people.outlines()
    geometric = inputs.geometric[outside(inputs.geometric, profile, -inputs.cell_m / 2)]
    outlines = outlines[outside(outlines, profile, 0.0)]
    people = inputs.people_cells[outside(inputs.people_cells, profile, inputs.cell_m / 2)]
    return CollisionChecker(
        obstacles=np.vstack([geometric, inputs.forbidden, outlines, people]),
        unseen=inputs.unseen[outside(inputs.unseen, profile, 0.0)],
        cell_radius_m=inputs.cell_m * math.sqrt(0.5),
        profile=profile,
        local=inputs.local,
        people=inputs.people,
        people_config=inputs.people_config,
        control=inputs.control,
    )


def _select(
    inputs: LocalPlannerInput, checker: CollisionChecker, path: Points, goal: _Goal
) -> Motion:
    """Retreat, spin, align with the goal or drive: what the inputs ask for."""
    alone = inputs.people_config.non_cooperative
    if inputs.retreat is not None:
        surroundings = checker.without_people() if alone else checker
        crossing = _cross(inputs, checker, path) if inputs.people.expectations.leaves_lane else None
        if crossing is not None:
            return crossing
        return retreat(surroundings, path_from(inputs.retreat, inputs.pose))
    if inputs.spin:
        return spin(checker) or BLOCKED
    if inputs.around:
        return drive_out(checker, inputs.around, inputs.pose, inputs.path[-1], inputs.previous)
    if goal.reached:
        motion = _align(inputs, checker, goal)
    else:
        motion = _drive(inputs, checker.without_people() if alone else checker, path)
    waits = motion.outcome is ControllerState.WAIT_FOR_PEOPLE
    if waits and inputs.people.expectations.ignore_predictions:
        motion = _drive_as_if_standing(inputs, checker, path) or motion
    near = goal.distance_m <= inputs.local.nearly_m and inputs.previous.began is None
    if near and motion.outcome in _STRUGGLES:
        motion = ARRIVED if goal.aligned else _align(inputs, checker, goal)
    return motion


def _drive_as_if_standing(
    inputs: LocalPlannerInput, checker: CollisionChecker, path: Points
) -> Motion | None:
    """Follow the path as if people stood where they are; None where even that leads on nowhere."""
    motion = _drive(inputs, checker.with_people_standing(), path)
    leads_on = motion.outcome in DRIVES_ON or motion.outcome is ControllerState.MANOEUVRE
    return motion if leads_on else None


def _cross(inputs: LocalPlannerInput, checker: CollisionChecker, path: Points) -> Motion | None:
    """Cross the lane of people who walk to and fro while all of them walk away in view: the moment
    when there is most time. No faster than the robot can stop before they could be back; None where
    that is not at all."""
    if not checker.people.walk_away:
        return None
    motion = _drive_as_if_standing(inputs, checker, path)
    slow = None if motion is None else slow_beside_people(checker, motion)
    return None if slow is None or slow.twist == STANDSTILL else slow


def _align(inputs: LocalPlannerInput, checker: CollisionChecker, goal: _Goal) -> Motion:
    """Turn in place to the heading asked for, if need be after a look from elsewhere at the
    unobserved cells that the turn would sweep; stand where the body cannot turn."""
    turn = turn_in_place(checker, goal.heading_error_rad)
    if turn is not None:
        return dataclasses.replace(turn, outcome=ControllerState.ALIGN)
    if turn_in_place(checker.all_observed(), goal.heading_error_rad) is None:
        return BLOCKED
    here, pose, previous = np.zeros((1, 2)), inputs.pose, inputs.previous
    found, began = previous.manoeuvre, previous.began or pose
    if found is None:
        found, began = manoeuvre_to_see(here, manoeuvre_problem(checker), pose), pose
    motion = None if found is None else drive_manoeuvre(checker, found, here, pose, began=began)
    return motion or BLOCKED


def _drive(inputs: LocalPlannerInput, checker: CollisionChecker, path: Points) -> Motion:
    """Continue what was begun, turn towards the path, follow it, wait, turn to see where it leads,
    manoeuvre or back off: the first that is possible."""
    pose, primitives = inputs.pose, arcs(inputs.control.arcs)
    bearing = _bearing(path, inputs.local.lookahead_m)
    motion = (
        _continue(inputs, checker, path)
        or _turn_to_path(inputs, checker, bearing)
        or _look(inputs, checker, path)
        or follow(checker, path, primitives)
    )
    if motion is not None:
        return motion
    if len(checker.people.walking) and follow(checker.without_people(), path, primitives):
        return Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
    off_path = abs(bearing) > math.radians(inputs.local.turn_until_deg)
    if off_path and follow(checker.all_observed(), path, primitives):
        # The path leads over unobserved cells.
        turn = turn_in_place(checker, bearing)
        if turn is not None:
            return turn
    found = find_manoeuvre(checker, path, pose)
    motion = None if found is None else drive_manoeuvre(checker, found, path, pose, began=pose)
    motion = motion or back_off(checker, pose)
    if motion is BLOCKED and follow(checker.all_observed(), path, primitives):
        return dataclasses.replace(motion, unseen=True)
    return motion


def _continue(inputs: LocalPlannerInput, checker: CollisionChecker, path: Points) -> Motion | None:
    """Carry on the manoeuvre or the backing off of the previous step; None if it is done."""
    previous, pose = inputs.previous, inputs.pose
    if previous.began is None:
        return None
    if previous.manoeuvre is not None:
        return drive_manoeuvre(checker, previous.manoeuvre, path, pose, began=previous.began)
    if previous.began.distance_to(pose.x_m, pose.y_m) >= inputs.local.back_off_m:
        return None
    motion = back_off(checker, previous.began)
    return motion if motion.outcome is ControllerState.BACK else None


def _turn_to_path(
    inputs: LocalPlannerInput, checker: CollisionChecker, bearing: float
) -> Motion | None:
    """Turn in place towards the path; None where it lies ahead or the body cannot turn."""
    turning = inputs.previous.outcome is ControllerState.TURN
    least_deg = inputs.local.turn_until_deg if turning else inputs.local.turn_from_deg
    if abs(bearing) <= math.radians(least_deg):
        return None
    turn = turn_in_place(checker, bearing)
    if turn is not None and loses_sight(checker, turned_by(turn, bearing)):
        return Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
    return turn


def _look(inputs: LocalPlannerInput, checker: CollisionChecker, path: Points) -> Motion | None:
    """Turn in place to see the unobserved floor where the path leads next, as long as there is room
    to turn: beside such floor the robot could only back off. None where the camera has it in view,
    or the turn would bring the body close to an obstacle, or in a door."""
    if not can_turn_about(checker):
        return None
    config = inputs.control.turn
    looking = inputs.previous.outcome is ControllerState.LOOK
    least_deg = config.look_until_deg if looking else config.look_from_deg
    cells = visible_by_turning(path, manoeuvre_problem(checker), beyond_rad=math.radians(least_deg))
    if len(cells) == 0:
        return None
    x, y = cells[np.hypot(*cells.T).argmin()]
    bearing = math.atan2(y, x)
    turn = turn_with_room(checker, bearing)
    return None if turn is None else dataclasses.replace(turn, outcome=ControllerState.LOOK)


def _bearing(path: Points, lookahead_m: float) -> float:
    """Bearing in rad of the path's point a lookahead distance along it, or of its end."""
    index = min(int(np.searchsorted(metres_along(path), lookahead_m)), len(path) - 1)
    lookahead_point = path[index]
    return math.atan2(lookahead_point[1], lookahead_point[0])
