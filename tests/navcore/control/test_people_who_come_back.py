"""People who turn back, in sight or out of it, do not reach the robot before it stands."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from navcore.control.motion import IDLE, ControllerState
from navcore.control.people.people_state import PEOPLE_CONFIG, PeopleState
from navcore.geometry.polyline import path_from
from navcore.geometry.transform import STANDSTILL
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY
from tests.navcore.control.planning import ORIGIN, decide, footprints, stands
from tests.navcore.control.walkers import closest, crossing, driven, stops_in_time, walking_on
from tests.navcore.laws import law


def test_the_robot_waits_and_passes_behind_a_person_and_not_in_front() -> None:
    _, _, y, outcomes = closest(crossing(3.0, -2.2, 0.0, 0.8), care=True)
    assert y > -0.65  # the person had passed the near side when they were nearest
    assert outcomes <= {ControllerState.FOLLOW, ControllerState.WAIT_FOR_PEOPLE}


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
