"""Contact predicted from the newest image alone, and the gate that slows down and stops for it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.safety import DEFAULT_SAFETY
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.robot.driver import Command
from navcore.robot.frame import Frame
from navcore.robot.laser_scan import LaserScan
from navcore.robot.profile import HUSKY, RobotProfile
from navcore.safety.collision_monitor import (
    NO_POINTS,
    NearPoints,
    RecentObstacles,
    allowed_share,
    braking_s,
    time_to_contact,
)
from navcore.safety.gate import Cause, GateDecision, GateInput, gate
from tests.navcore.laws import law
from tests.navcore.scene import Box, picture, scanned

NOW, TENTH_NS = 10_000_000_000, 100_000_000
FRONT_M, SIDE_M = HUSKY.length_m / 2, HUSKY.width_m / 2
FULL = Twist(v_mps=1.0, w_radps=0.0)
AHEAD_M = DEFAULT_SAFETY.collision.padding_ahead_m
MEMORY_NS = DEFAULT_SAFETY.collision.memory_ns


def post(x_m: float, y_m: float) -> NearPoints:
    """Return six points at one position."""
    return np.tile(np.array([[x_m, y_m]], dtype=np.float32), (6, 1))


def judged(
    points: NearPoints, asked: Twist, *, sent: Twist | None = None, age_s: float = 0.05
) -> GateDecision:
    facts = GateInput(
        now_ns=NOW,
        frame_ns=NOW - round(age_s * 1e9),
        stopped_by=None,
        command=Command(twist=asked, stamp_ns=NOW),
        obstacles=points,
    )
    return gate(facts, sent=asked if sent is None else sent, period_s=0.05, profile=HUSKY)


def test_a_robot_that_reverses_stops_before_what_only_the_scanner_sees() -> None:
    behind = Box(x=(-1.2, -1.0), y=(-0.5, 0.5), z=(0.0, 1.0))
    back = Twist(v_mps=-0.5, w_radps=0.0)
    seen = dataclasses.replace(picture(behind), scan=scanned(behind))
    contact_s = time_to_contact(RecentObstacles().after(seen, HUSKY).all_points, back, HUSKY)
    assert contact_s == pytest.approx((1.0 - FRONT_M - AHEAD_M) / 0.5, abs=0.1)
    # The control: the camera alone knows nothing of what is behind.
    blind = RecentObstacles().after(picture(behind), HUSKY)
    assert time_to_contact(blind.all_points, back, HUSKY) == math.inf


def test_what_the_scanner_no_longer_sees_is_forgotten_at_once_and_one_ray_is_noise() -> None:
    behind = Box(x=(-1.2, -1.0), y=(-0.5, 0.5), z=(0.0, 1.0))
    back = Twist(v_mps=-0.5, w_radps=0.0)
    after = RecentObstacles().after(dataclasses.replace(picture(), scan=scanned(behind)), HUSKY)
    gone = after.after(dataclasses.replace(picture(stamp_ns=TENTH_NS), scan=scanned()), HUSKY)
    assert time_to_contact(gone.all_points, back, HUSKY) == math.inf
    ranges = np.full(720, np.inf, dtype=np.float32)
    ranges[360] = 0.8
    speck = LaserScan(ranges_m=ranges, x_m=0.0, max_range_m=8.0)
    one = RecentObstacles().after(dataclasses.replace(picture(), scan=speck), HUSKY)
    assert time_to_contact(one.all_points, back, HUSKY) == math.inf


@pytest.mark.parametrize("distance_m", [0.1, 0.4, 0.8])
def test_the_time_to_contact_is_the_distance_over_the_speed(distance_m: float) -> None:
    points = post(FRONT_M + AHEAD_M + distance_m, 0.1)
    assert time_to_contact(points, FULL, HUSKY) == pytest.approx(distance_m, abs=0.021)
    assert time_to_contact(points, Twist(v_mps=-1.0, w_radps=0.0), HUSKY) == math.inf


def test_only_points_that_the_footprint_sweeps_count() -> None:
    beside = post(FRONT_M + 0.3, SIDE_M + 0.02)
    assert time_to_contact(beside, FULL, HUSKY) == math.inf
    assert time_to_contact(beside, Twist(v_mps=1.0, w_radps=0.5), HUSKY) < 1.0
    assert time_to_contact(beside, Twist(v_mps=1.0, w_radps=-0.5), HUSKY) == math.inf


def test_turning_in_place_sweeps_the_corners() -> None:
    corner = post(0.55, 0.2)  # within the circle of the corners, ahead of the bumper
    assert time_to_contact(corner, Twist(v_mps=0.0, w_radps=-0.8), HUSKY) < 1.0
    assert time_to_contact(post(0.65, 0.0), Twist(v_mps=0.0, w_radps=-0.8), HUSKY) == math.inf


def test_a_few_points_and_points_inside_the_body_are_no_obstacle() -> None:
    assert time_to_contact(post(FRONT_M + 0.2, 0.0)[:3], FULL, HUSKY) == math.inf
    assert time_to_contact(post(0.2, 0.0), FULL, HUSKY) == math.inf


def test_the_robot_may_leave_an_obstacle_within_the_clearance_but_not_approach_it() -> None:
    near = post(FRONT_M + AHEAD_M / 2, 0.0)
    assert time_to_contact(near, FULL, HUSKY) < 0.03
    assert time_to_contact(near, Twist(v_mps=-0.2, w_radps=0.0), HUSKY) == math.inf
    assert time_to_contact(post(0.0, SIDE_M + 0.005), FULL, HUSKY) == math.inf


def test_contact_is_counted_from_where_the_robot_is_and_noise_is_told_where_it_was_measured() -> (
    None
):
    ahead, beside = post(FRONT_M + 0.5, 0.0), post(FRONT_M + 0.3, 0.5)
    on = Pose2(x_m=0.3, y_m=0.0, yaw_rad=0.0)
    assert time_to_contact(ahead, FULL, HUSKY, start=on) == pytest.approx(0.17, abs=0.021)
    turned = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.atan2(0.5, FRONT_M + 0.3))
    assert time_to_contact(beside, FULL, HUSKY) == math.inf
    assert time_to_contact(beside, FULL, HUSKY, start=turned) < 0.5
    assert time_to_contact(post(0.2, 0.0), FULL, HUSKY, start=on) == math.inf
    under = Pose2(x_m=0.55, y_m=0.0, yaw_rad=0.0)
    assert time_to_contact(ahead, FULL, HUSKY, start=under) == 0.0


def seen_points(frame: Frame, profile: RobotProfile = HUSKY) -> NearPoints:
    """The obstacle points of one frame."""
    return RecentObstacles().after(frame, profile).points


def test_images_give_the_points_of_objects_higher_than_10_cm() -> None:
    low, high = (
        seen_points(picture(Box(x=(1.5, 2.0), y=(-0.3, 0.3), z=(0, top))), HUSKY)
        for top in (0.08, 0.4)
    )
    assert len(low) == 0
    assert len(high) > 50
    assert high[:, 0].min() == pytest.approx(1.5, abs=0.02)
    assert np.abs(high[:, 1]).max() == pytest.approx(0.3, abs=0.03)


def test_what_a_robot_passes_under_is_an_obstacle_to_a_taller_one_alone() -> None:
    bar = picture(Box(x=(2.2, 2.3), y=(-0.5, 0.5), z=(1.05, 1.2)))
    assert len(seen_points(bar, HUSKY)) == 0
    assert len(seen_points(bar, dataclasses.replace(HUSKY, height_m=1.0))) > 20


@pytest.mark.parametrize("fill", [math.nan, math.inf, -1.0, 0.0])
def test_an_image_without_depth_gives_no_points(fill: float) -> None:
    frame = picture()
    assert (
        len(
            seen_points(
                dataclasses.replace(frame, depth_m=np.full_like(frame.depth_m, fill)), HUSKY
            )
        )
        == 0
    )


def at(x_m: float) -> Pose2:
    return Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)


def test_an_obstacle_out_of_sight_stays_until_it_is_in_view_again_or_old() -> None:
    thin = Box(x=(1.5, 1.6), y=(-0.33, -0.25), z=(0, 1.0))  # before the front's right corner
    near = RecentObstacles().after(picture(thin), HUSKY)
    for number in range(1, 20):
        near = near.after(
            picture(thin, pose=at(0.05 * number), stamp_ns=number * 100_000_000), HUSKY
        )
    blind = seen_points(picture(thin, pose=at(0.95)), HUSKY)
    front = near.points[(near.points[:, 0] < 0.62) & (near.points[:, 1] < -0.2)]
    assert len(blind) < len(near.points)
    assert len(front) > 20 and front[:, 0].min() == pytest.approx(1.5 - 0.95, abs=0.02)
    assert time_to_contact(near.points, FULL, HUSKY) < 0.06
    in_view = near.after(picture(pose=at(-0.5), stamp_ns=2_000_000_000), HUSKY)
    assert len(in_view.points) == 0
    assert (
        len(near.after(picture(pose=at(0.95), stamp_ns=1_900_000_000 + MEMORY_NS), HUSKY).points)
        == 0
    )


def approached(*boxes: Box) -> RecentObstacles:
    """What is known of boxes before a robot that has come up to them."""
    near = RecentObstacles()
    for number in range(20):
        near = near.after(
            picture(*boxes, pose=at(0.05 * number), stamp_ns=number * 100_000_000), HUSKY
        )
    return near


BODY = Box(x=(1.55, 1.8), y=(-0.2, 0.2), z=(0.0, 1.4))
"""What a person who stands before the robot at the end covers; the feet are out of sight."""
RAIL = Box(x=(1.5, 1.52), y=(-0.2, 0.2), z=(0.0, 0.21))
"""Thin, and little higher than a slice: a look past a top that it has not would miss it."""
CASE = Box(x=(1.5, 1.55), y=(-0.2, 0.2), z=(0.0, 0.2))
"""Out of sight before the shins of the person."""
LOW = Box(x=(1.5, 1.55), y=(-0.2, 0.2), z=(0.0, 0.25))
"""Lower than the camera sees there."""


@pytest.mark.parametrize(
    ("before", "after", "contact"),
    [
        ((BODY,), (), False),  # the person has walked away, the feet with the rest
        ((BODY,), (BODY,), True),
        ((LOW,), (), True),  # a low thing may be there still
        ((RAIL,), (RAIL,), True),
        ((BODY, CASE), (CASE,), True),
        ((BODY, LOW), (LOW,), True),
        ((Box(x=(1.55, 1.8), y=(-0.2, 0.2), z=(0.8, 1.4)), LOW), (LOW,), True),  # an arm above it
    ],
)
def test_what_stood_upright_has_gone_with_its_upper_part_and_what_is_low_has_not(
    before: tuple[Box, ...], after: tuple[Box, ...], contact: bool
) -> None:
    near = approached(*before)
    assert time_to_contact(near.points, FULL, HUSKY) < 0.3
    for number in (20, 21):
        near = near.after(picture(*after, pose=at(0.95), stamp_ns=number * 100_000_000), HUSKY)
    assert (time_to_contact(near.points, FULL, HUSKY) < 0.3) == contact


def test_an_upper_part_without_depth_says_nothing_of_what_stands_below() -> None:
    near, blind = approached(BODY), picture(pose=at(0.95), stamp_ns=2_000_000_000)
    blind = dataclasses.replace(blind, depth_m=np.full_like(blind.depth_m, np.nan))
    assert time_to_contact(near.after(blind, HUSKY).points, FULL, HUSKY) < 0.3


def test_of_a_wall_out_of_sight_its_shape_is_remembered_and_not_each_pixel() -> None:
    rng = np.random.default_rng(2)
    wall = np.column_stack([rng.normal(-1.2, 0.01, 50_000), rng.uniform(-1.0, 1.0, 50_000)])
    near = RecentObstacles(
        points=wall.astype(np.float32),
        seen_ns=np.zeros(50_000, dtype=np.int64),
        tops_m=np.zeros(50_000, dtype=np.float32),
        pose=at(0.0),
    )
    later = near.after(picture(stamp_ns=100_000_000), HUSKY)
    fine = dataclasses.replace(DEFAULT_SAFETY.collision, memory_cell_m=0.002)
    assert 500 < len(later.points) < 8_000
    assert len(near.after(picture(stamp_ns=100_000_000), HUSKY, fine).points) > 25_000
    for asked in (Twist(v_mps=-0.8, w_radps=0.0), Twist(v_mps=-0.7, w_radps=0.6)):
        contacts_s = [time_to_contact(one.points, asked, HUSKY) for one in (near, later)]
        assert contacts_s[0] < 1.0
        assert contacts_s[1] == pytest.approx(contacts_s[0], abs=0.03)


@law(300)
@given(st.floats(0.0, 0.9), st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.floats(0.0, 0.5))
def test_the_allowed_speed_stops_within_the_distance_that_is_left(
    contact_s: float, v: float, w: float, age_s: float
) -> None:
    asked = Twist(v_mps=v, w_radps=w)
    share = allowed_share(contact_s, asked, frame_age_s=age_s, profile=HUSKY)
    assert 0.0 <= share <= 1.0
    # In seconds of driving at the asked velocity: late, then braking, from the share that is
    # driven.
    late_s = max(0.25 - age_s, 0.15)
    needed_s = share * late_s + share**2 * braking_s(asked, HUSKY) / 2
    assert needed_s <= contact_s + 1e-9 or share == 1.0
    if share == 1.0:
        assert contact_s >= late_s + braking_s(asked, HUSKY) / 2 - 1e-9


def test_the_gate_slows_down_before_an_obstacle_and_stops_at_it_with_the_reason() -> None:
    free, nearer, at_it = (
        judged(post(FRONT_M + AHEAD_M + gap_m, 0.0), FULL, sent=STANDSTILL)
        for gap_m in (0.6, 0.1, 0.004)
    )
    assert free.twist.v_mps == pytest.approx(0.15)  # as the acceleration allows
    assert (free.reasons, nearer.reasons) == ((), ())
    crawling = judged(post(FRONT_M + AHEAD_M + 0.1, 0.0), FULL, sent=Twist(v_mps=0.3, w_radps=0.0))
    assert 0.2 < crawling.twist.v_mps < 0.4
    assert at_it.twist == STANDSTILL
    assert [reason.cause for reason in at_it.reasons] == [Cause.CONTACT_IMMINENT]
    assert at_it.reasons[0].text.startswith("There is an obstacle 0.00 m ahead")
    back = judged(post(-FRONT_M - AHEAD_M - 0.004, 0.0), Twist(v_mps=-0.5, w_radps=0.0))
    assert back.reasons[0].text.startswith("There is an obstacle 0.00 m behind")


def test_without_the_image_the_gate_would_drive_on() -> None:
    """Control of the test above."""
    assert judged(NO_POINTS, FULL).twist == FULL


def test_contact_is_worse_than_a_sensor_and_less_than_the_stop() -> None:
    order = list(Cause)
    worst = [
        Cause.EMERGENCY_STOP,
        Cause.CONTACT_IMMINENT,
        Cause.STALE_FRAME,
        Cause.PLANNER_FAILED,
        Cause.NO_PATH,
    ]
    assert worst == sorted(worst, key=order.index)
    assert max(
        map(
            order.index,
            (Cause.STUCK_CAMERA, Cause.BAD_STAMP, Cause.POSE_JUMP, Cause.WHEELS_BLOCKED),
        )
    ) < order.index(Cause.BAD_COMMAND)


def test_points_beyond_the_range_are_no_worse_than_others() -> None:
    """The range is that of the depth; a point may lie farther from the robot's middle."""
    near = RecentObstacles()
    for number, x_m in enumerate((2.4, 2.45, 2.5, 2.6, 2.7, 2.8)):
        wide = Box(x=(x_m, x_m + 0.1), y=(-4.0, 4.0), z=(0.0, 3.0))
        near = near.after(picture(wide, stamp_ns=number * 100_000_000), HUSKY)
        assert len(near.tops_m) == len(near.points) == len(near.seen_ns)
        assert np.isfinite(near.tops_m).all() and near.tops_m.max(initial=0.0) < 1.6
