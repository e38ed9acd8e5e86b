"""The robot leaves the lane of people who walk to and fro, and waits for those who come back."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from navcore.behaviours.waiting import WaitingTimer
from navcore.config.people import PeopleConfig
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.control.people.people_state import PEOPLE_CONFIG, PeopleExpectations, PeopleState
from navcore.geometry.transform import STANDSTILL
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY
from tests.navcore.control.planning import ORIGIN, decide, footprints, stands
from tests.navcore.control.walkers import BEHIND, driven, stops_in_time, walking_on


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
