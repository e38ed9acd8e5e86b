"""Speed limits: kept while any part of the robot is in the zone, reached before it is, and counted
in travel times."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from navcore.config.control import LocalPlannerConfig, SpeedLimitConfig
from navcore.control.motion import ControllerState, Motion
from navcore.control.speed_limits import allowed_speed_mps, slowed, travel_time_s
from navcore.geometry.polyline import length_m
from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import GridSpec
from navcore.mission.zone import Zone, ZoneKind, zone_masks
from navcore.robot.profile import HUSKY

LOCAL, LATENCY_S = LocalPlannerConfig(), SpeedLimitConfig().latency_s
SLOW = Zone(
    id="s",
    name="s",
    polygon=((2.0, -2.0), (4.0, -2.0), (4.0, 2.0), (2.0, 2.0)),
    kind=ZoneKind.SPEED_LIMIT,
    max_speed_mps=0.25,
)


def at(x_m: float, y_m: float = 0.0, yaw_rad: float = 0.0) -> Pose2:
    return Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


def test_the_limit_holds_while_any_part_of_the_footprint_touches_the_zone() -> None:
    nose = 2.0 - HUSKY.length_m / 2
    for pose in (
        at(3.0),
        at(nose + 0.01),
        at(4.0 + HUSKY.length_m / 2 - 0.01),
        at(3.0, 2.0 + HUSKY.width_m / 2 - 0.01),
    ):
        assert allowed_speed_mps([SLOW], pose, 0.25, HUSKY, LOCAL) == 0.25
    assert allowed_speed_mps([SLOW], at(nose - 0.5), 0.25, HUSKY, LOCAL) > 0.25
    for free in (
        dataclasses.replace(SLOW, enabled=False),
        dataclasses.replace(SLOW, kind=ZoneKind.KEEP_OUT, max_speed_mps=None),
    ):
        assert allowed_speed_mps([free], at(3.0), 0.25, HUSKY, LOCAL) == math.inf


def test_a_robot_that_obeys_is_slow_enough_when_it_comes_to_the_zone() -> None:
    """Simulated with the latency and the deceleration that speeds are planned with; without
    anticipation it would be too fast."""
    x_m, speed, obeyed = 0.0, 1.0, [1.0] * round(LATENCY_S / 0.01)
    while x_m + HUSKY.length_m / 2 < 2.0:
        obeyed.append(min(1.0, allowed_speed_mps([SLOW], at(x_m), speed, HUSKY, LOCAL)))
        speed = max(obeyed[-1 - round(LATENCY_S / 0.01)], speed - LOCAL.braking_mps2 * 0.01)
        x_m += speed * 0.01
    assert speed <= 0.25 + 0.02


def test_a_slowed_motion_keeps_its_arc_and_a_turn_in_place_its_rate() -> None:
    motion = slowed(
        Motion(twist=Twist(v_mps=1.0, w_radps=0.4), outcome=ControllerState.FOLLOW), 0.25
    )
    assert motion.twist.v_mps == 0.25 and motion.twist.w_radps == pytest.approx(0.1)
    assert (
        slowed(
            Motion(twist=Twist(v_mps=-1.0, w_radps=0.0), outcome=ControllerState.BACK), 0.25
        ).twist.v_mps
        == -0.25
    )
    turn = Motion(twist=Twist(v_mps=0.0, w_radps=0.9), outcome=ControllerState.TURN)
    assert slowed(turn, 0.25) is turn


def test_a_limit_closes_no_cell_and_lengthens_the_travel_time_through_it() -> None:
    spec = GridSpec.centred(size_m=(10.0, 10.0), resolution_m=0.1)
    assert not zone_masks([SLOW], spec)[0].any()
    route = np.column_stack([np.linspace(-5.0, 5.0, 101), np.zeros(101)])
    free, limited = (travel_time_s(route, zones, HUSKY) for zones in ([], [SLOW]))
    inside_m = 2.0 + 2 * HUSKY.circumscribed_radius_m
    assert free == pytest.approx(10.0 / HUSKY.max_speed_mps, rel=0.01)
    assert limited - free == pytest.approx(inside_m * (1 / 0.25 - 1 / HUSKY.max_speed_mps), rel=0.1)
    zigzag = np.column_stack([np.linspace(-5.0, 5.0, 101), np.tile([0.0, 0.1], 51)[:101]])
    assert travel_time_s(zigzag, [], HUSKY) == pytest.approx(
        length_m(zigzag) / HUSKY.max_speed_mps
    ), "of two paths the longer one takes longer, whatever their bends"
