"""Driving out of the growth of a zone: never nearer, and out where there is a way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navcore.config.control import LocalPlannerConfig
from navcore.config.safety import DEFAULT_SAFETY
from navcore.control.collision.collision_checker import CollisionChecker
from navcore.control.motion import IDLE, ControllerState
from navcore.control.motions.growth_exit import drive_out
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_growth import GrownZone, spread_of
from navcore.robot.profile import HUSKY
from navcore.safety.keep_out_monitor import KeepOuts, permitted_share

NONE: Points = np.empty((0, 2))
SIGMA_M = 0.4
COVARIANCE = SIGMA_M**2 * np.eye(2)
ZONE = Zone(id="z", name="z", polygon=((1.0, -2.0), (3.0, -2.0), (3.0, 2.0), (1.0, 2.0)))
AROUND = (GrownZone(ZONE, spread_of(COVARIANCE, DEFAULT_SAFETY.keep_out.sigmas)),)
GOAL = np.array([6.0, 0.0])
PERIOD_S = 0.1


def checker(obstacles: Points = NONE) -> CollisionChecker:
    return CollisionChecker(
        obstacles=obstacles,
        unseen=NONE,
        cell_radius_m=0.035,
        profile=HUSKY,
        local=LocalPlannerConfig(),
    )


def relative(pose: Pose2) -> float:
    """The distance of the footprint from the zone in units of its growth."""
    return float(AROUND[0].relative_distance(pose.to_parent(HUSKY.footprint())[None])[0])


@pytest.mark.parametrize("yaw_deg", [0, 30, 90, -90, 135, 180])
def test_the_robot_gets_out_and_at_no_time_nearer_and_the_gate_lets_it(yaw_deg: int) -> None:
    pose, motion = Pose2(x_m=0.25, y_m=0.5, yaw_rad=math.radians(yaw_deg)), IDLE
    for _ in range(400):
        now = relative(pose)
        if now >= 1.0:
            break
        motion = drive_out(checker(), AROUND, pose, GOAL, motion)
        seen = KeepOuts(pose=pose, zones=(ZONE,), covariance=COVARIANCE)
        share, _ = permitted_share(seen, motion.twist, HUSKY, frame_age_s=0.05)
        twist = motion.twist
        assert share > 0.2  # a position that is as uncertain permits 0.3 m/s
        chord = Pose2(x_m=share * twist.v_mps * PERIOD_S, y_m=0.0, yaw_rad=0.0)
        half = Pose2(x_m=0.0, y_m=0.0, yaw_rad=share * twist.w_radps * PERIOD_S / 2)
        pose = pose @ half @ chord @ half
        assert relative(pose) >= now - 1e-3
    assert relative(pose) >= 1.0


@pytest.mark.parametrize("yaw_deg", [0, 20, 45])
def test_in_a_room_that_is_all_growth_the_robot_comes_to_a_stand(yaw_deg: int) -> None:
    corners = ((-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0))
    room = Zone(id="r", name="r", polygon=corners, kind=ZoneKind.STAY_INSIDE)
    around = (GrownZone(room, spread_of(COVARIANCE, DEFAULT_SAFETY.keep_out.sigmas)),)
    pose, motion = Pose2(x_m=0.5, y_m=0.1, yaw_rad=math.radians(yaw_deg)), IDLE
    for _ in range(150):
        motion = drive_out(checker(), around, pose, GOAL, motion)
        if motion.outcome is ControllerState.BLOCKED:
            break
        turned = Pose2(x_m=0.0, y_m=0.0, yaw_rad=motion.twist.w_radps * PERIOD_S)
        pose = pose @ turned @ Pose2(x_m=motion.twist.v_mps * PERIOD_S, y_m=0.0, yaw_rad=0.0)
    assert motion.outcome is ControllerState.BLOCKED


def test_between_the_zone_and_an_obstacle_behind_the_robot_stands() -> None:
    behind = np.array([[-0.6, y] for y in np.linspace(-1.0, 1.0, 21)])
    pose = Pose2(x_m=0.25, y_m=0.0, yaw_rad=0.0)
    assert drive_out(checker(behind), AROUND, pose, GOAL, IDLE).outcome is ControllerState.BLOCKED
