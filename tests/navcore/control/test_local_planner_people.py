"""Beside people: the robot keeps its distance, waits, does not wait for ever, and stops before
any person could reach it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from navcore.behaviours.waiting import WaitingTimer
from navcore.config.people import PeopleConfig
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.control.people.people_state import (
    NO_PEOPLE,
    PEOPLE_CONFIG,
    PeopleExpectations,
    PeopleState,
)
from navcore.control.people.social import speed_limit_near_people
from navcore.geometry.polyline import path_from
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY
from tests.navcore.control.test_local_planner import ORIGIN, decide, footprints, stands
from tests.navcore.laws import law


def driven(pose: Pose2, twist: Twist, period_s: float) -> Pose2:
    """The pose of the robot after a period."""
    turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=twist.w_radps * period_s / 2)
    return pose @ turn @ Pose2(x_m=twist.v_mps * period_s, y_m=0.0, yaw_rad=0.0) @ turn


def crossing(x: float, y: float, vx: float, vy: float) -> PeopleState:
    """A person who walks, in the base frame."""
    return PeopleState(walking=np.array([[x, y, vx, vy, 0.3]]), standing=np.empty((0, 5)))


def closest(people: PeopleState, *, care: bool) -> tuple[float, float, float, set[ControllerState]]:
    """A drive past a person: the least gap while the robot moves, the robot's x and the person's y
    at that moment, and all controller states."""
    pose, motion, period_s = ORIGIN, IDLE, 0.1
    path = np.column_stack([np.linspace(0, 9, 91), np.zeros(91)])
    x, y, vx, vy, radius = people.walking[0].tolist()
    least, outcomes = (math.inf, 0.0, 0.0), set[ControllerState]()
    for _ in range(90):
        track = Track(
            id=1, x_m=x, y_m=y, vx_mps=vx, vy_mps=vy, radius_m=radius, age_s=1.0, last_seen_ns=0
        )
        motion = decide(
            path=path,
            pose=pose,
            previous=motion,
            people=PeopleState.of((track,) if care else (), pose),
        )
        outcomes.add(motion.outcome)
        pose = driven(pose, motion.twist, period_s)
        x, y = x + period_s * vx, y + period_s * vy
        gap_m = float(shapely.distance(footprints([pose])[0], shapely.Point(x, y))) - radius
        least = min(least, (gap_m, pose.x_m, y)) if motion.twist != STANDSTILL else least
    return *least, outcomes


CROSSINGS = [
    (3.0, -2.2, 0.0, 0.8),
    (3.0, 1.4, 0.0, -0.5),
    (2.5, -3.0, 0.0, 1.4),
    (4.0, -2.0, -0.5, 0.6),
    (5.0, 2.0, -0.8, -0.6),
]


@pytest.mark.parametrize("person", CROSSINGS)
def test_the_robot_keeps_its_distance_from_a_person_who_crosses_its_path(
    person: tuple[float, float, float, float],
) -> None:
    assert closest(crossing(*person), care=True)[0] > 0.2
    assert closest(crossing(*person), care=False)[0] <= 0.05  # the control


def test_the_robot_waits_and_passes_behind_a_person_and_not_in_front() -> None:
    _, _, y, outcomes = closest(crossing(3.0, -2.2, 0.0, 0.8), care=True)
    assert y > -0.65  # the person had passed the near side when they were nearest
    assert outcomes <= {ControllerState.FOLLOW, ControllerState.WAIT_FOR_PEOPLE}


def test_a_robot_stands_while_a_person_walks_towards_its_front() -> None:
    assert stands(decide(people=crossing(1.1, 0.0, -1.0, 0.0)), ControllerState.WAIT_FOR_PEOPLE)
    assert decide(people=crossing(4.0, 3.0, 0.0, 1.0)).twist.v_mps > 0.7


def test_beside_people_the_robot_is_slow_and_away_from_them_it_is_not() -> None:
    standing = PeopleState(walking=np.empty((0, 5)), standing=np.array([[0.6, 1.0, 0.0, 0.0, 0.3]]))
    assert 0.1 < decide(people=standing).twist.v_mps <= 0.5
    afar = dataclasses.replace(standing, standing=np.array([[0.6, 4.0, 0.0, 0.0, 0.3]]))
    assert decide(people=afar).twist.v_mps > 0.7


def test_a_person_who_stands_is_an_obstacle_like_any_other() -> None:
    around = np.array(
        [[x, y, 0.0, 0.0, 0.3] for x, y in ((0.84, 0.0), (-0.84, 0.0), (0.0, 0.7), (0.0, -0.7))]
    )
    assert stands(
        decide(people=dataclasses.replace(NO_PEOPLE, standing=around)), ControllerState.BLOCKED
    )
    assert (
        decide(people=dataclasses.replace(NO_PEOPLE, standing=2.5 * around)).outcome
        is ControllerState.FOLLOW
    )


@law(100)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_a_lost_person_who_turned_back_does_not_reach_the_robot_before_it_stands(
    seed: int, ignore_predictions: bool
) -> None:
    """The person has walked towards the robot since they were last seen, whatever the prediction
    says."""
    rng = np.random.default_rng(seed)
    (x, y), speed, heading, unseen_s = (
        rng.uniform(-3, 3, 2),
        rng.uniform(0.5, 1.6),
        rng.uniform(-3, 3),
        rng.uniform(0.1, 1.9),
    )
    lost = walking_on(x, y, speed, heading, unseen_s)
    motion = decide(people=PeopleState.of((lost,), ORIGIN), ignore_predictions=ignore_predictions)
    if motion.outcome is ControllerState.WAIT_FOR_PEOPLE:
        return  # the robot looks after them
    assert stops_in_time(motion.twist, x, y, walked_m=speed * unseen_s, speed_mps=speed)


def test_a_robot_that_backs_off_from_a_person_in_a_bend_moves_no_corner_fast() -> None:
    angles = np.linspace(0.0, 1.5, 30)
    driven_along = 0.3 * np.column_stack([-np.sin(angles), np.cos(angles) - 1.0])

    def fastest_mps(people: PeopleState) -> float:
        motion = decide(people=people, retreat=driven_along)
        assert motion.outcome is ControllerState.BACK
        turning_mps = abs(motion.twist.w_radps) * HUSKY.circumscribed_radius_m
        return abs(motion.twist.v_mps) + turning_mps

    assert fastest_mps(NO_PEOPLE) > PEOPLE_CONFIG.near_mps  # the control
    assert 0.2 < fastest_mps(crossing(1.5, 0.2, -0.3, 0.0)) <= PEOPLE_CONFIG.near_mps + 1e-9


def test_a_person_who_stands_up_against_the_robot_does_not_hold_it_like_a_zone() -> None:
    y = np.arange(-0.3, 0.35, 0.1)
    rows = [np.column_stack([np.full_like(y, x), y]) for x in (0.4, 0.5, 0.6, 0.7)]
    cells = np.vstack(rows)  # those of the margin reach 10 cm into the body
    assert stands(decide(forbidden=cells), ControllerState.IN_ZONE)  # what a zone or a book does
    assert decide(people_cells=cells).outcome is not ControllerState.IN_ZONE
    assert decide(people_cells=cells).twist.v_mps <= 0.0, "it does not drive on against the person"
    assert decide(people_cells=cells, retreat=BEHIND).twist.v_mps < 0.0


BEHIND = np.column_stack([-np.linspace(0.0, 2.0, 21), np.zeros(21)])
"""A path driven to here."""


@pytest.mark.parametrize(
    ("heading_rad", "x_m", "unseen_s", "crosses"),
    [
        (0.0, 2.5, 0.0, True),
        (0.6, 2.5, 0.0, True),
        (math.pi, 2.5, 0.0, False),
        (math.pi / 2, 2.5, 0.0, False),
        (0.0, 2.5, 1.0, False),
        (0.0, 1.0, 0.0, False),  # too near: they could turn round and reach the robot
    ],
)
def test_a_robot_that_leaves_a_lane_crosses_it_while_the_person_is_seen_to_walk_away(
    heading_rad: float, x_m: float, unseen_s: float, crosses: bool
) -> None:
    person = walking_on(x_m, 0.0, 0.8, heading_rad, unseen_s)
    people = PeopleState.of((person,), ORIGIN)
    motion = decide(people=people, retreat=BEHIND, leaves_lane=True)
    assert (motion.outcome is ControllerState.FOLLOW) == crosses
    assert (motion.twist.v_mps > 0.1) == crosses
    if crosses:
        assert stops_in_time(motion.twist, x_m, 0.0, walked_m=0.0, speed_mps=0.8)
        # Control: a robot that backs off since its way is blocked goes on backing off.
        assert decide(people=people, retreat=BEHIND).twist.v_mps < 0.0


@pytest.mark.parametrize("away", [True, False])
def test_a_robot_that_leaves_a_lane_manoeuvres_while_the_person_walks_away(*, away: bool) -> None:
    # The path leads to the left, with walls too near to turn beside: only a manoeuvre leads on.
    x, y = np.arange(-1.5, 1.5, 0.05), np.arange(-0.5, 1.0, 0.05)
    wall = np.vstack(
        [
            np.column_stack([x, np.full_like(x, -0.5)]),
            np.column_stack([np.full_like(y, 1.1), y]),
        ]
    )
    path = np.column_stack([np.zeros(40), np.linspace(0.0, 4.0, 40)])
    trail = np.column_stack([-np.linspace(0.0, 2.0, 21), np.zeros(21)])
    heading_rad = 0.0 if away else math.pi
    people = PeopleState.of((walking_on(3.5, 0.0, 0.8, heading_rad, 0.0),), ORIGIN)
    motion = decide(geometric=wall, path=path, people=people, retreat=trail, leaves_lane=True)
    assert (motion.outcome is ControllerState.MANOEUVRE) == away
    assert (motion.manoeuvre is not None) == away


def test_a_person_who_stays_away_holds_nobody_up_until_they_may_be_back() -> None:
    gone = walking_on(2.0, 1.6, 0.8, math.pi / 2, 3.0)
    assert decide(people=PeopleState.of((gone,), ORIGIN)).twist.v_mps == 0.0
    away = PeopleState.of((gone,), ORIGIN, expectations=stays_away(6.0, gone.id))
    assert decide(people=away).twist.v_mps > 0.3
    late = PeopleState.of((gone,), ORIGIN, expectations=stays_away(1.0, gone.id))
    assert decide(people=late).twist.v_mps == 0.0
    another = PeopleState.of((gone,), ORIGIN, expectations=stays_away(6.0, gone.id + 1))
    assert decide(people=another).twist.v_mps == 0.0


def stays_away(seconds: float, number: int) -> PeopleExpectations:
    """What the behaviours know of a person who stays away."""
    return PeopleExpectations(away=frozenset([number]), away_s=seconds)


def test_a_robot_that_waits_for_a_return_does_not_set_off_and_one_that_drives_goes_on() -> None:
    waited = Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
    assert stands(decide(previous=waited, expects_return=True), ControllerState.WAIT_FOR_PEOPLE)
    assert decide(previous=waited).twist.v_mps > 0.0  # the control
    patient = decide(previous=waited, expects_return=True, ignore_predictions=True)
    assert patient.twist.v_mps > 0.0, "it has waited long enough"
    assert decide(expects_return=True).twist.v_mps > 0.0


def test_a_robot_that_has_just_waited_for_people_out_of_sight_sets_off_slowly() -> None:
    rules = PeopleConfig()
    fast, slow = decide(), decide(is_cautious=True)
    assert fast.twist.v_mps > 0.5
    fastest = slow.twist.v_mps + abs(slow.twist.w_radps) * HUSKY.circumscribed_radius_m
    assert 0.5 * rules.cautious_mps < fastest <= rules.cautious_mps + 1e-9
    turn = decide(path=np.array([[0.0, 0.0], [0.0, 4.0]]), is_cautious=True)
    assert turn.outcome is ControllerState.TURN
    assert 0.0 < turn.twist.w_radps * HUSKY.circumscribed_radius_m <= rules.cautious_mps + 1e-9


def test_a_lane_is_not_crossed_while_another_person_comes() -> None:
    away, comes = walking_on(3.0, 0.0, 0.8, 0.0, 0.0), walking_on(3.5, 1.0, 0.8, math.pi, 0.0)
    people = PeopleState.of((away, comes), ORIGIN)
    assert decide(people=people, retreat=BEHIND, leaves_lane=True).twist.v_mps <= 0.0


def walking_on(x: float, y: float, speed: float, heading: float, unseen_s: float) -> Track:
    """A person who was lost from sight at (x, y), as if they had walked on."""
    vx, vy = speed * math.cos(heading), speed * math.sin(heading)
    return Track(
        id=1,
        x_m=x + vx * unseen_s,
        y_m=y + vy * unseen_s,
        vx_mps=vx,
        vy_mps=vy,
        radius_m=0.3,
        age_s=9.0,
        last_seen_ns=0,
        unseen_s=unseen_s,
    )


def stops_in_time(twist: Twist, x: float, y: float, *, walked_m: float, speed_mps: float) -> bool:
    """Whether a robot stands before a person reaches it, who has walked so far towards it from
    (x, y) and goes on."""
    fastest = abs(twist.v_mps) + abs(twist.w_radps) * HUSKY.circumscribed_radius_m
    gap = math.hypot(max(abs(x) - 0.5, 0), max(abs(y) - 0.35, 0)) - 0.3 - walked_m
    return fastest == 0.0 or gap > speed_mps * (
        PEOPLE_CONFIG.reaction_s + fastest / HUSKY.max_accel_mps2
    )


def stopped(x: float, y: float, *, stood_s: float, pace: float = 0.9) -> PeopleState:
    """A person who walked and then stopped, in the base frame."""
    track = Track(
        id=1,
        x_m=x,
        y_m=y,
        vx_mps=0.0,
        vy_mps=0.0,
        radius_m=0.3,
        age_s=9.0,
        last_seen_ns=0,
        walking_speed_mps=pace,
        stood_s=stood_s,
    )
    return PeopleState.of((track,), ORIGIN)


def test_a_person_who_has_only_stopped_is_waited_for_and_a_settled_one_is_driven_round() -> None:
    walls = np.array([[x, y] for x in np.arange(-1.0, 3.0, 0.1) for y in (-1.3, 1.3)])
    assert stands(
        decide(geometric=walls, people=stopped(1.5, 0.2, stood_s=2.0)),
        ControllerState.WAIT_FOR_PEOPLE,
    )
    settled = decide(geometric=walls, people=stopped(1.5, 0.4, stood_s=20.0))
    assert settled.outcome is ControllerState.FOLLOW
    assert settled.twist.w_radps < 0
    assert (
        decide(people=stopped(1.5, 2.4, stood_s=2.0)).twist.v_mps > 0.3
    )  # off the path: the robot does not wait


@law(100)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_a_person_who_sets_out_again_does_not_reach_the_robot_before_it_stands(
    seed: int, ignore_predictions: bool
) -> None:
    """In any direction, at the former walking speed."""
    rng = np.random.default_rng(seed)
    (x, y), pace = rng.uniform(-3, 3, 2), rng.uniform(0.4, 1.6)
    twist = decide(
        people=stopped(x, y, stood_s=rng.uniform(0, 7), pace=pace),
        ignore_predictions=ignore_predictions,
    ).twist
    fastest = abs(twist.v_mps) + abs(twist.w_radps) * HUSKY.circumscribed_radius_m
    gap = math.hypot(max(abs(x) - 0.5, 0), max(abs(y) - 0.35, 0)) - 0.3
    assert fastest == 0.0 or gap > pace * (
        PEOPLE_CONFIG.reaction_s + fastest / HUSKY.max_accel_mps2
    )


def just_past(*, motions: slice = slice(None)) -> PeopleState:
    """A person who has crossed the robot's path and is a step beyond it, with some of the motions
    that they may make."""
    track = Track(
        id=1, x_m=1.2, y_m=0.9, vx_mps=0.0, vy_mps=0.6, radius_m=0.3, age_s=9.0, last_seen_ns=0
    )
    people = PeopleState.of((track,), ORIGIN)
    return dataclasses.replace(people, walking=people.walking[motions])


def test_behind_a_person_the_robot_waits_until_it_would_pass_before_they_return() -> None:
    waiting = decide(people=just_past())
    assert waiting.outcome is ControllerState.WAIT_FOR_PEOPLE and waiting.twist.v_mps == 0.0
    assert waiting.twist.w_radps > 0  # towards the person, to keep them in view
    assert (
        decide(people=just_past(motions=slice(1))).twist.v_mps > 0.1
    )  # the control: as though no person ever turned back


def comes_back(turns_s: float, stands_s: float, *, care: bool) -> tuple[bool, bool]:
    """A person crosses the robot's path, turns after a rest, and comes back: whether they touch,
    and while the robot moves.

    The camera sees 43° to either side; out of sight the person is predicted to walk on.
    """
    pose, motion, period_s, v_mps = ORIGIN, IDLE, 0.1, 0.0
    path, y, seen, unseen_s, stood_s = (
        np.column_stack([np.linspace(0, 9, 91), np.zeros(91)]),
        -2.2,
        (3.0, -2.2, 0.8),
        0.0,
        0.0,
    )
    for k in range(250):
        t = k * period_s
        speed = 0.8 if t < turns_s else -0.8 if t > turns_s + stands_s and y > -2.2 else 0.0
        y += speed * period_s
        x, lateral = (path_from(np.array([[3.0, y]]), pose) @ np.eye(2))[0].tolist()
        if abs(math.atan2(lateral, x - 0.35)) < math.radians(43.0):
            seen, unseen_s, stood_s = (
                (3.0, y, speed),
                0.0,
                stood_s + period_s if speed == 0.0 else 0.0,
            )
        else:
            unseen_s += period_s
        track = Track(
            id=1,
            x_m=seen[0],
            y_m=seen[1] + seen[2] * unseen_s,
            vx_mps=0.0,
            vy_mps=seen[2],
            radius_m=0.3,
            age_s=9.0,
            last_seen_ns=0,
            unseen_s=unseen_s,
            walking_speed_mps=0.8,
            stood_s=stood_s,
            course_rad=math.copysign(math.pi / 2, seen[2]),
        )
        motion = decide(
            path=path,
            pose=pose,
            previous=motion,
            people=PeopleState.of((track,) if care and unseen_s < 8.0 else (), pose),
        )
        v_mps += float(np.clip(motion.twist.v_mps - v_mps, -3.0 * period_s, 3.0 * period_s))
        pose = driven(pose, dataclasses.replace(motion.twist, v_mps=v_mps), period_s)
        if shapely.distance(footprints([pose])[0], shapely.Point(3.0, y)) < 0.28:
            return True, v_mps != 0.0 or motion.twist != STANDSTILL
    return False, False


@pytest.mark.parametrize(("turns_s", "stands_s"), [(2.6, 0.0), (3.4, 0.0), (3.4, 4.0), (4.2, 3.0)])
def test_the_robot_does_not_drive_into_a_person_who_comes_back_in_sight_or_out_of_it(
    turns_s: float, stands_s: float
) -> None:
    assert comes_back(turns_s, stands_s, care=True) == (False, False)


def test_without_care_it_does() -> None:
    """The control of the scene."""
    assert any(comes_back(turns_s, 0.0, care=False)[1] for turns_s in (2.6, 3.0, 3.4))


def test_a_person_lost_a_moment_ago_may_have_turned_back_and_one_lost_long_ago_has_not() -> None:
    lost = Track(
        id=1,
        x_m=0.8,
        y_m=1.6,
        vx_mps=0.0,
        vy_mps=0.8,
        radius_m=0.35,
        age_s=3.0,
        last_seen_ns=0,
        unseen_s=1.0,
    )
    here = ORIGIN
    waiting = decide(people=PeopleState.of((lost,), here))
    assert waiting.outcome is ControllerState.WAIT_FOR_PEOPLE and waiting.twist.v_mps == 0.0
    later = dataclasses.replace(lost, y_m=7.3, unseen_s=8.1)
    assert decide(people=PeopleState.of((later,), here)).twist.v_mps > 0.5


@law(100)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_no_person_who_turns_towards_the_robot_reaches_it_before_it_stands(
    seed: int, ignore_predictions: bool
) -> None:
    """Whatever the person does at walking speed, in the time that it takes to notice them and to
    brake."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-3, 3, 2)
    speed, heading = rng.uniform(0.5, 1.6), rng.uniform(-math.pi, math.pi)
    twist = decide(
        people=crossing(x, y, speed * math.cos(heading), speed * math.sin(heading)),
        ignore_predictions=ignore_predictions,
    ).twist
    fastest = abs(twist.v_mps) + abs(twist.w_radps) * HUSKY.circumscribed_radius_m
    gap = math.hypot(max(abs(x) - 0.5, 0), max(abs(y) - 0.35, 0)) - 0.3
    assert fastest == 0.0 or gap > speed * (
        PEOPLE_CONFIG.reaction_s + fastest / HUSKY.max_accel_mps2
    )


def leaves_lane_after_s(patience: WaitingTimer | None, *, for_s: float) -> tuple[float, bool]:
    """A person walks up and down the strip in which the robot stands and out of which its path
    leads, waits in front of the robot, and turns: the time in seconds after which the robot has
    left the strip (infinite beyond `for_s`), and whether they ever touched."""
    pose, motion, period_s, touched = ORIGIN, IDLE, 0.1, False
    path = np.vstack(
        [
            np.column_stack([np.linspace(0, 2.2, 23), np.zeros(23)]),
            [[2.2, -0.1 * k] for k in range(1, 40)],
        ]
    )
    beside = np.array([[0.1 * k, -0.75] for k in range(-30, 16)])
    x, sense, waited_s, course = 3.5, -1, 0.0, math.pi
    for k in range(round(for_s / period_s)):
        gap_m = float(shapely.distance(footprints([pose])[0], shapely.Point(x, 0.0))) - 0.3
        touched |= gap_m <= 0.0
        in_front = sense < 0 and pose.x_m < x and gap_m < 0.7 and abs(pose.y_m) < 0.9
        waited_s = waited_s + period_s if in_front else 0.0
        if waited_s > 3.0 or x > 3.5:
            sense, waited_s = 1 if x <= 3.5 else -1, 0.0
        walks = 0.0 if in_front and waited_s > 0.0 else 0.8
        x += sense * walks * period_s
        course = (0.0 if sense > 0 else math.pi) if walks else course
        track = Track(
            id=1,
            x_m=x,
            y_m=0.0,
            vx_mps=sense * walks,
            vy_mps=0.0,
            radius_m=0.3,
            age_s=9.0,
            last_seen_ns=0,
            walking_speed_mps=0.8,
            stood_s=waited_s,
            course_rad=course,
        )
        motion = decide(
            geometric=beside,
            path=path,
            pose=pose,
            previous=motion,
            people=PeopleState.of((track,), pose),
            ignore_predictions=patience is not None and patience.is_over(PEOPLE_CONFIG),
        )
        patience = patience and patience.after(motion, pose, round(1e9 * (k + 1) * period_s))
        pose = driven(pose, motion.twist, period_s)
        if pose.y_m < -1.5:
            return k * period_s, touched
    return math.inf, touched


def test_a_person_who_walks_up_and_down_does_not_keep_the_robot_there_for_ever() -> None:
    assert leaves_lane_after_s(None, for_s=90.0) == (
        math.inf,
        False,
    )  # the control: neither gives way
    leaves_s, touched = leaves_lane_after_s(WaitingTimer(), for_s=90.0)
    assert PEOPLE_CONFIG.patience_s < leaves_s < 90.0 and not touched


@law(150)
@given(st.integers(0, 2**32 - 1))
def test_no_person_beside_a_turning_robot_is_reached_by_its_rim_before_it_stands(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y, speed, twist_w = (
        rng.uniform(-1.5, 1.5),
        rng.uniform(-2, 2),
        rng.uniform(0.5, 1.4),
        rng.uniform(0.2, 0.9),
    )
    people = crossing(x, y, 0.0, -math.copysign(speed, y))
    rim = min(
        speed_limit_near_people(people, Twist(v_mps=0.0, w_radps=twist_w), HUSKY, PEOPLE_CONFIG),
        twist_w * HUSKY.circumscribed_radius_m,
    )
    gap = math.hypot(max(abs(x) - HUSKY.length_m / 2, 0), max(abs(y) - HUSKY.width_m / 2, 0)) - 0.3
    needs = (
        (speed + rim) * PEOPLE_CONFIG.reaction_s
        + speed * rim / PEOPLE_CONFIG.braking_mps2
        + rim**2 / (2 * PEOPLE_CONFIG.braking_mps2)
    )
    assert rim == 0.0 or gap >= needs
