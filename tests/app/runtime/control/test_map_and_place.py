"""What is asked of the map and of the place between two ticks: corrections, edits, another map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from app.runtime.control.background import InlineBackground
from app.runtime.control.map_requests import MapRequests, ShownPlace
from app.runtime.control.operator_state import OperatorState, PlaceSearch
from app.runtime.control.robot_controller import RobotController
from app.runtime.control.stop_reasons import SEARCH_FAILED
from navcore.behaviours.search_turn import PATIENCE_NS, TURN_RAD, SearchTurn
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, Twist
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.localisation import Localisation
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.erasing import Erasable
from navcore.mission.mission import Goal, Mission, Phase
from navcore.robot.profile import HUSKY
from navcore.safety.gate import Cause
from navcore.stages import Stages
from tests.app.runtime.control.controlled import causes, command, controller, forget_frames, think
from tests.navcore.scene import RED_LIST, SPEC, Box, Paint, picture
from tests.navcore.ticks import OPEN, SECOND, navigator


class Computed:
    """A task beside the tick."""

    def run(self, is_cancelled: Callable[[], bool]) -> str:
        return "an outcome"


def test_a_corrected_pose_moves_its_points_at_the_next_tick_and_an_unknown_one_is_refused() -> None:
    driver = controller()
    wall = picture(Box(x=(2.0, 2.2), y=(-1.0, 1.0), z=(0.0, 1.0)), stamp_ns=SECOND)
    think(driver, wall)
    before = driver.navigator.map.points
    with pytest.raises(BadConfiguration, match="pose ID 5 is not on the map, which has 1"):
        driver.correct_poses(
            {0: Pose2(x_m=0.5, y_m=0.0, yaw_rad=0.0), 5: Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)}
        )
    moved_to = Pose2(x_m=0.0, y_m=0.5, yaw_rad=0.0)
    driver.correct_poses({0: moved_to})
    # A frame from elsewhere, so that the old pose's points are not replaced.
    think(driver, picture(stamp_ns=2 * SECOND, pose=Pose2(x_m=-4.0, y_m=0.0, yaw_rad=math.pi)))
    decision = driver.tick_state.decision
    assert decision is not None and decision.correction is not None
    assert decision.correction.after[0] == moved_to, "zones beside it move along"
    (keyframe,) = (one for one in driver.navigator.localisation.keyframes if one.pose_id == 0)
    assert keyframe.T_map_base == moved_to
    assert driver.place.T_map_base.distance_to(-4.0, 0.0) < 0.05
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


def raising(*_: object) -> None:
    """A request, or a stage, that has a bug."""
    raise RuntimeError("a bug")


def test_a_request_that_fails_keeps_no_other_from_being_done(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    driver, shown, edited = controller(), Pose2(x_m=1.0, y_m=2.0, yaw_rad=0.0), list[PointMap]()
    think(driver)
    monkeypatch.setattr(driver.navigator, "take", raising)
    driver._background.submit(Computed())
    driver.edit_map(raising)
    driver.edit_map(edited.append)
    driver.place_robot(shown, np.eye(3))
    think(driver, picture(stamp_ns=2 * SECOND))
    assert edited == [driver.navigator.map]
    assert driver.place.T_map_base.distance_to(shown.x_m, shown.y_m) < 0.01


def test_a_map_that_cannot_be_replaced_is_tried_again_and_all_requests_wait_for_it() -> None:
    driver, tried, edited = controller(), list[str](), list[str]()
    think(driver)

    def replace_map() -> None:
        tried.append("replaced")
        if len(tried) == 1:
            raise RuntimeError("a bug")

    driver.enter_site(lambda intent: intent, replace_map)
    driver.edit_map(lambda _: edited.append("first"))
    with pytest.raises(RuntimeError):
        think(driver, picture(stamp_ns=2 * SECOND))
    assert not edited
    driver.edit_map(lambda _: edited.append("second"))
    think(driver, picture(stamp_ns=3 * SECOND))
    think(driver, picture(stamp_ns=4 * SECOND))
    assert len(tried) == 2 and edited == ["first", "second"]


def test_what_fails_after_a_tick_keeps_its_correction_from_no_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    driver = controller((3.0, 0.0))
    monkeypatch.setattr(driver.navigator, "next_task", raising)
    assert driver.think(OPEN, clock=lambda: OPEN.stamp_ns) is not None
    assert driver.tick_state.failure == "RuntimeError: a bug"
    assert driver.tick_state.command is None
    assert str(driver.failed) == "a bug"  # for who called it: it is logged there, or ends a test
    monkeypatch.undo()
    think(driver, picture(stamp_ns=2 * SECOND))
    assert driver.failed is None


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
        driver.think(dataclasses.replace(seen, rgb=rgb, depth_m=depth_m), clock=lambda: times[-1])
    there = driver.place.T_map_base
    assert there.distance_to(shown.x_m, shown.y_m) < 0.01
    assert there.yaw_rad == pytest.approx(shown.yaw_rad)


@pytest.mark.parametrize("restarted_ns", [0, 5 * SECOND], ids=["odometry", "clock and odometry"])
def test_a_jump_of_odometry_that_is_accepted_leaves_the_place_as_uncertain(
    restarted_ns: int,
) -> None:
    driver = controller()
    driver.think(OPEN, clock=lambda: SECOND)
    there, then_ns = Pose2(x_m=3.0, y_m=0.0, yaw_rad=0.5), SECOND - restarted_ns
    driver.think(picture(stamp_ns=then_ns + 100_000_000, pose=there), clock=lambda: 2 * SECOND)
    assert driver.sensors_in_doubt
    driver.trust_pose()
    driver.think(picture(stamp_ns=then_ns + 200_000_000, pose=there), clock=lambda: 2 * SECOND)
    assert driver.place.T_map_base.distance_to(there.x_m, there.y_m) < 0.01
    assert math.sqrt(driver.place.covariance[0, 0]) == pytest.approx(3.0, rel=0.05)
    assert math.sqrt(driver.place.covariance[2, 2]) == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize("last", ["late", "without a pose"])
def test_a_reset_before_odometry_has_jumped_does_not_accept_the_jump(last: str) -> None:
    """As after a restart of the robot's driver: the operator resets while no image comes."""
    driver, there = controller(), Pose2(x_m=4.0, y_m=1.0, yaw_rad=1.0)
    first = picture(stamp_ns=SECOND, pose=there)
    driver.command(lambda: SECOND, 0.05, newest=first)
    driver.think(first, clock=lambda: SECOND)
    if last == "without a pose":
        unknown = dataclasses.replace(there, x_m=math.nan)
        frame = picture(stamp_ns=SECOND + 100_000_000, pose=unknown)
        driver.command(lambda: 2 * SECOND, 0.05, newest=frame)
        driver.think(frame, clock=lambda: 2 * SECOND)
    driver.trust_pose()
    again = picture(stamp_ns=20 * SECOND)
    verdict = driver.command(lambda: 20 * SECOND, 0.05, newest=again)
    assert driver.think(again, clock=lambda: 20 * SECOND) is None
    assert Cause.POSE_JUMP in causes(verdict) and driver.sensors_in_doubt
    assert driver.place.T_map_base.distance_to(there.x_m, there.y_m) < 0.01


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


def test_a_robot_that_stands_for_a_correction_of_its_place_says_so() -> None:
    driver = controller((3.0, 0.0))
    think(driver)
    assert Cause.POSE_UNKNOWN not in causes(command(driver))
    driver._tick_state = dataclasses.replace(driver.tick_state, waits_for_correction=True)
    (said,) = [reason for reason in command(driver).reasons if reason.cause is Cause.POSE_UNKNOWN]
    assert "can be corrected" in said.text


def test_of_a_place_and_a_search_that_wait_the_newer_counts() -> None:
    shown = ShownPlace(T_map_base=Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0), covariance=np.eye(3))
    placed, searched = MapRequests(place=shown), MapRequests(search=True)
    assert placed.before(searched) == searched
    after = searched.before(placed)
    assert after.place == shown and not after.search
    kept = MapRequests(trust_pose=True).before(MapRequests())
    assert kept.trust_pose and placed.before(MapRequests()).place == shown


def test_one_image_from_the_future_does_not_hold_the_robot() -> None:
    driver = controller((3.0, 0.0))
    future = dataclasses.replace(OPEN, stamp_ns=10**15)
    for number, frame in enumerate((OPEN, future, OPEN, OPEN)):
        now_ns = SECOND * (10 + number) // 10
        rgb = OPEN.rgb + np.uint8(number)
        depth_m = OPEN.depth_m * np.float32(1 + 1e-4 * number)
        stamp_ns = now_ns if frame is OPEN else frame.stamp_ns
        frame = dataclasses.replace(frame, stamp_ns=stamp_ns, rgb=rgb, depth_m=depth_m)
        driver.think(frame, clock=partial(int, now_ns))
        verdict = driver.command(partial(int, now_ns), 0.1, newest=frame)
        is_future = number == 1
        assert not driver.sensors_in_doubt  # no reset helps
        assert (Cause.BAD_STAMP in causes(verdict)) is is_future
    assert verdict.twist.v_mps > 0.0


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
        driver.think(elsewhere, clock=lambda: 2 * SECOND)
    assert driver.sensors_in_doubt
    if accepted:
        driver.trust_pose()
    else:
        forget_frames(driver)  # the control: trusted, but not reset to this pose
    driver.think(picture(stamp_ns=SECOND + 300_000_000, pose=there), clock=lambda: 2 * SECOND)
    known = driver.navigator.map.explored.known(SPEC)
    row, col = SPEC.cell(there.x_m - 0.8, there.y_m)
    assert known[row, col] == accepted


@pytest.mark.parametrize("enters", [True, False])
def test_what_was_computed_or_shown_on_a_map_is_not_taken_for_the_next_one(
    enters: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    monkeypatch.setattr(driver.navigator, "place_robot", lambda *place, **_: taken.append(place[0]))
    background.submit(Computed())
    driver.place_robot(shown, np.eye(3))
    if enters:
        driver.enter_site(lambda intent: intent, lambda: None)
    think(driver)
    assert taken == ([] if enters else ["an outcome", shown])


def lost_robot() -> RobotController:
    """A robot that never finds its place."""

    def lost(*given: Any) -> LocalisationEstimate:
        return dataclasses.replace(Localisation.update(*given), state=LocalisationState.LOST)

    driver = controller(stages=Stages(localise=lost))
    think(driver)
    return driver


def test_a_mission_does_not_go_on_after_backing_off_once_the_place_was_lost() -> None:
    driver = lost_robot()
    goal = Goal(id=1, x_m=3.0, y_m=0.0)
    driver.change_mission(lambda _: Mission(phase=Phase.DRIVING, queue=(goal,)).interrupt())
    think(driver, picture(stamp_ns=2 * SECOND))
    assert driver.intent.mission == Mission(phase=Phase.PAUSED, queue=(goal,))


def test_a_robot_that_turns_slowly_turns_round_all_the_same() -> None:
    turn, slow_radps = SearchTurn(), 0.05
    for second in range(round(TURN_RAD / slow_radps) + 2):
        turn = turn.after(Pose2(x_m=0.0, y_m=0.0, yaw_rad=slow_radps * second), second * SECOND)
        assert not turn.has_failed
    assert turn.is_over


def turn_tried(
    driver: RobotController, seconds: float, *, step_s: float, turns: bool
) -> list[float]:
    """Look round for some seconds; the wheels turn, or are blocked, and the heading stays. Returns
    the yaw rates that were sent."""
    start, rates = driver.tick_state.frame_ns or 0, []
    for step in range(1, round(seconds / step_s) + 1):
        measured = Twist(v_mps=0.0, w_radps=driver.sent.w_radps if turns else 0.0)
        now_ns = start + round(step * step_s * SECOND)
        rgb = OPEN.rgb + np.uint8(step % 7)
        frame = dataclasses.replace(OPEN, rgb=rgb, twist=measured, stamp_ns=now_ns)
        think(driver, frame)
        sent = driver.command(partial(int, now_ns), 0.05, newest=frame)
        rates.append(sent.twist.w_radps)
    return rates


@pytest.mark.parametrize(
    ("turns", "after_s", "step_s"),
    [pytest.param(True, PATIENCE_NS / 1e9, 0.5, marks=pytest.mark.long), (False, 2.0, 0.1)],
)
def test_a_robot_that_cannot_turn_round_looks_for_its_place_no_longer_and_says_so(
    turns: bool, after_s: float, step_s: float
) -> None:
    driver = lost_robot()
    driver.search_place()
    assert any(turn_tried(driver, after_s - 0.5, step_s=step_s, turns=turns))
    assert driver.intent.searching
    turn_tried(driver, 1.5, step_s=step_s, turns=turns)
    assert driver.intent.search is PlaceSearch.FAILED
    assert not any(turn_tried(driver, 1.0, step_s=step_s, turns=True))
    assert SEARCH_FAILED in command(driver).reasons
    driver.search_place()
    assert any(turn_tried(driver, 0.5, step_s=0.1, turns=True))
    assert SEARCH_FAILED not in command(driver).reasons
