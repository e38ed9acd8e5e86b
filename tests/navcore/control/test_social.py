"""Where the robot may wait for people, and that it does not obstruct them for ever."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from navcore.control.social import (
    NO_PEOPLE,
    PEOPLE_CONFIG,
    SOCIAL_CONFIG,
    PeopleState,
    clear_of_people,
    waiting_index,
)
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
