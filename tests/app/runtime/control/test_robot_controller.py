"""The robot controller: from a frame to the command for the wheels."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from app.console.status_message import stands_in_zone
from app.runtime.control.robot_controller import REASONS_NS
from navcore.behaviours.supervisor import Behaviour
from navcore.config.safety import DEFAULT_SAFETY
from navcore.control.motion import ControllerState, Motion
from navcore.errors import Refused
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.mission.mission import Mission, Phase
from navcore.mission.zone import Zone, ZoneKind
from navcore.planning.path import NoPath, Reason
from navcore.safety.gate import Cause, GateDecision, GateInput, gate
from navcore.stages import Stages
from tests.app.runtime.control.controlled import causes, command, controller, forget_frames, think
from tests.navcore.scene import SPEC, Box, picture
from tests.navcore.ticks import ACROSS, NAN, OPEN, SECOND

HALL = Zone(
    id="hall",
    name="hall",
    kind=ZoneKind.STAY_INSIDE,
    polygon=((-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0)),
)
"""Without a boundary the map grows, and the path runs round the zone."""


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


def changed_meanwhile(change: Callable[[], object]) -> Callable[[], int]:
    """A clock that is read before the tick, and after it, when something has changed."""
    reads = itertools.count()

    def read() -> int:
        if next(reads) == 1:
            change()
        return SECOND

    return read


def test_a_cancel_during_the_tick_means_zero_although_the_tick_ends_later() -> None:
    driver = controller((3.0, 0.0))

    driver.think(OPEN, clock=changed_meanwhile(lambda: driver.change_mission(Mission.cancel)))
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


def test_the_pages_read_the_reasons_of_the_newest_command_until_something_changes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    decided = list[int]()

    def counted(facts: GateInput, **given: Any) -> GateDecision:
        decided.append(facts.now_ns)
        return gate(facts, **given)

    monkeypatch.setattr("app.runtime.control.robot_controller.gate", counted)
    driver = controller((3.0, 0.0))
    think(driver)
    verdict = command(driver)
    assert [driver.reasons(SECOND + k * 10_000_000) for k in range(10)] == 10 * [verdict.reasons]
    assert len(decided) == 1
    assert driver.reasons(SECOND + REASONS_NS) == () and len(decided) == 2
    driver.change(lambda intent: dataclasses.replace(intent, stopped_by="test"))
    (stopped,) = driver.reasons(SECOND + REASONS_NS)
    assert stopped.cause is Cause.EMERGENCY_STOP
    driver.note_failure(OPEN, RuntimeError("no weights"))
    assert Cause.PLANNER_FAILED in [one.cause for one in driver.reasons(SECOND + REASONS_NS)]


@pytest.mark.parametrize("state", [LocalisationState.LOST, LocalisationState.AMBIGUOUS])
def test_a_paused_mission_of_a_lost_robot_is_not_said_to_be_what_holds_it(
    state: LocalisationState,
) -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    driver.change_mission(Mission.pause)
    decision = driver.tick_state.decision
    assert decision is not None
    lost = dataclasses.replace(decision, place=LocalisationEstimate(state=state))
    driver._tick_state = dataclasses.replace(driver.tick_state, decision=lost)
    assert causes(command(driver))[0] is Cause.POSE_UNKNOWN
    driver.change_mission(Mission.cancel)
    assert not causes(command(driver))


def test_a_stale_command_and_a_stale_frame_mean_zero() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    assert command(driver, 0.25).twist != STANDSTILL
    assert (command(driver, 0.26).twist, causes(command(driver, 0.26))) == (
        STANDSTILL,
        [Cause.STALE_COMMAND],
    )
    assert causes(command(driver, 0.6)) == [Cause.STALE_FRAME, Cause.STALE_COMMAND]


@pytest.mark.parametrize("blocked_before", [False, True])
def test_wheels_count_as_blocked_after_a_stall_of_the_commands_only_if_they_were_before_it(
    blocked_before: bool,
) -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    stands = dataclasses.replace(OPEN, twist=STANDSTILL)
    driver._sent = driver._sent.after(Twist(v_mps=0.5, w_radps=0.0), SECOND)  # sets off just now
    driver.command(lambda: SECOND, 0.05, newest=stands)
    now_ns = SECOND
    if blocked_before:
        now_ns += DEFAULT_SAFETY.gate.blocked_ns
        assert Cause.WHEELS_BLOCKED in causes(driver.command(lambda: now_ns, 0.05, newest=stands))
    later_ns = now_ns + 3 * SECOND
    verdict = driver.command(lambda: later_ns, 3.0, newest=stands)
    assert (Cause.WHEELS_BLOCKED in causes(verdict)) is blocked_before


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


def test_a_robot_that_turns_does_not_stand() -> None:
    driver = controller()
    turns = dataclasses.replace(OPEN, twist=Twist(v_mps=0.0, w_radps=0.5))
    driver.command(lambda: SECOND, 0.05, newest=turns)
    with pytest.raises(Refused, match="the robot moves"):
        driver.require_standing()
    stands = picture(stamp_ns=SECOND + 100_000_000)
    driver.command(lambda: SECOND, 0.05, newest=stands)
    driver.require_standing()


def test_a_goal_that_was_taken_away_during_the_tick_is_not_counted_as_reached() -> None:
    driver = controller((0.05, 0.0), (3.0, 0.0))

    def remove() -> object:
        return driver.change_mission(lambda mission: mission.remove(1))

    driver.think(OPEN, clock=changed_meanwhile(remove))
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
    forget_frames(driver)
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


def test_a_robot_that_finds_no_way_out_of_an_area_says_so() -> None:
    driver = controller()
    driver.change_mission(Mission.leave)
    around = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    under = dataclasses.replace(ACROSS, polygon=around)
    driver.change(lambda intent: dataclasses.replace(intent, zones=(under,)))
    think(driver)
    decision = driver.tick_state.decision
    assert decision is not None and decision.route is not None
    none = dataclasses.replace(decision.route, outcome=NoPath(reason=Reason.UNREACHABLE))
    motion = Motion(twist=STANDSTILL, outcome=ControllerState.IDLE)
    lacking = dataclasses.replace(decision, route=none, motion=motion)
    driver._tick_state = dataclasses.replace(driver.tick_state, decision=lacking)
    texts = [reason.text for reason in command(driver).reasons]
    assert "There is no path out of the area: unreachable." in texts


def test_a_robot_inside_a_zone_stands_and_says_so() -> None:
    driver = controller((3.0, 0.0))
    around = dataclasses.replace(
        ACROSS, polygon=((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))
    )
    driver.change(lambda intent: dataclasses.replace(intent, zones=(around,)))
    think(driver)
    assert command(driver).twist == STANDSTILL
    assert causes(command(driver))


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
