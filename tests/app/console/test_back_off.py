"""Backing off ends after half a metre, at a stop, and where an operator drives."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable

import pytest

from app.console.back_off import DISTANCE_M, MAX_STEPS, BackOff, Edit
from app.runtime.control.operator_state import MOVING, OperatorState
from navcore.errors import Refused
from navcore.geometry.transform import Pose2, Twist
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Goal, Mission, Phase
from navcore.robot.driver import Command

Action = Callable[[], None]


class Robot:
    """A robot that moves by what it is told in each step."""

    def __init__(self, *, phase: Phase = Phase.DRIVING, moves: bool = True) -> None:
        goal = Goal(id=1, x_m=3.0, y_m=0.0)
        mission = Mission(phase=phase, queue=(goal,))
        self.intent = OperatorState(mission=mission, beware=BewareList(classes=()))
        self.x_m, self.steps, self.moves = 0.0, 0, moves
        self.at_step, self.before_change = dict[int, Action](), dict[int, Action]()
        self.is_blind, self.going_on = False, threading.Event()
        self.going_on.set()

    def change(self, edit: Callable[[OperatorState], OperatorState]) -> OperatorState:
        self.before_change.pop(self.steps, lambda: None)()
        self.intent = edit(self.intent)
        return self.intent

    def driving(self, twist: Twist) -> Edit:
        command = Command(twist=twist, stamp_ns=self.steps)

        def edit(intent: OperatorState) -> OperatorState:
            if intent.stopped_by is not None:
                raise Refused("the emergency stop is latched")
            mission = intent.mission
            mission = mission.pause() if mission.phase in MOVING else mission
            return dataclasses.replace(intent, by_hand=command, mission=mission)

        return edit

    def resumed(self, intent: OperatorState) -> OperatorState:
        return dataclasses.replace(intent, mission=intent.mission.resume(), by_hand=None)

    def pause(self) -> None:
        """Pause as an operator does."""
        self.intent = dataclasses.replace(
            self.intent, mission=self.intent.mission.pause(), by_hand=None
        )

    def stop(self) -> None:
        """Latch the emergency stop."""
        self.intent = dataclasses.replace(self.intent, stopped_by="key", by_hand=None)

    def odometry(self) -> Pose2:
        if self.is_blind:
            raise Refused("the camera sends no images")
        return Pose2(x_m=self.x_m, y_m=0.0, yaw_rad=0.0)

    def wait(self, ended: threading.Event) -> bool:
        self.going_on.wait(30.0)
        self.steps += 1
        self.x_m -= 0.02 * self.moves
        self.at_step.get(self.steps, lambda: None)()
        return ended.is_set()

    def back_off(self) -> BackOff:
        return BackOff(
            self,
            drive=self.driving,
            resume=self.resumed,
            pose=self.odometry,
            wait=self.wait,
        )


def backed_off(robot: Robot) -> Robot:
    manoeuvre = robot.back_off()
    manoeuvre.start()
    assert manoeuvre._thread is not None
    manoeuvre._thread.join(30.0)
    return robot


def test_the_robot_backs_off_half_a_metre_and_the_mission_goes_on() -> None:
    robot = backed_off(Robot())
    assert -robot.x_m == pytest.approx(DISTANCE_M, abs=0.021)
    assert robot.intent.by_hand is None and robot.intent.mission.phase is Phase.DRIVING
    assert backed_off(Robot(phase=Phase.PAUSED)).intent.mission.phase is Phase.PAUSED


def test_goals_wait_for_the_operator_after_backing_off_out_of_an_area() -> None:
    robot = backed_off(Robot(phase=Phase.LEAVING))
    assert -robot.x_m == pytest.approx(DISTANCE_M, abs=0.021)
    assert robot.intent.mission.phase is Phase.PAUSED


def test_a_robot_that_cannot_move_ends_it_after_some_seconds() -> None:
    robot = backed_off(Robot(moves=False))
    assert robot.steps == MAX_STEPS and robot.intent.by_hand is None


def test_a_stop_and_the_hand_of_an_operator_end_it() -> None:
    stopped = Robot()
    stopped.at_step[3] = stopped.stop
    assert backed_off(stopped).steps == 3
    assert stopped.intent.mission.phase is Phase.PAUSED
    driven = Robot()
    ahead = Twist(v_mps=0.1, w_radps=0.0)
    driven.at_step[3] = lambda: setattr(driven, "intent", driven.driving(ahead)(driven.intent))
    assert backed_off(driven).steps == 3
    assert driven.intent.by_hand is not None
    assert driven.intent.by_hand.twist == ahead, "the operator's command stays"


def test_it_ends_when_the_images_stop() -> None:
    robot = Robot()
    robot.at_step[3] = lambda: setattr(robot, "is_blind", True)
    assert backed_off(robot).steps == 3
    assert robot.intent.by_hand is None
    assert robot.intent.mission.phase is Phase.PAUSED and not robot.intent.mission.goes_on


def test_it_is_refused_while_it_goes_on_and_while_the_stop_is_latched() -> None:
    robot = Robot()
    robot.going_on.clear()
    manoeuvre = robot.back_off()
    manoeuvre.start()
    with pytest.raises(Refused, match="already"):
        manoeuvre.start()
    robot.going_on.set()
    manoeuvre.stop()
    latched = Robot()
    latched.stop()
    with pytest.raises(Refused, match="latched"):
        latched.back_off().start()


def test_a_pause_meanwhile_keeps_the_mission_paused() -> None:
    """Of an operator, or because none is left in control."""
    robot = Robot()

    def pause() -> None:
        mission = robot.intent.mission.pause()
        robot.intent = dataclasses.replace(robot.intent, mission=mission)

    robot.at_step[3] = pause
    backed_off(robot)
    assert -robot.x_m == pytest.approx(DISTANCE_M, abs=0.021), "it backs off all the same"
    assert robot.intent.mission.phase is Phase.PAUSED
    with pytest.raises(Refused, match="only a driving mission"):
        robot.intent.mission.pause()


def test_nothing_goes_on_by_itself_once_it_has_ended() -> None:
    stopped = Robot()
    stopped.at_step[3] = stopped.stop
    assert not backed_off(stopped).intent.mission.goes_on
    latched = Robot()
    latched.stop()
    with pytest.raises(Refused, match="latched"):
        latched.back_off().start()
    assert not latched.intent.mission.goes_on


def test_an_operator_who_resumes_meanwhile_ends_it() -> None:
    robot = Robot()
    robot.at_step[3] = lambda: setattr(robot, "intent", robot.resumed(robot.intent))
    assert backed_off(robot).steps == 3
    assert robot.intent.mission.phase is Phase.DRIVING


def test_a_pause_in_the_last_moment_before_a_command_holds() -> None:
    robot = Robot()
    robot.before_change[3] = robot.pause
    assert backed_off(robot).steps == 3
    assert robot.intent.by_hand is None and robot.intent.mission.phase is Phase.PAUSED


def test_a_pause_in_the_last_moment_before_the_mission_goes_on_holds() -> None:
    robot = Robot()
    arrived = backed_off(Robot()).steps
    robot.before_change[arrived] = robot.pause
    assert backed_off(robot).intent.mission.phase is Phase.PAUSED


def test_a_stop_in_the_last_moment_before_it_begins_holds() -> None:
    robot = Robot(phase=Phase.PAUSED)
    robot.before_change[0] = robot.stop
    with pytest.raises(Refused, match="latched"):
        robot.back_off().start()
    assert robot.intent.by_hand is None
