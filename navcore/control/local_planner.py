"""From the path to a velocity: motion primitives, scored against what stands near, with the robot's
oriented footprint.

The primitives, arcs or Falco's paths, start at the robot; backward there are arcs alone, and it
turns in place. A primitive is driven only as far as the padded footprint stays clear of every
occupied cell along it; zones and beware points count like walls. Where no primitive leads on, one
after the other may: then a manoeuvre is searched for, and carried through.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navcore.config.control import LocalPlannerConfig
from navcore.config.people import PeopleConfig
from navcore.control.collision_checker import CollisionChecker, stopping_trajectory
from navcore.control.dynamic_window import avoid, will_collide
from navcore.control.manoeuvre import Manoeuvre, steer
from navcore.control.motion import ARRIVED, BOXED_IN, ControllerState, Motion
from navcore.control.path_follower import follow
from navcore.control.primitives.arcs import arcs
from navcore.control.primitives.library import all_arcs
from navcore.control.social import (
    NOBODY,
    PEOPLE_CONFIG,
    PeopleState,
    clear_of_people,
    speed_limit_near_people,
)
from navcore.costmap.local_costmap import footprint_overlaps, outside
from navcore.geometry.arrays import Points
from navcore.geometry.polyline import metres_along, path_from
from navcore.geometry.transform import STANDSTILL, Pose2, Twist, wrap_angle
from navcore.robot.profile import RobotProfile


def plan_motion(
    *,
    geometric: Points,
    ruled: Points,
    unseen: Points,
    path_map: Points,
    pose: Pose2,
    previous: Motion,
    profile: RobotProfile,
    rules: LocalPlannerConfig,
    cell_m: float,
    people: PeopleState = NOBODY,
    people_config: PeopleConfig = PEOPLE_CONFIG,
    goal_yaw_rad: float | None = None,
    retreat_map: Points | None = None,
    look_round: bool = False,
    ignore_predictions: bool = False,
    now: Twist = STANDSTILL,
) -> Motion:
    """The motion that follows the path best without touching anything, and slower or not at all
    where people are near.

    `geometric` and `ruled` are (N, 2) obstacle cells near the robot in the base frame, `unseen` the
    rim of what the camera has not seen yet: the planner of paths counts it as free, but no part of
    the body is swept over it before it was looked at. `path_map` is the (N, 2) path in the map
    frame, its last point the goal. `cell_m` is the side of a cell: an obstacle reaches as far as
    its cell's corners. `people` are kept clear of by the rules of `people_config`. At the goal the
    robot turns in place to `goal_yaw_rad`, map frame, where one is asked for. With `retreat_map`,
    the (N, 2) driven path in the map frame, newest first, the robot backs off along it instead;
    with `look_round` it turns on in place. A robot that `ignore_predictions` waits only where
    people are, not where they may come to (`patience.py`). `now` is the velocity that it has.
    """
    path = path_from(path_map, pose)
    askew = 0.0 if goal_yaw_rad is None else wrap_angle(goal_yaw_rad - pose.yaw_rad)
    # Wheels that skid carry a turning robot off the spot; it does not drive back for every
    # centimetre.
    goal_m, aligned = float(np.hypot(*path[-1])), abs(askew) <= math.radians(rules.aligned_deg)
    at_goal = goal_m <= rules.arrival_m * (
        DRIFT if previous.outcome is ControllerState.ALIGN else 1.0
    )
    if at_goal and aligned:
        return ARRIVED
    if footprint_overlaps(ruled, profile, cell_m):
        return Motion(twist=STANDSTILL, outcome=ControllerState.IN_ZONE)
    # The robot is where it is: a geometric cell inside its body is noise. A rule of the operator is
    # never noise.
    geometric = geometric[outside(geometric, profile, -cell_m / 2)]
    near = CollisionChecker(
        obstacles=np.vstack(
            [geometric, ruled, people.outlines()[outside(people.outlines(), profile, 0.0)]]
        ),
        unseen=unseen[outside(unseen, profile, 0.0)],
        reach_m=cell_m * math.sqrt(0.5),
        profile=profile,
        rules=rules,
        people=people,
        people_config=people_config,
    )
    if retreat_map is not None:
        motion = _retreat(near, path_from(retreat_map, pose)) or BOXED_IN
    elif look_round:
        motion = _look_round(near) or BOXED_IN
    else:
        among = near.without_people() if people_config.non_cooperative else near
        motion = _aligned(near, askew) if at_goal else _chosen(among, path, pose, previous, now)
        if goal_m <= rules.nearly_m and motion.outcome in AWKWARD and previous.began is None:
            motion = ARRIVED if aligned else _aligned(near, askew)
        if ignore_predictions and motion.outcome is ControllerState.YIELD:
            firm = _chosen(near.as_they_stand(), path, pose, previous, now)
            motion = firm if firm.outcome in ONWARD else motion
    if people_config.non_cooperative:
        return (
            avoid(near, path, now)
            if len(people.walking) and will_collide(near, motion.twist, now)
            else motion
        )
    motion = _beside_people(motion, near)
    return _facing(near, motion) if motion.outcome is ControllerState.YIELD else motion


def _aligned(near: CollisionChecker, askew: float) -> Motion:
    """Turn in place to the heading asked for; where there is no room to turn, stand."""
    turn = _turn(near, askew)
    return BOXED_IN if turn is None else dataclasses.replace(turn, outcome=ControllerState.ALIGN)


def _chosen(
    near: CollisionChecker, path: Points, pose: Pose2, previous: Motion, now: Twist
) -> Motion:
    """Go on with what was begun, turn towards the path, follow it, manoeuvre or back off: the first
    that is called for."""
    rules = near.rules
    if previous.manoeuvre is not None and previous.began is not None:
        motion = _manoeuvred(near, previous.manoeuvre, path, pose, previous.began)
        if motion is not None:
            return motion
    elif (
        previous.began is not None
        and previous.began.distance_to(pose.x_m, pose.y_m) < rules.back_off_m
    ):
        motion = _back_off(near, previous.began)
        if motion.outcome is ControllerState.BACK:
            return motion
    bearing = _bearing(path, rules.lookahead_m)
    turning = previous.outcome is ControllerState.TURN
    if abs(bearing) > math.radians(rules.turn_until_deg if turning else rules.turn_from_deg):
        turn = _turn(near, bearing)
        if turn is not None:
            return turn
    among = near.primitives(path, now)
    motion = follow(near, path, among)
    if motion is None and among.pursued:
        # Close to things an arc may lead on where none of the longer paths is free.
        among = all_arcs()
        motion = follow(near, path, among)
    if motion is not None:
        return motion
    if len(near.people.walking) and follow(near.without_people(), path, among):
        return Motion(twist=STANDSTILL, outcome=ControllerState.YIELD)
    if abs(bearing) > math.radians(rules.turn_until_deg) and follow(near.all_seen(), path, among):
        # What the path leads over was not looked at yet.
        turn = _turn(near, bearing)
        if turn is not None:
            return turn
    found = near.manoeuvre(path, pose)
    return (found and _manoeuvred(near, found, path, pose, pose)) or _back_off(near, pose)


def _manoeuvred(
    near: CollisionChecker, manoeuvre: Manoeuvre, path: Points, pose: Pose2, began: Pose2
) -> Motion | None:
    """One tick of a manoeuvre; None where it is done, or no longer free, or leads nowhere because
    the path is another now."""
    steered = steer(manoeuvre, pose, braking_mps2=near.rules.braking_mps2)
    if steered is None:
        return None
    twist, left = steered
    poses = left.in_base(pose)
    if float(np.hypot(*(path - pose.from_parent(np.array(left.serves))).T).min()) > PATH_LEFT_M:
        return None
    if (
        not (near.clear(poses[None]) > 0.5 * left.room_m).all()
        or not near.is_observed(poses[None]).all()
    ):
        return None
    if (
        len(near.people.walking)
        and not clear_of_people(
            near.people, poses[None], left.takes_s(pose)[None], near.profile, near.people_config
        ).all()
    ):
        return Motion(twist=STANDSTILL, outcome=ControllerState.YIELD, began=began, manoeuvre=left)
    for share in (1.0, 0.5, 0.25):
        slower = Twist(v_mps=share * twist.v_mps, w_radps=share * twist.w_radps)
        soon = stopping_trajectory(slower, near.profile)
        if (near.clear(soon) > min(0.3 * left.room_m, near.padding_m)).all() and near.is_observed(
            soon
        ).all():
            return Motion(
                twist=slower, outcome=ControllerState.MANOEUVRE, began=began, manoeuvre=left
            )
    return None


def _beside_people(motion: Motion, near: CollisionChecker) -> Motion:
    """The same motion, no faster than the people near allow."""
    twist, most = (
        motion.twist,
        speed_limit_near_people(near.people, motion.twist, near.profile, near.people_config),
    )
    fastest = abs(twist.v_mps) + abs(twist.w_radps) * near.profile.circumscribed_radius_m
    if fastest <= most:
        return motion
    if most == 0.0:
        return dataclasses.replace(
            motion, twist=STANDSTILL, outcome=ControllerState.YIELD, arc=None
        )
    slower = Twist(v_mps=twist.v_mps * most / fastest, w_radps=twist.w_radps * most / fastest)
    return dataclasses.replace(motion, twist=slower)


def _facing(near: CollisionChecker, motion: Motion) -> Motion:
    """Who waits for somebody turns to him before he leaves the picture: out of sight he could be
    anywhere."""
    nearest = min(
        near.people.reachable_discs.tolist(),
        key=lambda person: math.hypot(person[0], person[1]),
        default=(1.0, 0.0),
    )
    bearing = math.atan2(nearest[1], nearest[0])
    turn = _turn(near, bearing, either_way=False) if abs(bearing) > FACE_RAD else None
    return (
        motion
        if turn is None
        else _beside_people(dataclasses.replace(motion, twist=turn.twist), near)
    )


def _turn(near: CollisionChecker, bearing: float, *, either_way: bool = True) -> Motion | None:
    """Turn in place towards the bearing, the long way round if the short one is blocked; None when
    neither is free."""
    for angle in (bearing, bearing - math.copysign(2 * math.pi, bearing))[: 2 if either_way else 1]:
        headings = np.linspace(0.0, angle, max(2, math.ceil(abs(angle) / math.radians(2.0))))
        if near.may_turn_to(headings[None]).all():
            rate = min(near.rules.turn_rate_radps, 0.15 + 1.5 * abs(angle))
            return Motion(
                twist=Twist(v_mps=0.0, w_radps=math.copysign(rate, angle)),
                outcome=ControllerState.TURN,
            )
    return None


def _back_off(near: CollisionChecker, began: Pose2) -> Motion:
    """Reverse along the clearest arc, slowly, over ground that was seen or driven before."""
    near, (curvatures, poses) = near.without_front_contacts(), arcs()
    behind = poses[:, :BACK_STEPS] * np.array([-1.0, 1.0, -1.0])
    reach = ((near.clear(behind) > near.padding_m) & near.is_observed(behind)).sum(axis=1)
    reach[np.abs(curvatures) * near.profile.width_m / 2 >= 1] = (
        0  # in so tight a bend a corner of its front goes forward
    )
    arc = int(np.argmax(reach - 0.1 * np.abs(curvatures)))
    if reach[arc] <= BACK_STEPS // 2:
        return BOXED_IN
    twist = Twist(v_mps=-BACK_MPS, w_radps=-BACK_MPS * float(curvatures[arc]))
    return Motion(twist=twist, outcome=ControllerState.BACK, began=began)


def _retreat(near: CollisionChecker, driven: Points) -> Motion | None:
    """Reverse along the driven path, (N, 2) in the base frame; None when that is blocked.

    Seen from a robot that faces the other way it is a path like any other: the footprint is the
    same from both ends.
    """
    motion = follow(near.reversed_motion(), -driven, all_arcs()) if len(driven) > 1 else None
    if motion is None:
        return None
    share = min(1.0, BACK_MPS / max(motion.twist.v_mps, BACK_MPS))
    return Motion(
        twist=Twist(v_mps=-share * motion.twist.v_mps, w_radps=share * motion.twist.w_radps),
        outcome=ControllerState.BACK,
    )


def _look_round(near: CollisionChecker) -> Motion | None:
    """Turn on in place, to the left where that is free; None where neither way is."""
    for bearing in (LOOK_RAD, -LOOK_RAD):
        turn = _turn(near, bearing, either_way=False)
        if turn is not None:
            return dataclasses.replace(turn, outcome=ControllerState.LOOK)
    return None


BACK_STEPS = 13
"""Of an arc's, the first 0.4 m, for reversing."""
BACK_MPS = 0.2
"""The camera does not see where a reversing robot goes."""
PATH_LEFT_M = 0.5
"""A manoeuvre that serves a place farther than this from the path belongs to another."""
FACE_RAD = math.radians(30.0)
"""So far off the middle of the picture may be whom the robot waits for."""
LOOK_RAD = math.radians(30.0)
"""So far ahead of its heading a robot looks for room that turns on and on in place."""
ONWARD = (ControllerState.FOLLOW, ControllerState.TURN)
AWKWARD = (ControllerState.MANOEUVRE, ControllerState.BACK, ControllerState.BOXED_IN)
DRIFT = 2.0
"""While it turns to its heading the robot may be so many times as far from the goal as when it
arrived."""


def _bearing(path_base: Points, lookahead_m: float) -> float:
    """Of the point of the path that lies `lookahead_m` further along it, or of its end."""
    along = metres_along(path_base)
    lookahead_point = path_base[min(int(np.searchsorted(along, lookahead_m)), len(path_base) - 1)]
    return math.atan2(lookahead_point[1], lookahead_point[0])
