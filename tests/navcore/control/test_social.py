"""Where the robot may wait for people, and that it does not stay in their way for ever."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.control.social import PEOPLE_CONFIG, PeopleState, waiting_index
from navcore.geometry.transform import Pose2
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY

Poses = npt.NDArray[np.float64]
SPEED_MPS = 0.5


def walker(x_m: float, y_m: float, vx_mps: float, vy_mps: float) -> PeopleState:
    """Seen from a robot at the origin that faces along x."""
    pace = math.hypot(vx_mps, vy_mps)
    course = math.atan2(vy_mps, vx_mps)
    one = Track(
        id=1, x_m=x_m, y_m=y_m, vx_mps=vx_mps, vy_mps=vy_mps, radius_m=0.3, age_s=3.0, last_seen_ns=0, pace_mps=pace,
        course_rad=course,
    )  # fmt: skip
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


def waits_at(bodies: PeopleState, bearing_rad: float, metres: float = 1.0) -> float:
    """How far along a line the robot would wait, m; -1 if nowhere."""
    poses, times_s = along(bearing_rad, metres)
    index = waiting_index(bodies, poses, times_s, HUSKY, PEOPLE_CONFIG)
    return -1.0 if index < 0 else float(np.hypot(*poses[index, :2]))


def test_the_robot_waits_as_near_as_leaves_somebody_his_line_and_no_nearer() -> None:
    crossing = walker(2.0, -1.5, 0.0, 0.9)
    waits_m = waits_at(crossing, 0.0, 1.0)
    gap_m = 2.0 - 0.3 - HUSKY.length_m / 2 - waits_m
    assert PEOPLE_CONFIG.personal_m + 0.2 < gap_m < PEOPLE_CONFIG.personal_m + 0.35


def test_from_beside_his_line_nowhere_on_it_is_a_place_to_wait() -> None:
    passing = walker(-2.5, 1.2, 0.9, 0.0)
    assert waits_at(passing, 0.0, 0.6) > -1.0
    assert waits_at(passing, math.pi / 2, 0.6) == -1.0


def test_who_stands_in_somebodys_way_goes_on_where_it_is_no_more_so() -> None:
    towards = walker(
        3.0, 0.0, 0.9, 0.0
    )  # he goes, and may come back this moment: the robot stands on his line
    assert waits_at(towards, -math.pi / 3) > 0.9
