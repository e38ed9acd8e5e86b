"""Where the robot may wait for people, and that it does not obstruct them for ever."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from navcore.control.people.people_state import NO_PEOPLE, PEOPLE_CONFIG, SOCIAL_CONFIG, PeopleState
from navcore.control.people.social import clear_of_people, recedes, waiting_index
from navcore.geometry.transform import Pose2
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY
from tests.navcore.laws import law

Poses = npt.NDArray[np.float64]
SPEED_MPS = 0.5


def walker(x_m: float, y_m: float, vx_mps: float, vy_mps: float) -> PeopleState:
    """Seen from a robot at the origin that faces along x."""
    pace = math.hypot(vx_mps, vy_mps)
    course = math.atan2(vy_mps, vx_mps)
    one = Track(
        id=1,
        x_m=x_m,
        y_m=y_m,
        vx_mps=vx_mps,
        vy_mps=vy_mps,
        radius_m=0.3,
        age_s=3.0,
        last_seen_ns=0,
        walking_speed_mps=pace,
        course_rad=course,
    )
    return PeopleState.of((one,), Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))


def along(bearing_rad: float, metres: float) -> tuple[Poses, npt.NDArray[np.float64]]:
    """(S, 3) poses a tenth of a metre apart on a straight line, heading along it, and when the
    robot is there."""
    away = np.arange(0.1, metres + 0.05, 0.1)
    poses = np.column_stack(
        [
            away * math.cos(bearing_rad),
            away * math.sin(bearing_rad),
            np.full(len(away), bearing_rad),
        ]
    )
    return poses, away / SPEED_MPS


def waits_at(people: PeopleState, bearing_rad: float, metres: float = 1.0) -> float:
    """How far along a line the robot would wait, m; -1 if nowhere."""
    poses, times_s = along(bearing_rad, metres)
    index = waiting_index(people, poses, times_s, HUSKY, PEOPLE_CONFIG)
    return -1.0 if index < 0 else float(np.hypot(*poses[index, :2]))


def test_the_robot_waits_just_outside_the_line_of_a_person() -> None:
    crossing = walker(2.0, -1.5, 0.0, 0.9)
    waits_m = waits_at(crossing, 0.0, 1.0)
    gap_m = 2.0 - 0.3 - HUSKY.length_m / 2 - waits_m
    assert PEOPLE_CONFIG.personal_m + 0.2 < gap_m < PEOPLE_CONFIG.personal_m + 0.35


def test_a_robot_beside_the_line_of_a_person_does_not_wait_on_it() -> None:
    passing = walker(-2.5, 1.2, 0.9, 0.0)
    assert waits_at(passing, 0.0, 0.6) > -1.0
    assert waits_at(passing, math.pi / 2, 0.6) == -1.0


def test_a_robot_in_the_path_of_a_person_drives_on_to_where_it_obstructs_no_more() -> None:
    towards = walker(
        3.0, 0.0, 0.9, 0.0
    )  # leaves, and may come back at any moment: the robot stands on the line of this person
    assert waits_at(towards, -math.pi / 3) > 0.9


@law(40)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_motion_is_clear_of_people_exactly_up_to_the_first_pose_that_is_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walking = rng.uniform(-1.0, 1.0, (int(rng.integers(1, 5)), 5)) * (4.0, 4.0, 1.5, 1.5, 0.0)
    walking[:, 4] = rng.uniform(0.2, 0.5, len(walking))
    poses = rng.uniform(-1.0, 1.0, (3, 6, 3)) * (2.0, 2.0, math.pi)
    times_s = rng.uniform(0.0, 3.0, (3, 6))
    rules, moments = (
        PEOPLE_CONFIG,
        max(math.ceil(PEOPLE_CONFIG.headway_s / SOCIAL_CONFIG.sample_s), 1),
    )
    later_s = rules.headway_s * np.arange(moments + 1) / moments
    at_s = (times_s[..., None] + later_s)[:, :, None, :]  # pose by pose, for people and moments
    x, y = (
        walking[:, axis, None] + at_s * walking[:, 2 + axis, None] - poses[:, :, None, None, axis]
        for axis in (0, 1)
    )
    cos, sin = np.cos(poses[..., 2])[..., None, None], np.sin(poses[..., 2])[..., None, None]
    gaps = np.hypot(
        np.maximum(np.abs(cos * x + sin * y) - HUSKY.length_m / 2, 0.0),
        np.maximum(np.abs(cos * y - sin * x) - HUSKY.width_m / 2, 0.0),
    )
    least_m = (gaps - walking[:, 4, None]).min(axis=(2, 3))
    expected = np.logical_and.accumulate(
        least_m > rules.personal_m + rules.personal_per_s * times_s, axis=1
    )
    people = dataclasses.replace(NO_PEOPLE, walking=walking)
    assert np.array_equal(clear_of_people(people, poses, times_s, HUSKY, rules), expected)


def backs_off(people: PeopleState, bearing_rad: float, metres: float = 0.6) -> bool:
    """Whether a robot that faces along x may drive slowly in a direction without turning."""
    poses, _ = along(bearing_rad, metres)
    poses[:, 2] = 0.0
    times_s = np.hypot(poses[:, 0], poses[:, 1]) / 0.2
    return recedes(people, poses, times_s, HUSKY, PEOPLE_CONFIG)


def test_away_from_a_person_the_robot_recedes_and_towards_them_it_does_not() -> None:
    leaves = walker(1.6, 0.0, 0.8, 0.0)
    assert backs_off(leaves, math.pi)
    assert not backs_off(leaves, 0.0)


def test_it_stands_while_a_person_is_about_to_touch_it() -> None:
    assert not backs_off(walker(0.95, 0.0, -0.8, 0.0), math.pi)
    assert backs_off(walker(2.5, 0.0, -0.8, 0.0), math.pi)


def out_of_sight(x_m: float, y_m: float, unseen_s: float) -> PeopleState:
    """Return a person who walked along y at 1 m/s and was lost from sight at a position."""
    lost = Track(
        id=1,
        x_m=x_m,
        y_m=y_m + unseen_s,
        vx_mps=0.0,
        vy_mps=1.0,
        radius_m=0.3,
        age_s=5.0,
        last_seen_ns=0,
        unseen_s=unseen_s,
        walking_speed_mps=1.0,
        course_rad=math.pi / 2,
    )
    return PeopleState.of((lost,), Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))


def test_who_stopped_out_of_sight_is_not_approached() -> None:
    people = out_of_sight(-1.3, 0.0, 0.3)
    assert not backs_off(people, math.pi)
    assert backs_off(people, 0.0)


def test_the_robot_stands_where_a_person_out_of_sight_may_have_come_up_to_it() -> None:
    """They went away along y and may have turned back since, and it backs off unseeing."""
    assert backs_off(out_of_sight(0.0, 4.0, 3.0), 0.0)
    assert not backs_off(out_of_sight(0.0, 4.0, 3.4), 0.0)


@law(150)
@given(st.integers(0, 2**32 - 1))
def test_a_receding_robot_is_nearer_to_nobody_than_a_standing_one_or_keeps_its_distance(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    x, y, vx, vy = rng.uniform(-2.5, 2.5, 2).tolist() + rng.uniform(-1.2, 1.2, 2).tolist()
    if math.hypot(vx, vy) < 0.3:
        return
    people, bearing_rad = walker(x, y, vx, vy), rng.uniform(-math.pi, math.pi)
    if not backs_off(people, bearing_rad):
        return
    for walks in people.walking.tolist():
        for t_s in np.arange(0.5, 3.1, 0.5):
            away_m = 0.2 * t_s
            moved = away_m * math.cos(bearing_rad), away_m * math.sin(bearing_rad)
            there = walks[0] + t_s * walks[2], walks[1] + t_s * walks[3]
            gap_m, stood_m = (
                math.hypot(
                    max(abs(there[0] - at[0]) - HUSKY.length_m / 2, 0.0),
                    max(abs(there[1] - at[1]) - HUSKY.width_m / 2, 0.0),
                )
                - walks[4]
                for at in (moved, (0.0, 0.0))
            )
            if stood_m < SOCIAL_CONFIG.stopped_gap_m:
                break  # that person has come up to the standing robot
            assert gap_m >= min(stood_m, PEOPLE_CONFIG.personal_m) - 1e-6
            if t_s <= PEOPLE_CONFIG.headway_s:
                assert gap_m > 0
