"""A robot beside people keeps those who may come back in view."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.control.people.people_state import PeopleExpectations, PeopleState
from navcore.perception.people.track import Track
from navcore.robot.laser_scan import ScannerMount
from navcore.robot.profile import HUSKY
from tests.navcore.control.planning import ORIGIN, decide, stands
from tests.navcore.control.walkers import driven, stops_in_time, walking_on
from tests.navcore.laws import law


@law(100)
@given(st.integers(0, 2**32 - 1))
def test_a_robot_that_looks_after_a_person_stops_before_them_if_they_walked_on(seed: int) -> None:
    """And it does not look after a person whose way led by it, who may stand before it."""
    rng = np.random.default_rng(seed)
    (x, y), speed, heading, unseen_s = (
        rng.uniform(-3, 3, 2),
        rng.uniform(0.5, 1.6),
        rng.uniform(-3, 3),
        rng.uniform(0.1, 7.9),
    )
    lost = walking_on(x, y, speed, heading, unseen_s)
    twist = decide(people=PeopleState.of((lost,), ORIGIN)).twist
    if stops_in_time(twist, x, y, walked_m=speed * unseen_s, speed_mps=speed):
        return
    assert twist.v_mps == 0.0
    assert stops_in_time(twist, lost.x_m, lost.y_m, walked_m=0.0, speed_mps=speed)
    way = shapely.LineString([(x, y), (lost.x_m, lost.y_m)])
    assert shapely.distance(way, shapely.Point(0.0, 0.0)) > HUSKY.circumscribed_radius_m + 0.3


def test_a_waiting_robot_looks_after_a_person_who_walked_out_of_view() -> None:
    left = PeopleState.of((walking_on(2.2, 1.8, 0.9, 2.2, 2.5),), ORIGIN)
    looking = decide(people=left)
    assert looking.outcome is ControllerState.WAIT_FOR_PEOPLE
    assert looking.twist.v_mps == 0.0 and looking.twist.w_radps > 0.2
    anywhere = dataclasses.replace(left, expected_discs=left.reachable_discs)
    assert stands(decide(people=anywhere), ControllerState.WAIT_FOR_PEOPLE)  # the control
    # Who walks to and fro as near as that comes back while the robot turns.
    lane = np.column_stack([np.linspace(-2.0, 2.0, 21), np.full(21, 1.1)])
    beside = dataclasses.replace(left, walked=lane)
    assert stands(decide(people=beside), ControllerState.WAIT_FOR_PEOPLE)
    farther = dataclasses.replace(left, walked=lane + np.array([0.0, 0.3]))
    assert decide(people=farther).twist.w_radps > 0.2
    stopped_by_it = PeopleState.of((walking_on(1.2, -0.2, 0.9, 3.0, 2.5),), ORIGIN)
    assert stands(decide(people=stopped_by_it), ControllerState.WAIT_FOR_PEOPLE)


@pytest.mark.parametrize(("half_width_m", "turns"), [(0.74, False), (0.9, True)])
def test_in_a_door_a_waiting_robot_does_not_turn_after_a_person(
    half_width_m: float, turns: bool
) -> None:
    left = PeopleState.of((walking_on(2.2, 1.8, 0.9, 2.2, 2.5),), ORIGIN)
    x = np.linspace(-1.0, 1.0, 21)
    frame = np.vstack(
        [np.column_stack([x, np.full(21, side)]) for side in (-half_width_m, half_width_m)]
    )
    motion = decide(people=left, geometric=frame)
    assert motion.outcome is ControllerState.WAIT_FOR_PEOPLE
    assert (motion.twist.w_radps > 0.2) == turns


@pytest.mark.parametrize(("x_m", "y_m", "turns"), [(1.2, 0.9, True), (1.1, 0.7, False)])
def test_beside_a_person_the_robot_does_not_turn_after_them(
    x_m: float, y_m: float, turns: bool
) -> None:
    """A corner would swing towards them."""
    person = Track(
        id=1, x_m=x_m, y_m=y_m, vx_mps=0.0, vy_mps=0.6, radius_m=0.3, age_s=9.0, last_seen_ns=0
    )
    motion = decide(people=PeopleState.of((person,), ORIGIN))
    assert motion.outcome is ControllerState.WAIT_FOR_PEOPLE
    assert (motion.twist.w_radps > 0.0) is turns


TO_THE_RIGHT = np.column_stack([np.zeros(61), -np.linspace(0.0, 6.0, 61)])


def turning_away(person: Track, *, is_patient: bool = True) -> Motion:
    """What a robot does whose path leads to the right, with a person before it."""
    people = PeopleState.of((person,), ORIGIN)
    return decide(path=TO_THE_RIGHT, people=people, ignore_predictions=not is_patient)


def walking_away(x_m: float, y_m: float, speed_mps: float = 1.4) -> Track:
    """A person in view who walks away from the robot."""
    return walking_on(x_m, y_m, speed_mps, math.atan2(y_m, x_m), 0.0)


def test_a_robot_does_not_turn_away_from_a_person_who_may_be_back_before_it_has_driven_on() -> None:
    assert stands(turning_away(walking_away(3.0, 0.8)), ControllerState.WAIT_FOR_PEOPLE)


@pytest.mark.parametrize(
    "person",
    [
        walking_away(6.5, 1.5, 0.9),  # too far away to be back soon
        walking_away(2.5, -2.2),  # in view still, when it has turned
        walking_away(-2.5, 0.8),  # out of view already
        dataclasses.replace(walking_away(3.0, 0.8), vx_mps=0.0, vy_mps=0.0, stood_s=20.0),
    ],
)
def test_it_turns_where_that_makes_no_difference(person: Track) -> None:
    motion = turning_away(person)
    assert motion.outcome is ControllerState.TURN and motion.twist.w_radps < 0.0


def test_a_robot_that_has_waited_long_enough_turns_away() -> None:
    motion = turning_away(walking_away(3.0, 0.8), is_patient=False)
    assert motion.outcome is ControllerState.TURN


def test_a_robot_with_a_scanner_sees_them_behind_it_too() -> None:
    people = PeopleState.of((walking_away(3.0, 0.8),), ORIGIN)
    with_scanner = dataclasses.replace(HUSKY, scanner=ScannerMount())
    motion = decide(path=TO_THE_RIGHT, people=people, profile=with_scanner)
    assert motion.outcome is ControllerState.TURN


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_robot_turns_about_past_where_people_walk_to_and_fro(side: float) -> None:
    """Who comes back along their way is then seen before the robot crosses it."""
    angle = side * math.radians(170.0)
    behind = np.column_stack([np.linspace(0, 3, 31)] * 2) * (math.cos(angle), math.sin(angle))
    way = np.column_stack([np.full(11, -1.5), -side * np.linspace(0.5, 3.0, 11)])
    lane = PeopleState.of((), ORIGIN, expectations=PeopleExpectations(walked=way))
    assert side * decide(path=behind).twist.w_radps > 0.3, "the shorter way"
    assert side * decide(path=behind, people=lane).twist.w_radps < -0.3
    scanner = dataclasses.replace(HUSKY, scanner=ScannerMount(x_m=0.2, z_m=0.3))
    seen = decide(path=behind, people=lane, profile=scanner)
    assert side * seen.twist.w_radps > 0.3, "with a scanner they are seen in any case"
    aside = np.column_stack([np.zeros(31), side * np.linspace(0, 3, 31)])
    assert side * decide(path=aside, people=lane).twist.w_radps > 0.3, "much the shorter way"
    wall = np.column_stack([np.linspace(-0.45, 0.45, 10), np.full(10, -side * 0.45)])
    turn = decide(path=behind, people=lane, geometric=wall)
    assert side * turn.twist.w_radps >= 0.0, "where the other is blocked"


@pytest.mark.parametrize("bearing_deg", [-140.0, -170.0, 150.0, 170.0])
@pytest.mark.parametrize("lane_deg", [(0.0, 0.0), (40.0, 80.0), (-30.0, 100.0), (-170.0, -90.0)])
def test_a_turn_past_where_people_walk_goes_on_in_its_direction(
    bearing_deg: float, lane_deg: tuple[float, float]
) -> None:
    angles = np.radians(np.linspace(*lane_deg, 8))
    way = 2.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    ahead = np.linspace(0, 3, 31)[:, None]
    path = ahead * (math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg)))
    pose, motion, turned = ORIGIN, IDLE, []
    for k in range(80):
        motion = IDLE if k % 5 == 4 else motion  # as after a wait for a person
        lane = PeopleState.of((), pose, expectations=PeopleExpectations(walked=way))
        motion = decide(path=path, pose=pose, previous=motion, people=lane)
        if motion.outcome is not ControllerState.TURN:
            break
        turned.append(motion.twist.w_radps)
        pose = driven(pose, motion.twist, 0.1)
    assert motion.outcome is ControllerState.FOLLOW
    assert len({math.copysign(1.0, w) for w in turned}) == 1
    assert 0.1 * sum(map(abs, turned)) < math.radians(235.0)


def test_a_person_comes_up_while_the_turn_that_is_made_lasts() -> None:
    """A person who may be there before the longer turn has ended is waited for."""
    person = Track(
        id=1, x_m=6.75, y_m=0.0, vx_mps=-1.0, vy_mps=0.0, radius_m=0.3, age_s=1.0, last_seen_ns=0,
        walking_speed_mps=1.0,
    )  # fmt: skip
    angle = math.radians(140.0)
    path = np.linspace(0, 3, 31)[:, None] * (math.cos(angle), math.sin(angle))
    way = np.column_stack([np.zeros(10), -np.linspace(0.5, 3.0, 10)])
    for walked, waits in ((np.empty((0, 2)), False), (way, True)):
        people = PeopleState.of((person,), ORIGIN, expectations=PeopleExpectations(walked=walked))
        motion = decide(path=path, people=people)
        assert (motion.outcome is ControllerState.WAIT_FOR_PEOPLE) == waits
