"""Driving by hand: within the limits, under the safety gate, and never for long."""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from typing import Any

import numpy as np
import pytest

from app.runtime.control.robot_controller import RobotController
from navcore.config.safety import DEFAULT_SAFETY, GateConfig, SafetyConfig
from navcore.geometry.transform import IDENTITY, STANDSTILL, Pose2, Twist
from navcore.localisation.estimate import LocalisationState
from navcore.mission.zone import Zone, ZoneKind
from navcore.robot.driver import Command
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import Cause, GateDecision, GateInput, gate
from tests.app.runtime.control.controlled import causes, command, controller, think
from tests.navcore.scene import Box, picture
from tests.navcore.ticks import OPEN, SECOND

BY_HAND = Twist(v_mps=0.3, w_radps=0.0)


def pushed(driver: RobotController, twist: Twist = BY_HAND) -> RobotController:
    """Teleoperation at the moment of the frame."""
    hand = Command(twist=twist, stamp_ns=SECOND)
    driver.change(lambda intent: dataclasses.replace(intent, by_hand=hand))
    return driver


def facts_of_gate(monkeypatch: pytest.MonkeyPatch) -> list[GateInput]:
    """What the gate decides by from now on, the newest last."""
    found: list[GateInput] = []

    def noted(facts: GateInput, **given: Any) -> GateDecision:
        found.append(facts)
        return gate(facts, **given)

    monkeypatch.setattr("app.runtime.control.robot_controller.gate", noted)
    return found


def test_teleoperation_moves_the_robot_within_the_limits_and_its_command_expires() -> None:
    driver = controller()
    think(driver)
    assert command(pushed(driver)).twist.v_mps == pytest.approx(HUSKY.max_accel_mps2 * 0.05)
    assert command(driver, after_s=0.2).twist.v_mps == BY_HAND.v_mps
    late = command(driver, after_s=0.26)
    assert late.twist == STANDSTILL and late.reasons == ()


def test_without_expiry_of_teleoperation_and_gate_the_robot_rolls_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The control of the test above."""
    monkeypatch.setattr("app.runtime.control.robot_controller.HAND_LIFE_NS", 10**15)
    endless = SafetyConfig(gate=GateConfig(command_life_s=1e6))
    monkeypatch.setattr("app.runtime.control.robot_controller.gate", partial(gate, config=endless))
    driver = controller()
    think(driver)
    assert command(pushed(driver), after_s=0.4).twist.v_mps > 0


def test_teleoperation_does_not_overrule_the_gate_nor_a_mission_that_drives() -> None:
    stopped = pushed(controller())
    think(stopped)
    stopped.change(lambda intent: dataclasses.replace(intent, stopped_by="test"))
    assert causes(command(stopped)) == [Cause.EMERGENCY_STOP] and stopped.sent == STANDSTILL
    wall = controller()
    think(wall, picture(Box(x=(0.53, 1.0), y=(-2, 2), z=(0, 1)), stamp_ns=SECOND))
    assert causes(command(pushed(wall))) == [Cause.CONTACT_IMMINENT] and wall.sent == STANDSTILL
    driving = controller((3.0, 0.0))
    think(driving)
    command(pushed(driving, Twist(v_mps=-0.3, w_radps=0.0)))
    assert driving.sent.v_mps > 0


@pytest.mark.parametrize(("repeats", "wall_m"), [(True, 1.6), (False, 2.0)])
def test_before_a_frozen_camera_a_wall_stays_where_it_was_seen(
    monkeypatch: pytest.MonkeyPatch, repeats: bool, wall_m: float
) -> None:
    found = facts_of_gate(monkeypatch)
    fast, driver = Twist(v_mps=1.0, w_radps=0.0), pushed(controller())
    wall = picture(Box(x=(2.0, 2.4), y=(-2, 2), z=(0, 1)), twist=fast)
    for step in range(5):
        frame = dataclasses.replace(
            wall,
            stamp_ns=SECOND + (step - 4) * 100_000_000,
            pose=Pose2(x_m=0.1 * step, y_m=0.0, yaw_rad=0.0),
        )
        if not repeats:  # the control: images that show the wall as far away as before
            depth_m = wall.depth_m * np.float32(1 + 1e-4 * step)
            frame = dataclasses.replace(frame, depth_m=depth_m, rgb=wall.rgb ^ np.uint8(step))
        driver.command(lambda now_ns=frame.stamp_ns: now_ns, 0.05, newest=frame)  # type: ignore[misc]
    assert np.median(found[-1].obstacles[:, 0]) == pytest.approx(wall_m, abs=0.02)


def test_the_gate_decides_by_where_the_robot_has_driven_since_the_image(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = facts_of_gate(monkeypatch)
    driver = controller()
    think(driver)
    pushed(driver, Twist(v_mps=0.5, w_radps=0.5))
    for number in range(4):
        command(driver, after_s=0.05 * number)
    assert found[0].moved == IDENTITY
    for facts in found:
        assert facts.keep_outs.pose == facts.moved
    moved, sent = found[-1].moved, driver.sent
    assert 0.02 < moved.x_m < 0.15 * sent.v_mps and 0.02 < moved.yaw_rad < 0.15 * sent.w_radps


def malformed(frame: Frame, what: str) -> Frame:
    if what == "covered":
        return dataclasses.replace(frame, depth_m=np.zeros_like(frame.depth_m))
    if what == "unmounted":
        return dataclasses.replace(frame, T_base_camera=np.full((4, 4), -math.inf))
    return dataclasses.replace(frame, depth_m=frame.depth_m[:3])


@pytest.mark.parametrize("what", ["covered", "unmounted", "cut"])
def test_teleoperation_stops_at_a_malformed_frame_and_recent_obstacles_are_kept(what: str) -> None:
    corner = Box(x=(1.5, 1.6), y=(-0.33, -0.25), z=(0, 1.0))
    driver = pushed(controller())
    assert (
        driver.command(lambda: SECOND, 0.05, newest=picture(corner, stamp_ns=SECOND)).twist.v_mps
        > 0
    )
    near = driver._recent_obstacles
    verdict = driver.command(
        lambda: SECOND + 1, 0.05, newest=malformed(picture(stamp_ns=SECOND + 1), what)
    )
    assert (verdict.twist, causes(verdict)) == (STANDSTILL, [Cause.BAD_FRAME])
    assert driver._recent_obstacles is near and len(near.points)
    assert (
        driver.command(
            lambda: SECOND + 2, 0.05, newest=picture(corner, stamp_ns=SECOND + 2)
        ).twist.v_mps
        > 0
    )


@pytest.mark.parametrize("x_m", [math.nan, math.inf])
def test_a_pose_that_is_not_finite_is_told_as_the_reason_by_hand_too(x_m: float) -> None:
    driver = controller()
    think(driver)
    pose, stamp_ns = Pose2(x_m=x_m, y_m=0.0, yaw_rad=x_m), SECOND + 100_000_000
    bad = dataclasses.replace(picture(stamp_ns=stamp_ns), pose=pose)
    verdict = pushed(driver).command(lambda: stamp_ns, 0.05, newest=bad)
    assert (verdict.twist, causes(verdict)) == (STANDSTILL, [Cause.BAD_FRAME])
    driver._found = None
    assert [reason.cause for reason in driver.reasons(stamp_ns)] == [Cause.BAD_FRAME]


def test_teleoperation_is_held_before_a_beware_area_with_the_reason() -> None:
    near = Zone(id="z", name="near", polygon=((0.6, -1.0), (1.5, -1.0), (1.5, 1.0), (0.6, 1.0)))
    driver = controller()
    driver.change(lambda intent: dataclasses.replace(intent, zones=(near,)))
    think(driver)
    assert causes(command(pushed(driver))) == [Cause.BEWARE_AHEAD] and driver.sent == STANDSTILL
    assert command(pushed(driver, Twist(v_mps=-0.2, w_radps=0.0))).twist.v_mps < 0


def test_a_command_that_expires_while_the_gate_decides_is_not_sent() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    assert command(driver, 0.1).twist != STANDSTILL
    life_ns = DEFAULT_SAFETY.gate.command_life_ns
    times = iter([SECOND + life_ns - 1, SECOND + life_ns + 1])  # before and after a slow check
    verdict = driver.command(lambda: next(times), 0.05, newest=OPEN)
    assert verdict.twist == STANDSTILL and verdict.reasons[0].cause is Cause.STALE_COMMAND


def test_a_reset_keeps_obstacles_out_of_view_unless_the_pose_had_jumped() -> None:
    driver = controller((3.0, 0.0))
    wall = picture(Box(x=(1.2, 1.4), y=(-1.0, 1.0), z=(0, 1)), stamp_ns=SECOND)
    driver.command(lambda: SECOND, 0.05, newest=wall)
    before = len(driver._recent_obstacles.points)
    driver.trust_pose()
    assert len(driver._recent_obstacles.points) == before > 0
    away = Pose2(x_m=5.0, y_m=0.0, yaw_rad=0.0)
    driver.command(lambda: 2 * SECOND, 0.05, newest=wall)
    driver.command(
        lambda: 2 * SECOND, 0.05, newest=picture(stamp_ns=SECOND + 100_000_000, pose=away)
    )
    assert driver.sensors_in_doubt
    driver.trust_pose()
    assert len(driver._recent_obstacles.points) == 0 and not driver.sensors_in_doubt


NEAR = Zone(id="z", name="near", polygon=((0.6, -1.0), (1.5, -1.0), (1.5, 1.0), (0.6, 1.0)))


@pytest.mark.parametrize("ticked_before", [False, True])
def test_a_zone_holds_teleoperation_before_the_first_tick_and_when_ticks_fail(
    ticked_before: bool,
) -> None:
    driver = controller()
    if ticked_before:
        think(driver)
    driver.change(lambda intent: dataclasses.replace(intent, zones=(NEAR,)))
    driver.note_failure(OPEN, RuntimeError("no weights"))
    ahead = pushed(driver).command(lambda: SECOND, 0.05, newest=OPEN)
    assert ahead.twist == STANDSTILL and Cause.BEWARE_AHEAD in causes(ahead)
    back = pushed(driver, Twist(v_mps=-0.2, w_radps=0.0)).command(lambda: SECOND, 0.05, newest=OPEN)
    assert back.twist.v_mps < 0 and Cause.BEWARE_AHEAD not in causes(back)


@pytest.mark.parametrize("sigma_m", [0.0, 0.1])
def test_by_hand_a_zone_is_kept_by_the_uncertainty_of_the_position_too(sigma_m: float) -> None:
    """Two decimetres ahead are free only for a robot
    that knows where it is."""
    zone = Zone(id="z", name="edge", polygon=((0.73, -1.0), (1.5, -1.0), (1.5, 1.0), (0.73, 1.0)))
    driver = controller()
    think(driver)
    driver.change(lambda intent: dataclasses.replace(intent, zones=(zone,)))
    covariance = np.diag([sigma_m**2, sigma_m**2, 0.0])
    driver.navigator.place = dataclasses.replace(driver.place, covariance=covariance)
    driver._tick_state = dataclasses.replace(
        driver.tick_state, zone_covariances={"z": covariance[:2, :2]}
    )
    verdict = command(pushed(driver, Twist(v_mps=0.2, w_radps=0.0)))
    if sigma_m:
        assert verdict.twist == STANDSTILL and causes(verdict) == [Cause.BEWARE_AHEAD]
    else:
        assert verdict.twist.v_mps > 0.0
    for _ in range(2):  # the wheels stop before they turn the other way
        verdict = command(pushed(driver, Twist(v_mps=-0.2, w_radps=0.0)))
    assert verdict.twist.v_mps < 0.0


def test_a_lost_robot_is_driven_by_hand_wherever_the_zones_were() -> None:
    """It is not where it takes itself to be, and has to be driven to find its place."""
    driver = controller()
    think(driver)
    driver.change(lambda intent: dataclasses.replace(intent, zones=(NEAR,)))
    place = driver.place
    for state, is_searched, is_held in (
        (LocalisationState.LOCATED, False, True),
        (LocalisationState.AMBIGUOUS, False, True),  # at a start, where it may be right
        (LocalisationState.AMBIGUOUS, True, False),
        (LocalisationState.LOST, False, False),
    ):
        driver.navigator.place = dataclasses.replace(place, state=state, is_searched=is_searched)
        verdict = pushed(driver).command(lambda: SECOND, 0.05, newest=OPEN)
        assert (Cause.BEWARE_AHEAD in causes(verdict)) is is_held
        assert (verdict.twist.v_mps > 0) is not is_held


def test_a_speed_limit_holds_for_teleoperation_too() -> None:
    limit = dataclasses.replace(NEAR, polygon=((-2.0, -2.0), (3.0, -2.0), (3.0, 2.0), (-2.0, 2.0)))
    limit = dataclasses.replace(limit, kind=ZoneKind.SPEED_LIMIT, max_speed_mps=0.1)
    for zones, fastest in (((limit,), 0.1), ((), 0.5)):
        driver = pushed(controller(), Twist(v_mps=0.5, w_radps=0.2))
        driver.change(lambda intent, zones=zones: dataclasses.replace(intent, zones=zones))  # type: ignore[misc]
        think(driver)
        for _ in range(10):
            sent = command(driver).twist
        assert sent.v_mps == pytest.approx(fastest) and sent.w_radps == pytest.approx(0.4 * fastest)
