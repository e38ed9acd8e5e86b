"""Beside people who do not give way the robot moves aside, and onto no obstacle."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from navcore.config.control import (
    ControlConfig,
    DynamicWindowConfig,
    LocalPlannerConfig,
    ReverseConfig,
)
from navcore.config.people import PeopleConfig
from navcore.control.collision.collision_checker import CollisionChecker
from navcore.control.local_planner import LocalPlannerInput, compute_velocity
from navcore.control.motion import IDLE, ControllerState
from navcore.control.motions.dynamic_window import will_collide
from navcore.control.motions.reversing import back_off
from navcore.control.people.people_state import PeopleState
from navcore.errors import BadConfiguration
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY, RobotProfile, load_profile

JACKAL = load_profile("jackal")
NON_COOPERATIVE = PeopleConfig(non_cooperative=True)
NONE: npt.NDArray[np.float64] = np.empty((0, 2))
RADIUS_M, STEP_S = 0.5, 0.1


def gap_m(pose: Pose2, x_m: float, y_m: float, profile: RobotProfile) -> float:
    """Distance in metres from the robot's outline to a point."""
    at = pose.from_parent(np.array([x_m, y_m]))
    return math.hypot(
        max(abs(at[0]) - profile.length_m / 2, 0.0), max(abs(at[1]) - profile.width_m / 2, 0.0)
    )


def limited(asked: Twist, now: Twist, profile: RobotProfile) -> Twist:
    """The velocity that the platform reaches within one step."""
    dv, dw = profile.max_accel_mps2 * STEP_S, profile.max_yaw_accel_radps2 * STEP_S
    return Twist(
        v_mps=now.v_mps + float(np.clip(asked.v_mps - now.v_mps, -dv, dv)),
        w_radps=now.w_radps + float(np.clip(asked.w_radps - now.w_radps, -dw, dw)),
    )


def driven_on(pose: Pose2, twist: Twist) -> Pose2:
    turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=twist.w_radps * STEP_S / 2)
    return pose @ turn @ Pose2(x_m=twist.v_mps * STEP_S, y_m=0.0, yaw_rad=0.0) @ turn


def meeting(
    walker: tuple[float, float, float, float],
    *,
    goal_m: float = 12.0,
    profile: RobotProfile = JACKAL,
    walls: npt.NDArray[np.float64] = NONE,
    drives: bool = True,
) -> tuple[float, float, Pose2]:
    """The least gap to a walker (x, y, vx, vy, known from the start), the least to any wall, and
    the last pose."""
    pose, twist, motion = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), STANDSTILL, IDLE
    path = np.column_stack([np.linspace(0.0, goal_m, 121), np.zeros(121)])
    near_walker, near_wall = math.inf, math.inf
    x, y, vx, vy = walker
    for step in range(80):
        person = Track(
            id=1,
            x_m=x,
            y_m=y,
            vx_mps=vx,
            vy_mps=vy,
            radius_m=RADIUS_M,
            age_s=2.0,
            last_seen_ns=0,
            walking_speed_mps=math.hypot(vx, vy),
            course_rad=math.atan2(vy, vx),
        )
        if drives:
            motion = compute_velocity(
                LocalPlannerInput(
                    geometric=pose.from_parent(walls),
                    forbidden=NONE,
                    unseen=NONE,
                    cell_m=0.05,
                    path=path,
                    pose=pose,
                    twist=twist,
                    previous=motion,
                    profile=profile,
                    local=LocalPlannerConfig(),
                    people=PeopleState.of((person,), pose, NON_COOPERATIVE),
                    people_config=NON_COOPERATIVE,
                )
            )
            twist = limited(motion.twist, twist, profile)
            pose = driven_on(pose, twist)
        x, y = x + STEP_S * vx, y + STEP_S * vy
        near_walker = min(near_walker, gap_m(pose, x, y, profile) - RADIUS_M)
        near_wall = min(
            [
                near_wall,
                *(gap_m(pose, wall_x, wall_y, profile) for wall_x, wall_y in walls.tolist()),
            ]
        )
        assert step < 79 or motion.outcome is not ControllerState.BLOCKED
    return near_walker, near_wall, pose


def encounters(count: int) -> list[tuple[float, float, float, float]]:
    """People who would walk over a robot that stands, or over one that drives straight on: from
    any direction, at 0.6 to 1.5 m/s."""
    rng, found = np.random.default_rng(0), []
    for index in range(count):
        bearing, pace = rng.uniform(-math.pi, math.pi), rng.uniform(0.6, 1.5)
        after_s = rng.uniform(2.0, 3.0)
        aim_x = 0.0 if index % 2 else JACKAL.max_speed_mps * (after_s - 0.25)
        vx, vy = pace * math.cos(bearing), pace * math.sin(bearing)
        found.append((aim_x - after_s * vx, -after_s * vy, vx, vy))
    return found


@pytest.mark.parametrize("walker", encounters(30))
def test_no_person_seen_in_time_meets_the_robot_and_it_drives_on(
    walker: tuple[float, float, float, float],
) -> None:
    near_walker, _, pose = meeting(walker)
    assert near_walker > 0.05
    assert pose.x_m > 8.0


def test_half_of_them_would_have_walked_over_a_robot_that_stands() -> None:
    met = [meeting(walker, drives=False)[0] <= 0.0 for walker in encounters(30)]
    assert sum(met) >= 15


@pytest.mark.parametrize("pace", [0.6, 0.9])
def test_the_husky_moves_aside_for_a_person_who_walks_towards_it(pace: float) -> None:
    assert meeting((3.0, 0.0, -pace, 0.0), profile=HUSKY)[0] > 0.05


def test_it_drives_onto_no_wall_to_move_aside() -> None:
    x = np.arange(-4.0, 14.0, 0.05)
    corridor = np.vstack([np.column_stack([x, np.full_like(x, side)]) for side in (-0.6, 0.6)])
    _, near_wall, _ = meeting((5.0, 0.0, -0.6, 0.0), walls=corridor)
    assert near_wall > 0.0


def open_floor(control: ControlConfig, *walking: float) -> CollisionChecker:
    """The surroundings of a robot that nothing stands near, with a person who walks."""
    people = PeopleState(walking=np.reshape(walking, (-1, 5)), standing=np.empty((0, 5)))
    return CollisionChecker(
        obstacles=NONE,
        unseen=NONE,
        cell_radius_m=0.035,
        profile=HUSKY,
        local=LocalPlannerConfig(),
        control=control,
        people=people,
    )


def test_no_step_is_beyond_the_horizon() -> None:
    """What is met there would cost less than nothing."""
    with pytest.raises(BadConfiguration, match=r"at most horizon_s 0\.2"):
        DynamicWindowConfig(horizon_s=0.2, step_s=1.0)
    window = DynamicWindowConfig(horizon_s=0.65, step_s=0.4)
    near = open_floor(ControlConfig(dynamic_window=window), 1.0, 0.0, -1.0, 0.0, 0.3)
    assert will_collide(near, Twist(v_mps=1.0, w_radps=0.0), STANDSTILL)


def test_a_robot_backs_off_also_where_an_arc_has_fewer_poses_than_are_checked() -> None:
    control = ControlConfig(reverse=ReverseConfig(poses=100))
    here = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    assert back_off(open_floor(control), here).outcome is ControllerState.BACK


def test_a_robot_that_yields_stands_before_the_same_walker() -> None:
    pose = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    person = Track(
        id=1,
        x_m=1.6,
        y_m=0.0,
        vx_mps=-1.0,
        vy_mps=0.0,
        radius_m=0.3,
        age_s=2.0,
        last_seen_ns=0,
        walking_speed_mps=1.0,
    )
    path = np.column_stack([np.linspace(0.0, 5.0, 51), np.zeros(51)])
    outcomes = {}
    for people_config in (PeopleConfig(), NON_COOPERATIVE):
        motion = compute_velocity(
            LocalPlannerInput(
                geometric=NONE,
                forbidden=NONE,
                unseen=NONE,
                cell_m=0.05,
                path=path,
                pose=pose,
                previous=IDLE,
                profile=JACKAL,
                local=LocalPlannerConfig(),
                people=PeopleState.of((person,), pose, people_config),
                people_config=people_config,
            )
        )
        outcomes[people_config.non_cooperative] = (motion.outcome, motion.twist == STANDSTILL)
    assert outcomes == {
        False: (ControllerState.WAIT_FOR_PEOPLE, True),
        True: (ControllerState.AVOID, False),
    }
