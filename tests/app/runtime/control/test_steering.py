"""Between two ticks the robot is steered by the newest image, on the map of the newest tick."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from app.runtime.control.robot_controller import RobotController
from app.runtime.control.steering import OLDEST_S
from navcore.control.controller import Controller, ControlTask
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.mission.mission import Mission
from navcore.perception.people.track import Track
from navcore.robot.frame import Frame
from navcore.safety.gate import Cause
from navcore.stages import Stages
from tests.app.runtime.control.controlled import controller, think
from tests.navcore.scene import Box, picture
from tests.navcore.ticks import OPEN, SECOND

LATER = Pose2(x_m=0.3, y_m=0.0, yaw_rad=0.3)
WALKER = Track(
    id=1,
    x_m=2.0,
    y_m=1.0,
    vx_mps=0.0,
    vy_mps=-1.0,
    radius_m=0.25,
    age_s=2.0,
    last_seen_ns=OPEN.stamp_ns,
    walking_speed_mps=1.0,
)


def newer(pose: Pose2, *things: Box, after_s: float = 0.3) -> Frame:
    """Return a newer frame, from another pose, of what stands there."""
    frame = picture(*things, pose=pose, stamp_ns=OPEN.stamp_ns + round(after_s * SECOND))
    noise = np.float32(1 + 1e-4 * after_s)  # no image repeats another one
    rgb, depth_m = frame.rgb + np.uint8(20 * after_s), noise * frame.depth_m
    return dataclasses.replace(frame, rgb=rgb, depth_m=depth_m)


def steered(driver: RobotController, pose: Pose2 = LATER, *things: Box) -> Twist | None:
    """Return the command after the robot was steered at a newer frame."""
    frame = newer(pose, *things)
    driver.steer(lambda: frame.stamp_ns + 1, newest=frame)
    command = driver.tick_state.command
    return None if command is None else command.twist


def test_the_robot_is_steered_as_by_a_tick_at_its_newest_pose() -> None:
    driver, other = controller((4.0, 0.0)), controller((4.0, 0.0))
    think(driver)
    before = driver.tick_state.command
    assert before is not None and before.twist.w_radps == pytest.approx(0.0, abs=0.1)
    twist = steered(driver)
    assert twist is not None and twist.w_radps < -0.1, "back to the path"
    after = driver.tick_state.command
    assert after is not None and after.stamp_ns == OPEN.stamp_ns + round(0.3 * SECOND) + 1
    think(other)
    think(other, picture(pose=LATER, stamp_ns=OPEN.stamp_ns + round(0.3 * SECOND)))
    expected = other.tick_state.command
    assert expected is not None
    assert twist.v_mps == pytest.approx(expected.twist.v_mps, abs=0.1)
    assert math.copysign(1.0, twist.w_radps) == math.copysign(1.0, expected.twist.w_radps)
    decision = driver.tick_state.decision
    assert decision is not None and decision.frame.stamp_ns == OPEN.stamp_ns
    assert decision.motion.twist == twist
    assert driver.tick_state.frame_ns == OPEN.stamp_ns + round(0.3 * SECOND)


def test_what_only_the_newest_image_shows_is_kept_from() -> None:
    ahead, here = Pose2(x_m=0.1, y_m=0.0, yaw_rad=0.0), OPEN.stamp_ns + round(0.3 * SECOND)
    box = Box(x=(0.9, 1.2), y=(-0.6, 0.6), z=(0.0, 0.5))
    twists = list[Twist]()
    for things in ((), (box,)):
        driver = controller((4.0, 0.0))
        think(driver)
        twist = steered(driver, ahead, *things)
        assert twist is not None and driver.tick_state.frame_ns == here
        twists.append(twist)
        decision = driver.tick_state.decision
        assert decision is not None
        shown = decision.obstacles[0][:, 0] if len(decision.obstacles[0]) else np.array([9.0])
        assert (shown.min() < 1.0) == bool(things)
    free, blocked = twists
    assert free.v_mps > 0.3 and blocked.v_mps < 0.6 * free.v_mps


def obstacles_of(driver: RobotController, points: list[tuple[float, float]]) -> Points:
    """Return what the robot keeps from, base frame, as it is steered by (N, 2) points."""
    decision = driver.navigator.steer(newer(OPEN.pose), np.array(points))
    assert decision is not None
    assert decision.motion.outcome is ControllerState.FOLLOW
    return decision.obstacles[0]


def test_few_points_are_noise_and_so_are_those_inside_the_body() -> None:
    driver = controller((4.0, 0.0))
    think(driver)
    assert len(obstacles_of(driver, [(1.2, 0.42)] * 3)) == 0
    assert len(obstacles_of(driver, [(1.2, 0.42)] * 4)) == 1
    assert len(obstacles_of(driver, [(0.3, 0.1)] * 9)) == 0


def test_what_only_the_newest_image_shows_does_not_end_the_way() -> None:
    """The safety gate stops the robot before it, which begins the recovery."""
    driver = controller((4.0, 0.0))
    think(driver)
    wall = [(0.52, y) for y in np.arange(-0.6, 0.6, 0.01).tolist()]
    decision = driver.navigator.steer(newer(OPEN.pose), np.array(wall))
    assert decision is not None and decision.motion.outcome is ControllerState.FOLLOW
    assert 0.05 < decision.motion.twist.v_mps <= 0.1, "nor is it driven at with the speed of before"


def test_obstacles_lie_where_the_robot_is_on_the_map() -> None:
    driver = controller((4.0, 0.0))
    think(driver)
    place = driver.navigator.place
    moved = Pose2(x_m=0.3, y_m=0.1, yaw_rad=0.15)
    driver.navigator.place = dataclasses.replace(place, T_map_odom=moved)
    shown = obstacles_of(driver, [(1.6, 0.3)] * 4)
    assert np.abs(shown - (1.6, 0.3)).max() < 0.06


def test_points_near_a_person_are_the_persons() -> None:
    driver = controller((4.0, 0.0), stages=Stages(track=lambda *_: (WALKER,)))
    think(driver)
    assert driver.navigator._steering is not None
    _, task = driver.navigator._steering
    later_frame = dataclasses.replace(OPEN, pose=Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0))
    points = np.array([(1.0, 0.7), (1.0, 0.3), (1.0, 1.3), (0.4, 0.5)])
    later = task.after(later_frame, 0.3, points)
    assert (later.people[0].x_m, later.people[0].y_m) == pytest.approx((2.0, 0.7))
    assert later.newly_seen is not None
    assert later.newly_seen.tolist() == [[2.0, 1.3], [1.4, 0.5]]


@pytest.mark.parametrize("command_first", [True, False])
def test_the_two_threads_may_read_frames_in_any_order(command_first: bool) -> None:
    """Each reads the newest frame before the other may have dealt with a newer one."""
    driver = controller((4.0, 0.0))
    think(driver)
    older, newest = newer(LATER, after_s=0.2), newer(LATER)
    now_ns = newest.stamp_ns + 1

    def command(frame: Frame) -> None:
        verdict = driver.command(lambda: now_ns, 0.05, newest=frame)
        assert Cause.BAD_STAMP not in {reason.cause for reason in verdict.reasons}

    if command_first:
        command(newest)
        before = driver.tick_state
        driver.steer(lambda: now_ns, newest=older)
        assert driver.tick_state is before
    else:
        driver.steer(lambda: now_ns, newest=newest)
        assert driver.tick_state.frame_ns == newest.stamp_ns
        command(older)
    command(newest)


@pytest.mark.parametrize(
    "edit",
    [
        lambda driver: driver.change_mission(Mission.pause),
        lambda driver: driver.change_mission(lambda mission: mission.cancel()),
        lambda driver: driver.change(
            lambda intent: dataclasses.replace(
                intent, beware=intent.beware.edited("red floor", enabled=False)
            )
        ),
    ],
)
def test_a_decision_for_what_is_asked_no_more_is_not_continued(
    edit: Callable[[RobotController], object],
) -> None:
    driver = controller((4.0, 0.0))
    think(driver)
    before = driver.tick_state
    edit(driver)
    steered(driver)
    assert driver.tick_state is before


def test_nothing_is_continued_before_the_first_tick_nor_by_the_same_frame() -> None:
    driver = controller((4.0, 0.0))
    assert steered(driver) is None
    think(driver)
    before = driver.tick_state
    driver.steer(lambda: OPEN.stamp_ns, newest=OPEN)
    assert driver.tick_state is before


def test_what_was_seen_long_ago_is_not_driven_by() -> None:
    driver = controller((4.0, 0.0))
    think(driver)
    before = driver.tick_state
    frame = newer(LATER, after_s=OLDEST_S + 0.05)
    driver.steer(lambda: frame.stamp_ns, newest=frame)
    assert driver.tick_state is before


def test_a_pose_that_is_not_believed_steers_nothing() -> None:
    driver = controller((4.0, 0.0))
    think(driver)
    driver.command(lambda: OPEN.stamp_ns, 0.05, newest=OPEN)
    before = driver.tick_state
    steered(driver, Pose2(x_m=5.0, y_m=0.0, yaw_rad=0.0))  # it has jumped
    assert driver.tick_state is before


def test_what_a_behaviour_has_the_robot_do_is_not_overruled() -> None:
    def waits(behaviour: object, motion: object, **_: object) -> tuple[object, object]:
        return behaviour, dataclasses.replace(motion, twist=STANDSTILL)  # type: ignore[type-var]

    driver = controller((4.0, 0.0), stages=Stages(supervise=waits))  # type: ignore[arg-type]
    think(driver)
    assert steered(driver) == STANDSTILL


def test_people_have_walked_on_meanwhile() -> None:
    asked = []
    plain = Stages()

    def control(controller: object, task: object) -> object:
        asked.append(task)
        return plain.control(controller, task)  # type: ignore[arg-type]

    driver = controller(
        (4.0, 0.0),
        stages=Stages(track=lambda *_: (WALKER,), control=control),  # type: ignore[arg-type]
    )
    think(driver)
    steered(driver)
    (first, second) = (task.people[0] for task in asked)  # type: ignore[attr-defined]
    assert (first.y_m, second.y_m) == (pytest.approx(1.0), pytest.approx(0.7))
    assert (first.unseen_s, second.unseen_s) == (0.0, pytest.approx(0.3))
    assert first.at(-1.0) == pytest.approx((2.0, 2.0))
    where_lost = second.at(first.unseen_s - second.unseen_s)
    assert where_lost == pytest.approx((2.0, 1.0)), "where the tick has seen them"


@pytest.mark.parametrize("first_waits", [True, False])
def test_who_stands_for_people_says_so(first_waits: bool) -> None:
    """Also where the tick had it wait and the next decision would drive on, or the other way."""
    waits, follows = ControllerState.WAIT_FOR_PEOPLE, ControllerState.FOLLOW
    motions = [
        Motion(twist=STANDSTILL, outcome=waits),
        Motion(twist=Twist(v_mps=0.5, w_radps=0.0), outcome=follows),
    ]
    found = iter(motions if first_waits else reversed(motions))
    driver = controller(
        (4.0, 0.0), stages=Stages(track=lambda *_: (WALKER,), control=lambda *_: next(found))
    )
    think(driver)
    assert steered(driver) == STANDSTILL
    decision = driver.tick_state.decision
    assert decision is not None and decision.motion.outcome is waits


@pytest.mark.parametrize("has_people", [True, False])
def test_beside_people_the_robot_gets_no_faster_than_the_tick_had_it(has_people: bool) -> None:
    plain, speeds = Stages(), iter([0.3, 0.9])

    def control(controller: Controller, task: ControlTask) -> Motion:
        found = plain.control(controller, task)
        return dataclasses.replace(found, twist=Twist(v_mps=next(speeds), w_radps=0.0))

    people = (WALKER,) if has_people else ()
    driver = controller((4.0, 0.0), stages=Stages(track=lambda *_: people, control=control))
    think(driver)
    twist = steered(driver)
    assert twist is not None and twist.v_mps == pytest.approx(0.3 if has_people else 0.9)


def test_the_next_tick_goes_on_from_the_tick_and_the_next_decision_from_the_last() -> None:
    plain, previous = Stages(), list[Motion]()

    def control(controller: Controller, task: ControlTask) -> Motion:
        previous.append(controller.memory.motion)
        return plain.control(controller, task)

    driver = controller((4.0, 0.0), stages=Stages(control=control))
    think(driver)
    of_tick = driver.navigator._controller.memory
    for number in (1, 2):
        frame = newer(LATER, after_s=0.3 * number)
        driver.steer(partial(int, frame.stamp_ns), newest=frame)
    left = driver.navigator._controller.memory
    assert left.motion is of_tick.motion and left.obstacles is of_tick.obstacles
    _, first, second = previous
    assert first is of_tick.motion and second is not of_tick.motion


@pytest.mark.parametrize("ask", ["trust_pose", "place", "search", "replace_map", "poses"])
def test_a_robot_that_is_elsewhere_from_the_next_tick_on_is_not_steered(ask: str) -> None:
    driver = controller((4.0, 0.0))
    think(driver)
    before = driver.tick_state
    driver._ask(**{ask: {0: LATER} if ask == "poses" else True})
    steered(driver)
    assert driver.tick_state is before
