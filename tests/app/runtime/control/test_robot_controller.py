"""The robot controller: from a frame to the command for the wheels."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from app.console.status_message import stands_in_zone
from app.runtime.control.background import InlineBackground
from app.runtime.control.map_requests import MapRequests
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from navcore.behaviours.supervisor import Behaviour
from navcore.config.navigator import NavigatorConfig
from navcore.config.safety import DEFAULT_SAFETY, GateConfig, SafetyConfig
from navcore.control.motion import ControllerState, Motion
from navcore.costmap.costmap import Costmap
from navcore.errors import BadConfiguration, BadFrame, Refused
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.cell_mask import CellMask
from navcore.grid.nearest import nearest_free
from navcore.localisation.estimate import LocalisationState
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.erasing import Erasable
from navcore.mission.mission import Mission, Phase
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone, ZoneKind
from navcore.navigator import Navigator, Stages
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.planning.path import NoPath, Path, Reason
from navcore.robot.driver import Command
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import Cause, GateDecision, gate
from tests.navcore.scene import RED_LIST, SPEC, Box, Paint, picture

SECOND = 1_000_000_000
OPEN = picture(stamp_ns=SECOND)
NAN = dataclasses.replace(OPEN, depth_m=np.full_like(OPEN.depth_m, math.nan))
ACROSS = Zone(id="z", name="across", polygon=((1.5, -7.9), (2.0, -7.9), (2.0, 7.9), (1.5, 7.9)))
HALL = Zone(
    id="hall",
    name="hall",
    kind=ZoneKind.STAY_INSIDE,
    polygon=((-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0)),
)
"""Without a boundary the map grows, and the path runs round the zone."""


def navigator(stages: Stages | None = None) -> Navigator:
    return Navigator(
        spec=SPEC,
        profile=HUSKY,
        segmenter=ColourSegmenter(),
        config=NavigatorConfig(),
        stages=stages,
    )


def controller(*goals: tuple[float, float], stages: Stages | None = None) -> RobotController:
    mission = Mission()
    for x, y in goals:
        mission = mission.add(x, y, SPEC)
    intent = OperatorState(mission=mission.start() if goals else mission, beware=RED_LIST)
    return RobotController(navigator=navigator(stages), profile=HUSKY, intent=intent)


def think(driver: RobotController, frame: Frame = OPEN) -> None:
    driver.trust_pose()  # each frame is accepted, whatever came before it
    driver.think(frame, clock=lambda: frame.stamp_ns)


def command(driver: RobotController, after_s: float = 0.0) -> GateDecision:
    newest = driver.tick_state.decision.frame if driver.tick_state.decision else None
    return driver.command(lambda: SECOND + round(after_s * SECOND), 0.05, newest=newest)


def causes(verdict: GateDecision) -> list[Cause]:
    return [reason.cause for reason in verdict.reasons]


def test_a_driving_mission_moves_the_robot_towards_its_goal() -> None:
    """Control of every standstill below."""
    driver = controller((3.0, 0.0))
    think(driver)
    verdict = command(driver)
    assert verdict.twist.v_mps > 0
    assert verdict.reasons == ()
    assert driver.sent == verdict.twist


def test_before_the_first_frame_nothing_is_sent_and_the_reason_is_named() -> None:
    verdict = command(controller((3.0, 0.0)))
    assert verdict.twist == STANDSTILL
    assert causes(verdict) == [Cause.STALE_FRAME]


def test_cancel_means_zero_at_the_next_command() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    assert command(driver).twist != STANDSTILL
    driver.change_mission(Mission.cancel)
    assert command(driver).twist == STANDSTILL
    think(driver)
    assert command(driver).twist == STANDSTILL


def test_a_cancel_during_the_tick_means_zero_although_the_tick_ends_later() -> None:
    driver = controller((3.0, 0.0))

    def cancel_then_date() -> int:
        driver.change_mission(Mission.cancel)
        return SECOND

    driver.think(OPEN, clock=cancel_then_date)
    assert command(driver).twist == STANDSTILL


def test_a_velocity_decided_for_a_cancelled_goal_is_not_sent_under_the_next() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    driver.change_mission(lambda mission: mission.cancel().add(-3.0, 0.0, SPEC).start())
    assert command(driver, 0.1).twist == STANDSTILL


def test_a_velocity_decided_before_a_zone_was_drawn_is_not_sent_after() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    here = dataclasses.replace(ACROSS, polygon=((0.55, -1.0), (1.5, -1.0), (1.5, 1.0), (0.55, 1.0)))
    driver.change(lambda intent: dataclasses.replace(intent, zones=(here,)))
    assert command(driver, 0.1).twist == STANDSTILL


def test_pause_and_stop_mean_zero_with_their_reason_and_resume_drives_on() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    driver.change_mission(Mission.pause)
    assert (command(driver).twist, causes(command(driver))) == (STANDSTILL, [Cause.PAUSED])
    driver.change_mission(Mission.resume)
    think(driver)
    assert command(driver).twist != STANDSTILL
    driver.change(lambda intent: dataclasses.replace(intent, stopped_by="ann"))
    assert (command(driver).twist, causes(command(driver))) == (STANDSTILL, [Cause.EMERGENCY_STOP])


def test_a_stale_command_and_a_stale_frame_mean_zero() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    assert command(driver, 0.25).twist != STANDSTILL
    assert (command(driver, 0.26).twist, causes(command(driver, 0.26))) == (
        STANDSTILL,
        [Cause.STALE_COMMAND],
    )
    assert causes(command(driver, 0.6)) == [Cause.STALE_FRAME, Cause.STALE_COMMAND]


def test_a_command_decided_while_the_clock_was_read_is_fresh_and_one_from_the_future_is_not() -> (
    None
):
    driver = controller((3.0, 0.0))
    think(driver)
    assert command(driver, -0.05).reasons == ()
    driver.command(lambda: 2 * SECOND, 0.05, newest=OPEN)
    assert Cause.STALE_COMMAND in causes(command(driver, -0.2))


def test_an_arrived_goal_gives_way_to_the_next_and_the_last_ends_the_mission() -> None:
    driver = controller((0.05, 0.0), (3.0, 0.0))
    think(driver)
    assert [goal.id for goal in driver.intent.mission.reached] == [1]
    assert driver.intent.mission.goal is not None
    think(driver)
    assert command(driver).twist.v_mps > 0
    think(driver, picture(pose=Pose2(x_m=3.0, y_m=0.05, yaw_rad=0.0), stamp_ns=SECOND))
    assert [goal.id for goal in driver.intent.mission.reached] == [1, 2]
    assert driver.intent.mission.phase is Phase.IDLE
    assert command(driver).twist == STANDSTILL


def test_without_a_path_the_robot_has_not_arrived_whatever_the_local_planner_says() -> None:
    arrived = Motion(twist=STANDSTILL, outcome=ControllerState.ARRIVED)
    driver = controller((3.0, 0.0), stages=Stages(control=lambda *_: arrived))
    driver.change(lambda intent: dataclasses.replace(intent, zones=(ACROSS, HALL)))
    think(driver)
    before = len(driver.intent.mission.reached)
    driver.change(lambda intent: dataclasses.replace(intent, zones=()))
    think(driver)  # control: with a path the same motion ends the mission
    assert (before, len(driver.intent.mission.reached)) == (0, 1)


def test_a_robot_that_rolls_over_its_goal_has_not_arrived() -> None:
    driver = controller((0.05, 0.0))
    think(driver, dataclasses.replace(OPEN, twist=Twist(v_mps=0.5, w_radps=0.0)))
    assert driver.intent.mission.reached == ()
    assert driver.intent.mission.phase is Phase.DRIVING


def test_a_corrected_pose_moves_its_points_at_the_next_tick_and_an_unknown_one_is_refused() -> None:
    driver = controller()
    wall = picture(Box(x=(2.0, 2.2), y=(-1.0, 1.0), z=(0.0, 1.0)), stamp_ns=SECOND)
    think(driver, wall)
    before = driver.navigator.map.points
    with pytest.raises(BadConfiguration, match="pose ID 5 is not on the map, which has 1"):
        driver.correct_poses(
            {0: Pose2(x_m=0.5, y_m=0.0, yaw_rad=0.0), 5: Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)}
        )
    driver.correct_poses({0: Pose2(x_m=0.0, y_m=0.5, yaw_rad=0.0)})
    # A frame from elsewhere, so that the old pose's points are not replaced.
    think(driver, picture(stamp_ns=2 * SECOND, pose=Pose2(x_m=-4.0, y_m=0.0, yaw_rad=math.pi)))
    after = driver.navigator.map.points
    moved = after.pose_ids == 0
    assert moved.sum() == len(before.points_map) > 0
    np.testing.assert_allclose(
        np.sort(after.points_map[moved, 1]),
        np.sort(before.points_map[:, 1] + np.float32(0.5)),
        atol=1e-5,
    )


def test_a_pose_of_a_loaded_map_is_refused() -> None:
    driver = controller()
    think(driver, picture(Box(x=(2.0, 2.2), y=(-1.0, 1.0), z=(0.0, 1.0)), stamp_ns=SECOND))
    driver.navigator.map.restore(driver.navigator.map.state())
    with pytest.raises(BadConfiguration, match="pose ID 0 belongs to the loaded map"):
        driver.correct_poses({0: Pose2(x_m=0.0, y_m=0.5, yaw_rad=0.0)})


def test_poses_that_were_taken_back_meanwhile_keep_nothing_else_from_being_done() -> None:
    driver, shown = controller(), Pose2(x_m=1.0, y_m=2.0, yaw_rad=0.0)
    think(driver, picture(Box(x=(2.0, 2.2), y=(-1.0, 1.0), z=(0.0, 1.0)), stamp_ns=SECOND))
    driver.correct_poses({0: Pose2(x_m=0.0, y_m=0.5, yaw_rad=0.0)})
    driver.navigator.map.restore(driver.navigator.map.state())
    driver.place_robot(shown, np.eye(3))
    think(driver, picture(stamp_ns=2 * SECOND))
    assert driver.place.T_map_base.distance_to(shown.x_m, shown.y_m) < 0.01


JUMPED = Pose2(x_m=5.0, y_m=0.0, yaw_rad=0.0)
NOWHERE = Pose2(x_m=math.nan, y_m=0.0, yaw_rad=0.0)


@pytest.mark.parametrize("refused", [JUMPED, NOWHERE], ids=["jumped", "not a number"])
def test_a_place_that_is_shown_waits_for_a_frame_that_is_believed(refused: Pose2) -> None:
    driver, shown = controller(), Pose2(x_m=1.0, y_m=2.0, yaw_rad=0.5)
    times = [SECOND + 100_000_000 * k for k in range(8)]
    driver.think(picture(stamp_ns=times[0]), clock=lambda: times[0])
    driver.place_robot(shown, 0.01 * np.eye(3))
    bad = dataclasses.replace(picture(stamp_ns=times[1]), pose=refused)
    assert driver.think(bad, clock=lambda: times[1]) is None
    assert driver.place.T_map_base.distance_to(0.0, 0.0) < 0.01
    for k, now in enumerate(times[2:]):  # until odometry is believed again
        seen = picture(stamp_ns=now)  # with the noise of a camera that works
        rgb, depth_m = seen.rgb + np.uint8(k + 1), seen.depth_m * np.float32(1 + 1e-4 * (k + 1))
        driver.think(dataclasses.replace(seen, rgb=rgb, depth_m=depth_m), clock=lambda: SECOND)
    there = driver.place.T_map_base
    assert there.distance_to(shown.x_m, shown.y_m) < 0.01
    assert there.yaw_rad == pytest.approx(shown.yaw_rad)


def test_a_jump_of_odometry_that_is_accepted_leaves_the_place_as_uncertain() -> None:
    driver = controller()
    driver.think(OPEN, clock=lambda: SECOND)
    there = Pose2(x_m=3.0, y_m=0.0, yaw_rad=0.5)
    driver.think(picture(stamp_ns=SECOND + 100_000_000, pose=there), clock=lambda: SECOND)
    assert driver.pose_in_doubt
    driver.trust_pose()
    driver.think(picture(stamp_ns=SECOND + 200_000_000, pose=there), clock=lambda: SECOND)
    assert driver.place.T_map_base.distance_to(there.x_m, there.y_m) < 0.01
    assert driver.place.sigma_along_m(1.0, 0.0) == pytest.approx(3.0, rel=0.05)
    assert math.sqrt(driver.place.covariance[2, 2]) == pytest.approx(0.5, rel=0.1)


def test_a_robot_that_turns_does_not_stand() -> None:
    driver = controller()
    turns = dataclasses.replace(OPEN, twist=Twist(v_mps=0.0, w_radps=0.5))
    driver.command(lambda: SECOND, 0.05, newest=turns)
    with pytest.raises(Refused, match="the robot moves"):
        driver.require_standing()
    stands = picture(stamp_ns=SECOND + 100_000_000)
    driver.command(lambda: SECOND, 0.05, newest=stands)
    driver.require_standing()


def test_an_edit_of_the_map_is_done_before_the_next_tick_also_when_its_frame_is_refused() -> None:
    driver = controller()
    think(driver, picture(Box(x=(2.0, 2.2), y=(-1.0, 1.0), z=(0.0, 1.0)), stamp_ns=SECOND))
    erased: list[int] = []

    def erase(point_map: PointMap) -> None:
        everywhere = np.arange(point_map.spec.rows * point_map.spec.cols)
        erased.append(point_map.edits.erase(everywhere, Erasable.BOTH.class_ids).cells)

    driver.edit_map(erase)
    driver.edit_map(erase)
    assert not erased
    think(driver, picture(stamp_ns=SECOND))  # shows nothing new
    assert erased[0] > 0 and erased[1:] == [0]
    assert len(driver.navigator.map.points.points_map) == 0
    think(driver, picture(stamp_ns=2 * SECOND))
    assert len(erased) == 2


def test_a_goal_that_was_taken_away_during_the_tick_is_not_counted_as_reached() -> None:
    driver = controller((0.05, 0.0), (3.0, 0.0))

    def remove_then_date() -> int:
        driver.change_mission(lambda mission: mission.remove(1))
        return SECOND

    driver.think(OPEN, clock=remove_then_date)
    assert driver.intent.mission.reached == ()
    assert [goal.id for goal in driver.intent.mission.queue] == [2]


def test_a_bad_frame_leaves_the_map_untouched_and_stops_the_robot_with_the_reason() -> None:
    driver = controller((3.0, 0.0))
    think(driver, picture(Box(x=(2, 3), y=(2, 3), z=(0, 1)), stamp_ns=SECOND))
    assert command(driver).twist != STANDSTILL
    before, version, seen = (
        driver.navigator.map.points,
        driver.navigator.map.version,
        driver.navigator.map.explored.seen.bools,
    )
    driver.trust_pose()
    assert driver.think(NAN, clock=lambda: SECOND) is None
    after = driver.navigator.map.points
    np.testing.assert_array_equal(before.points_map, after.points_map)
    np.testing.assert_array_equal(seen, driver.navigator.map.explored.seen.bools)
    assert driver.navigator.map.version == version
    verdict = command(driver)
    assert verdict.twist == STANDSTILL
    assert Cause.BAD_FRAME in causes(verdict)
    assert "non-finite" in verdict.reasons[0].text
    think(driver, picture(stamp_ns=SECOND))
    assert driver.navigator.map.version > version
    assert command(driver).reasons == ()


def test_an_edit_that_is_refused_changes_nothing() -> None:
    driver = controller()
    before = driver.intent
    with pytest.raises(Refused):
        driver.change_mission(Mission.start)
    assert driver.intent is before


def test_a_zone_across_the_path_leaves_no_path_and_the_robot_says_so() -> None:
    driver = controller((5.0, 0.0))
    driver.change(lambda intent: dataclasses.replace(intent, zones=(ACROSS, HALL)))
    think(driver)
    assert (command(driver).twist, causes(command(driver))) == (STANDSTILL, [Cause.NO_PATH])
    driver.change(
        lambda intent: dataclasses.replace(
            intent, zones=(dataclasses.replace(ACROSS, enabled=False), HALL)
        )
    )
    think(driver)
    assert command(driver).twist != STANDSTILL


def test_a_robot_inside_a_zone_stands_and_says_so() -> None:
    driver = controller((3.0, 0.0))
    around = dataclasses.replace(
        ACROSS, polygon=((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))
    )
    driver.change(lambda intent: dataclasses.replace(intent, zones=(around,)))
    think(driver)
    assert command(driver).twist == STANDSTILL
    assert causes(command(driver))


RED_PATCH = Paint(x=(1.6, 2.4), y=(-0.5, 0.5))


def order(
    goal: tuple[float, float] | None = (4.0, 0.0),
    *,
    enabled: bool = True,
    zones: tuple[Zone, ...] = (),
    leave: bool = False,
) -> NavigationRequest:
    return NavigationRequest(
        goal=goal, beware=RED_LIST.edited("red floor", enabled=enabled), zones=zones, leave=leave
    )


def test_the_path_leads_around_a_red_floor_and_across_it_once_the_class_is_off() -> None:
    loop = navigator()
    around = loop.tick(picture(RED_PATCH), order()).route
    across = loop.tick(picture(RED_PATCH), order(enabled=False)).route
    assert around is not None
    assert across is not None
    assert isinstance(around.outcome, Path)
    assert isinstance(across.outcome, Path)
    assert across.outcome.length == 40.0
    assert around.outcome.length > 42.0
    assert np.abs(around.points[:, 1]).max() > 0.8


def test_a_tick_that_refuses_its_frame_has_changed_nothing() -> None:
    loop = navigator()
    with pytest.raises(BadFrame):
        loop.tick(NAN, order())
    assert loop.map.version == 0
    assert not loop.map.explored.seen.bools.any()


def test_without_a_goal_the_robot_looks_and_stands() -> None:
    decision = navigator().tick(picture(Box(x=(2, 3), y=(-1, 1), z=(0, 1))), order(None))
    assert decision.route is None
    assert decision.motion.outcome is ControllerState.IDLE
    assert decision.occupancy.grid.geometric.any()


def test_a_goal_in_a_zone_is_blocked_and_the_path_ends_exactly_at_a_free_one() -> None:
    loop = navigator()
    blocked = loop.tick(OPEN, order((1.75, 0.0), zones=(ACROSS,))).route
    assert blocked is not None
    assert blocked.outcome == NoPath(reason=Reason.GOAL_BLOCKED)
    free = loop.tick(OPEN, order((1.234, 0.567))).route
    assert free is not None
    assert free.points[-1].tolist() == free.waypoints[-1].tolist() == [1.234, 0.567]


def test_planning_a_preview_changes_neither_map_nor_route() -> None:
    loop = navigator()
    decision = loop.tick(OPEN, order())
    everything = np.ones((SPEC.rows, SPEC.cols), dtype=np.bool_)
    walled = Costmap.of(decision.occupancy.grid, everything, version=-1)
    assert loop.preview(walled, OPEN.pose, (3.0, 0.0)).outcome == NoPath(
        reason=Reason.START_BLOCKED
    )
    again = loop.tick(OPEN, order())
    assert again.route is decision.route
    assert again.occupancy is decision.occupancy


def test_a_start_inside_the_inflation_is_moved_to_the_nearest_free_cell_within_reach() -> None:
    blocked = np.zeros((20, 20), dtype=np.bool_)
    blocked[5:12, 5:12] = True
    assert nearest_free(CellMask.of(~blocked), (3, 3), 0.0) == (3, 3)
    assert nearest_free(CellMask.of(~blocked), (8, 6), 2.0) == (8, 4)
    assert nearest_free(CellMask.of(~blocked), (8, 8), 3.9) is None
    assert nearest_free(CellMask.of(~blocked), (8, 8), 4.0) in {(4, 8), (8, 4), (12, 8), (8, 12)}
    assert nearest_free(CellMask.of(~blocked), (-1, 30), 4.0) == (-1, 30)


BY_HAND = Twist(v_mps=0.3, w_radps=0.0)


def pushed(driver: RobotController, twist: Twist = BY_HAND) -> RobotController:
    """Teleoperation at the moment of the frame."""
    hand = Command(twist=twist, stamp_ns=SECOND)
    driver.change(lambda intent: dataclasses.replace(intent, by_hand=hand))
    return driver


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
    near = driver.recent_obstacles
    verdict = driver.command(
        lambda: SECOND + 1, 0.05, newest=malformed(picture(stamp_ns=SECOND + 1), what)
    )
    assert (verdict.twist, causes(verdict)) == (STANDSTILL, [Cause.BAD_FRAME])
    assert driver.recent_obstacles is near and len(near.points)
    assert (
        driver.command(
            lambda: SECOND + 2, 0.05, newest=picture(corner, stamp_ns=SECOND + 2)
        ).twist.v_mps
        > 0
    )


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
    before = len(driver.recent_obstacles.points)
    driver.trust_pose()
    assert len(driver.recent_obstacles.points) == before > 0
    away = Pose2(x_m=5.0, y_m=0.0, yaw_rad=0.0)
    driver.command(lambda: 2 * SECOND, 0.05, newest=wall)
    driver.command(
        lambda: 2 * SECOND, 0.05, newest=picture(stamp_ns=SECOND + 100_000_000, pose=away)
    )
    assert driver.pose_in_doubt
    driver.trust_pose()
    assert len(driver.recent_obstacles.points) == 0 and not driver.pose_in_doubt


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


def test_an_obstacle_that_holds_longer_than_it_is_remembered_begins_the_recovery() -> None:
    """The gate sees what the map does not: the planners would ask for the same motion for good."""
    told: list[tuple[float, bool]] = []

    def noted(behaviour: Behaviour, motion: Motion, **given: Any) -> tuple[Behaviour, Motion]:
        told.append((given["frame"].stamp_ns / SECOND, given["held"]))
        return behaviour, motion

    ahead = Motion(twist=Twist(v_mps=0.5, w_radps=0.0), outcome=ControllerState.FOLLOW)
    driver = controller((3.0, 0.0), stages=Stages(control=lambda *_: ahead, supervise=noted))
    wall = Box(x=(0.53, 0.63), y=(-1.0, 1.0), z=(0, 1.0))
    for tenth in range(10, 90):
        frame = picture(wall, stamp_ns=tenth * SECOND // 10)
        think(driver, frame)
        clock = itertools.repeat(frame.stamp_ns + 1).__next__
        verdict = driver.command(clock, 0.1, newest=frame)
        assert causes(verdict) == [Cause.CONTACT_IMMINENT]
    first_s = next(at_s for at_s, held in told if held)
    assert first_s - 1.0 == pytest.approx(1.0 + DEFAULT_SAFETY.collision.memory_s, abs=0.2)
    assert sum(held for _, held in told) == 1, "then what it tries is judged afresh"


def test_a_robot_that_has_given_up_in_a_margin_can_be_told_to_leave_it() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    decision = driver.tick_state.decision
    assert decision is not None
    motion = Motion(twist=STANDSTILL, outcome=ControllerState.GIVEN_UP)
    for in_margin, cause in ((True, Cause.IN_ZONE), (False, Cause.BOXED_IN)):
        stuck = dataclasses.replace(decision, motion=motion, in_margin=in_margin)
        driver._tick_state = dataclasses.replace(driver.tick_state, decision=stuck)
        assert cause in causes(command(driver))
        assert stands_in_zone(stuck) is in_margin


@pytest.mark.parametrize("state", [ControllerState.BLOCKED, ControllerState.GIVEN_UP])
def test_a_robot_that_only_unseen_floor_holds_says_so(state: ControllerState) -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    assert driver.tick_state.decision is not None
    for unseen in (True, False):
        motion = Motion(twist=STANDSTILL, outcome=state, unseen=unseen)
        stuck = dataclasses.replace(driver.tick_state.decision, motion=motion)
        driver._tick_state = dataclasses.replace(driver.tick_state, decision=stuck)
        (said,) = [one for one in command(driver).reasons if one.cause is Cause.BOXED_IN]
        assert ("has not seen the floor" in said.text) is unseen


def test_a_robot_that_stands_for_a_correction_of_its_place_says_so() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    assert Cause.POSE_UNKNOWN not in causes(command(driver))
    driver._tick_state = dataclasses.replace(driver.tick_state, waits_for_correction=True)
    (said,) = [reason for reason in command(driver).reasons if reason.cause is Cause.POSE_UNKNOWN]
    assert "can be corrected" in said.text


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


def test_of_a_place_and_a_search_that_wait_the_newer_counts() -> None:
    shown = (Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0), np.eye(3))
    placed, searched = MapRequests(place=shown), MapRequests(search=True)
    assert placed.before(searched) == searched
    after = searched.before(placed)
    assert after.place == shown and not after.search
    kept = MapRequests(trust_pose=True).before(MapRequests())
    assert kept.trust_pose and placed.before(MapRequests()).place == shown


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


@pytest.mark.parametrize("accepted", [True, False])
def test_where_a_jump_was_accepted_the_robot_has_free_floor_around_it_as_at_the_start(
    accepted: bool,
) -> None:
    driver = controller((3.0, 0.0))
    driver.think(OPEN, clock=lambda: SECOND)
    there = Pose2(x_m=-5.0, y_m=-5.0, yaw_rad=0.0)
    for late_ns in (100_000_000, 200_000_000):
        elsewhere = picture(
            Paint(x=(5, 6), y=(0, late_ns / 1e9)), stamp_ns=SECOND + late_ns, pose=there
        )
        driver.think(elsewhere, clock=lambda: SECOND)
    assert driver.pose_in_doubt
    if accepted:
        driver.trust_pose()
    else:
        driver._mapped = driver._watched = type(
            driver._mapped
        )()  # the control: trusted, but not reset to this pose
    driver.think(picture(stamp_ns=SECOND + 300_000_000, pose=there), clock=lambda: SECOND)
    known = driver.navigator.map.explored.known(SPEC)
    row, col = SPEC.cell(there.x_m - 0.8, there.y_m)
    assert known[row, col] == accepted


@pytest.mark.parametrize("enters", [True, False])
def test_what_was_computed_or_shown_on_a_map_is_not_taken_for_the_next_one(
    enters: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    class OnOldMap:
        def run(self, is_cancelled: Callable[[], bool]) -> str:
            return "places on the old map"

    background, taken = InlineBackground(), list[object]()
    shown = Pose2(x_m=1.0, y_m=2.0, yaw_rad=0.0)
    driver = RobotController(
        navigator=navigator(),
        profile=HUSKY,
        intent=OperatorState(mission=Mission(), beware=RED_LIST),
        background=background,
    )
    think(driver)
    monkeypatch.setattr(driver.navigator, "take", taken.append)
    monkeypatch.setattr(driver.navigator, "place_robot", lambda *place: taken.append(place[0]))
    background.submit(OnOldMap())
    driver.place_robot(shown, np.eye(3))
    if enters:
        driver.enter_site(lambda intent: intent, lambda: None)
    think(driver)
    assert taken == ([] if enters else ["places on the old map", shown])
