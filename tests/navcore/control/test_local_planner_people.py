"""Beside people the robot keeps its distance and is slow."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.control.motion import ControllerState
from navcore.control.people.people_state import NO_PEOPLE, PEOPLE_CONFIG, PeopleState
from navcore.control.people.social import speed_limit_near_people
from navcore.geometry.transform import Twist
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY
from tests.navcore.control.planning import ORIGIN, decide, stands
from tests.navcore.control.walkers import BEHIND, closest, crossing, walking_on
from tests.navcore.laws import law

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


def limit_of(lost: Track, twist: Twist) -> float:
    """The speed limit for a motion beside a person who is out of sight."""
    return speed_limit_near_people(PeopleState.of((lost,), ORIGIN), twist, HUSKY, PEOPLE_CONFIG)


def test_a_robot_that_drives_away_from_a_lost_person_does_not_stop_for_them_behind_it() -> None:
    away, turning = Twist(v_mps=1.0, w_radps=-0.1), Twist(v_mps=0.3, w_radps=0.9)
    lost = walking_on(-4.7, 0.5, 0.8, 2.8, unseen_s=5.0)  # by now they may stand beside it
    assert limit_of(lost, away) > 1.0
    assert limit_of(lost, turning) == 0.0, "its corners go round it"
    assert limit_of(lost, Twist(v_mps=-0.3, w_radps=0.0)) == 0.0
    assert 0.0 < limit_of(walking_on(-4.7, 0.5, 0.8, 2.8, unseen_s=5.3), away) < 0.9
    assert limit_of(walking_on(-4.7, 0.5, 0.8, 2.8, unseen_s=6.5), away) == 0.0, "before it, too"
    assert limit_of(walking_on(0.2, 1.5, 0.8, 0.0, unseen_s=1.5), away) == 0.0
