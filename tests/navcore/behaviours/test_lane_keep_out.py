"""A person who keeps the robot waiting gets their lane if a detour is short."""

from __future__ import annotations

import dataclasses
import math

import pytest
from shapely import Point, Polygon
from shapely.geometry import box
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from navcore.behaviours.lane_keep_out import LaneKeepOut
from navcore.config.behaviours import LaneConfig
from navcore.control.motion import ControllerState, Motion
from navcore.control.people.people_state import PEOPLE_CONFIG
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY

ROBOT = Pose2(x_m=0.0, y_m=0.2, yaw_rad=0.0)
YIELDS = Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
DRIVES = Motion(twist=Twist(v_mps=0.5, w_radps=0.0), outcome=ControllerState.FOLLOW)
TICK_S = 0.1
RULES = LaneConfig()


def walker(t_s: float) -> Track:
    """To and fro ahead of the robot, between x = 1 m and x = 4 m."""
    along = (t_s * 0.9) % 6.0
    forth = along < 3.0
    return Track(
        id=1,
        x_m=1.0 + (along if forth else 6.0 - along),
        y_m=0.0,
        vx_mps=0.9 if forth else -0.9,
        vy_mps=0.0,
        radius_m=0.3,
        age_s=5.0,
        last_seen_ns=0,
        walking_speed_mps=0.9,
    )


def waited(
    lanes: LaneKeepOut,
    seconds: float,
    *,
    motion: Motion = YIELDS,
    route_m: float | None = 20.0,
    pose: Pose2 = ROBOT,
    unseen_s: float = 0.0,
) -> LaneKeepOut:
    """After so many more seconds."""
    for _ in range(round(seconds / TICK_S)):
        stamp_ns = lanes.now_ns + round(TICK_S * 1e9)
        someone = dataclasses.replace(walker(stamp_ns / 1e9), unseen_s=unseen_s)
        lanes = lanes.after(
            motion,
            (someone,),
            pose,
            stamp_ns,
            route_m=route_m,
            profile=HUSKY,
            people_config=PEOPLE_CONFIG,
        )
    return lanes


def closed(lanes: LaneKeepOut) -> BaseGeometry:
    return unary_union([Polygon(zone.polygon) for zone in lanes.zones])


def test_after_a_while_the_strip_in_which_he_walks_is_closed_and_no_more() -> None:
    assert not waited(LaneKeepOut(), PEOPLE_CONFIG.lane_s - 0.2).zones
    lanes = waited(LaneKeepOut(), PEOPLE_CONFIG.lane_s + 0.2)
    strip = closed(lanes)
    assert strip.contains(box(1.2, -0.3, 4.0, 0.3))
    assert box(0.4, -0.6, 4.6, 0.6).contains(strip)


def test_the_robot_can_turn_where_it_stands_and_does_not_stand_in_what_is_closed() -> None:
    lanes = waited(
        LaneKeepOut(), PEOPLE_CONFIG.lane_s + 0.2, pose=Pose2(x_m=2.5, y_m=0.0, yaw_rad=0.0)
    )
    assert len(lanes.zones) == 2
    assert closed(lanes).distance(Point(2.5, 0.0)) > HUSKY.circumscribed_radius_m


def test_what_people_have_walked_all_round_the_robot_is_not_closed() -> None:
    lanes = LaneKeepOut()
    for k in range(200):
        angle, stamp_ns = 0.1 * k, lanes.now_ns + round(TICK_S * 1e9)
        someone = dataclasses.replace(
            walker(0.0), x_m=1.2 * math.cos(angle), y_m=1.2 * math.sin(angle)
        )
        here = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
        lanes = lanes.after(
            YIELDS,
            (someone,),
            here,
            stamp_ns,
            route_m=20.0,
            profile=HUSKY,
            people_config=PEOPLE_CONFIG,
        )
        assert not closed(lanes).contains(Point(0.0, 0.0))


@pytest.mark.parametrize("route_m", [None, 20.0 + RULES.max_detour_m + 0.1])
def test_where_there_is_no_way_beside_it_the_lane_is_opened_at_once_and_stays_open(
    route_m: float | None,
) -> None:
    lanes = waited(LaneKeepOut(), PEOPLE_CONFIG.lane_s + 0.2)
    opened = waited(lanes, TICK_S, route_m=route_m)
    assert not opened.zones
    assert not waited(opened, RULES.reopened_s - 1.0).zones
    assert waited(opened, RULES.reopened_s + PEOPLE_CONFIG.lane_s + 1.0).zones


def test_a_lane_stays_closed_until_the_robot_has_passed_or_nobody_walks_there() -> None:
    lanes = waited(LaneKeepOut(), PEOPLE_CONFIG.lane_s + 0.2)
    assert waited(lanes, 60.0, motion=DRIVES).zones
    assert not waited(
        lanes, 1.0, motion=DRIVES, pose=Pose2(x_m=RULES.remembered_m + 0.5, y_m=-1.0, yaw_rad=0.0)
    ).zones
    assert not waited(lanes, RULES.remembered_s + 1.0, motion=DRIVES, unseen_s=1.0).zones


def test_who_does_not_wait_or_comes_on_closes_nothing() -> None:
    assert not waited(LaneKeepOut(), 60.0, motion=DRIVES).zones
    lanes = LaneKeepOut()
    for step in range(10):
        lanes = waited(
            lanes, PEOPLE_CONFIG.lane_s - 1.0, pose=Pose2(x_m=-1.5 * step, y_m=0.2, yaw_rad=0.0)
        )
        assert not lanes.zones


def test_where_somebody_out_of_sight_is_thought_to_be_is_no_lane() -> None:
    assert not waited(LaneKeepOut(), 60.0, unseen_s=1.0).zones
