"""The console's threads on a test bench: whatever hangs or fails above it, the command thread
continues and sends zero."""

from __future__ import annotations

import dataclasses
import os
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pytest

from app.runtime.control.loop import (
    LOW_PRIORITY_NICENESS,
    ControlLoop,
    PeriodicThread,
    lower_other_priorities,
)
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from navcore.config.navigator import NavigatorConfig
from navcore.config.safety import DEFAULT_SAFETY, GateConfig, SafetyConfig
from navcore.errors import StorageFailed
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Mission
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import Cause, GateDecision, gate
from navcore.warmup import warm_up
from tests.navcore.scene import Box, picture

SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.1)
FRAME_S = 0.05


class HangingSegmenter(ColourSegmenter):
    """Labels by colour until it is told to hang or to fail."""

    def __init__(self) -> None:
        super().__init__()
        self.go_on = threading.Event()
        self.go_on.set()
        self.broken = False
        self.takes_s = 0.0

    def segment(self, frame: Frame, beware: Any) -> Labels:
        """Label by the colour rules."""
        time.sleep(self.takes_s)
        self.go_on.wait(20.0)
        if self.broken:
            raise RuntimeError("the network is gone")
        return super().segment(frame, beware)


@dataclass
class Bench:
    """A robot on a bench: its wheels turn in the air, and its camera always shows the same wall
    with a little noise."""

    sent: list[tuple[int, Twist]] = field(default_factory=list)
    wall: Frame = field(default_factory=lambda: picture(Box(x=(4.0, 4.5), y=(-3, 3), z=(0, 1))))
    covered: bool = False
    stuck: bool = False
    jumped_m: float = 0.0
    held: bool = False
    goes_on: bool = False
    noise: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    newest: Frame | None = None

    def now_ns(self) -> int:
        return time.monotonic_ns()

    def newest_frame(self) -> Frame | None:
        """Return the newest frame; one that `goes_on` has new ones also while none is waited
        for."""
        if self.goes_on and self.newest is not None:
            due_ns = self.newest.stamp_ns + round(FRAME_S * 1e9)
            return self.shoot() if self.now_ns() > due_ns else self.newest
        return self.newest

    def wait_frame(self, after: Frame | None, timeout_s: float) -> Frame | None:
        time.sleep(timeout_s if self.covered else FRAME_S)
        return None if self.covered else self.shoot()

    def shoot(self) -> Frame:
        """Take an image."""
        rgb, depth_m = self.wall.rgb, self.wall.depth_m
        if self.stuck and self.newest is not None:
            rgb, depth_m = self.newest.rgb, self.newest.depth_m
        else:
            rgb = rgb + self.noise.integers(0, 4, rgb.shape, dtype=np.uint8)
            depth_m = depth_m * self.noise.uniform(0.999, 1.001, depth_m.shape).astype(np.float32)
        self.newest = dataclasses.replace(
            self.wall,
            stamp_ns=self.now_ns(),
            rgb=rgb,
            depth_m=depth_m,
            pose=Pose2(x_m=self.jumped_m, y_m=0.0, yaw_rad=0.0),
            twist=self.sent[-1][1] if self.sent and not self.held else STANDSTILL,
        )
        return self.newest

    def send(self, twist: Twist) -> None:
        self.sent.append((self.now_ns(), twist))

    def close(self) -> None:
        pass


@dataclass
class Rig:
    robot: Bench
    controller: RobotController
    segmenter: HangingSegmenter
    verdicts: list[GateDecision]

    def reasons(self) -> set[Cause]:
        return {reason.cause for reason in self.verdicts[-1].reasons}


@pytest.fixture
def rig() -> Iterator[Rig]:
    """A control loop that drives towards a goal ahead."""
    warm_up()
    segmenter, robot, verdicts = HangingSegmenter(), Bench(), list[GateDecision]()
    navigator = Navigator(spec=SPEC, profile=HUSKY, segmenter=segmenter, config=NavigatorConfig())
    mission = Mission().add(2.5, 0.0, SPEC).start()
    controller = RobotController(
        navigator=navigator,
        profile=HUSKY,
        intent=OperatorState(mission=mission, beware=default_beware_list()),
    )
    loop = ControlLoop(
        robot, controller, on_decision=lambda decision: None, on_verdict=verdicts.append
    )
    loop.start()
    yield Rig(robot=robot, controller=controller, segmenter=segmenter, verdicts=verdicts)
    segmenter.go_on.set()
    loop.stop()
    assert robot.sent[-1][1] == STANDSTILL
    # A thread that waited for labels that never come would hold up the end of the console.
    assert not {"think", "command"} & {thread.name for thread in threading.enumerate()}


def until(holds: Any, patience_s: float = 60.0) -> None:
    deadline = time.monotonic() + patience_s
    while not holds():
        assert time.monotonic() < deadline, "it never happened"
        time.sleep(0.01)


def moving(rig: Rig) -> bool:
    return bool(rig.robot.sent) and rig.robot.sent[-1][1].v_mps > 0.1


def test_a_hung_tick_means_zero_sent_by_the_command_thread_alone_and_it_drives_on_afterwards(
    rig: Rig,
) -> None:
    until(lambda: moving(rig))
    rig.segmenter.go_on.clear()
    until(lambda: rig.robot.sent[-1][1] == STANDSTILL)
    assert rig.reasons() & {Cause.STALE_COMMAND, Cause.STALE_FRAME}
    command = rig.controller.tick_state.command
    assert command is not None and command.twist.v_mps > 0
    # The bench stamps a command after the gate has decided it, and a busy machine may pause between
    # the two.
    expired_ns = command.stamp_ns + DEFAULT_SAFETY.gate.command_life_ns + 20_000_000

    def late() -> list[Twist]:
        return [twist for stamp_ns, twist in rig.robot.sent if stamp_ns > expired_ns]

    until(lambda: len(late()) > 10)
    assert all(twist == STANDSTILL for twist in late())
    rig.segmenter.go_on.set()
    until(lambda: moving(rig))


def test_without_its_expiry_the_old_command_would_be_sent_without_end(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Control of the test above: it is the gate's expiry that stops the robot."""
    endless = SafetyConfig(gate=GateConfig(command_life_s=1e6, frame_life_s=1e6))
    monkeypatch.setattr("app.runtime.control.robot_controller.gate", partial(gate, config=endless))
    until(lambda: moving(rig))
    rig.segmenter.go_on.clear()
    count = len(rig.robot.sent)
    until(lambda: len(rig.robot.sent) > count + 15)
    assert rig.robot.sent[-1][1] != STANDSTILL


def drives_with_slow_labels(rig: Rig, seconds: float) -> set[Cause]:
    """Drive with labels that take longer than a command lives; return why the robot stood."""
    until(lambda: moving(rig))
    rig.segmenter.takes_s, rig.robot.goes_on = 0.4, True
    time.sleep(1.0)  # until the loop knows how long they take
    rig.verdicts.clear()
    time.sleep(seconds)
    return {reason.cause for verdict in rig.verdicts for reason in verdict.reasons}


def test_a_robot_whose_labels_take_long_is_steered_meanwhile_and_not_held(rig: Rig) -> None:
    assert Cause.STALE_COMMAND not in drives_with_slow_labels(rig, 1.5)
    assert moving(rig)
    rig.segmenter.go_on.clear()
    until(lambda: rig.robot.sent[-1][1] == STANDSTILL)
    count = len(rig.robot.sent)
    until(lambda: len(rig.robot.sent) > count + 10)
    assert all(twist == STANDSTILL for _, twist in rig.robot.sent[count:])
    assert Cause.STALE_COMMAND in rig.reasons(), "labels that never come are not waited for"


def test_without_being_steered_it_would_be_held(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Control of the test above."""
    monkeypatch.setattr("app.runtime.control.loop.OVERDUE", 0.0)
    assert Cause.STALE_COMMAND in drives_with_slow_labels(rig, 1.5)


def test_an_image_drives_the_robot_before_its_labels_are_made(rig: Rig) -> None:
    until(lambda: moving(rig))
    rig.segmenter.takes_s, rig.robot.goes_on = 0.15, True
    time.sleep(0.5)  # until the loop knows how long they take
    newer_s = list[float]()
    while len(newer_s) < 100:
        state = rig.controller.tick_state
        if state.decision is not None and state.frame_ns is not None:
            newer_s.append((state.frame_ns - state.decision.frame.stamp_ns) / 1e9)
        time.sleep(0.01)
    assert np.mean(np.array(newer_s) > 0.0) > 0.4, "decided by an image that is not labelled yet"
    assert max(newer_s) > 0.1


def test_ticks_drive_the_robot_where_no_decision_can_be_made_between_them(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(*_: Any, **__: Any) -> None:
        raise RuntimeError("no decision")

    monkeypatch.setattr(rig.controller, "steer", fails)
    until(lambda: "no decision between two ticks" in caplog.text)
    until(lambda: moving(rig))
    assert not rig.reasons()
    assert caplog.text.count("RuntimeError: no decision") == 1


def test_nothing_that_was_decided_before_a_stop_is_sent_after_it_is_acknowledged(rig: Rig) -> None:
    for _ in range(20):
        until(lambda: moving(rig))
        rig.controller.change(lambda intent: dataclasses.replace(intent, stopped_by="a test"))
        count = len(rig.robot.sent)
        until(lambda since=count: len(rig.robot.sent) > since + 2)
        assert all(twist == STANDSTILL for _, twist in rig.robot.sent[count:])
        rig.controller.change(lambda intent: dataclasses.replace(intent, stopped_by=None))


def test_a_tick_that_fails_is_reported_and_retried(rig: Rig) -> None:
    until(lambda: moving(rig))
    rig.segmenter.broken = True
    until(lambda: Cause.PLANNER_FAILED in rig.reasons())
    assert rig.robot.sent[-1][1] == STANDSTILL
    assert any("the network is gone" in reason.text for reason in rig.verdicts[-1].reasons)
    rig.segmenter.broken = False
    until(lambda: moving(rig))


def test_a_camera_that_falls_silent_stops_the_robot_and_is_named(rig: Rig) -> None:
    until(lambda: moving(rig))
    rig.robot.covered = True
    until(lambda: Cause.STALE_FRAME in rig.reasons())
    assert rig.robot.sent[-1][1] == STANDSTILL
    rig.robot.covered = False
    until(lambda: moving(rig))


def test_the_stop_outlives_everything_but_its_reset(rig: Rig) -> None:
    until(lambda: moving(rig))
    rig.controller.change(lambda intent: dataclasses.replace(intent, stopped_by="a test"))
    until(lambda: rig.robot.sent[-1][1] == STANDSTILL)
    rig.segmenter.go_on.clear()
    count = len(rig.robot.sent)
    until(lambda: len(rig.robot.sent) > count + 10)
    assert all(twist == STANDSTILL for _, twist in rig.robot.sent[count:])
    assert rig.verdicts[-1].reasons[0].cause is Cause.EMERGENCY_STOP
    rig.segmenter.go_on.set()
    rig.controller.change(lambda intent: dataclasses.replace(intent, stopped_by=None))
    until(lambda: moving(rig))


def test_malformed_frames_stop_the_robot_and_stay_out_of_the_map(rig: Rig) -> None:
    until(lambda: moving(rig))
    good = rig.robot.wall
    rig.robot.wall = dataclasses.replace(good, depth_m=good.depth_m * float("nan"))
    until(lambda: Cause.BAD_FRAME in rig.reasons())
    version = rig.controller.navigator.map.version
    count = len(rig.robot.sent)
    until(lambda: len(rig.robot.sent) > count + 10)
    assert all(twist == STANDSTILL for _, twist in rig.robot.sent[count:])
    assert rig.verdicts[-1].reasons[0].cause is Cause.BAD_FRAME
    assert rig.controller.navigator.map.version == version
    rig.robot.wall = good
    until(lambda: moving(rig))


def test_a_camera_that_repeats_its_image_with_fresh_stamps_stops_the_robot_and_is_named(
    rig: Rig,
) -> None:
    until(lambda: moving(rig))
    rig.robot.stuck = True
    until(lambda: Cause.STUCK_CAMERA in rig.reasons())
    assert rig.robot.sent[-1][1] == STANDSTILL
    rig.robot.stuck = False
    until(lambda: moving(rig))


def test_wheels_that_do_not_turn_are_not_pushed_on_until_the_operator_says_so(rig: Rig) -> None:
    until(lambda: moving(rig))
    rig.robot.held = True
    until(lambda: Cause.WHEELS_BLOCKED in rig.reasons())
    rig.robot.held = False
    count = len(rig.robot.sent)
    until(lambda: len(rig.robot.sent) > count + 10)
    assert all(twist == STANDSTILL for _, twist in rig.robot.sent[count:])
    rig.controller.change_mission(Mission.pause)
    until(lambda: Cause.WHEELS_BLOCKED not in rig.reasons())
    rig.controller.change_mission(Mission.resume)
    until(lambda: moving(rig))


def test_a_command_that_goes_on_failing_is_logged_once_and_zero_is_sent(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    until(lambda: moving(rig))

    def fail(*given: Any, **named: Any) -> GateDecision:
        failures.append(1)
        raise RuntimeError("no verdict")

    failures: list[int] = []
    monkeypatch.setattr(rig.controller, "command", fail)
    until(lambda: len(failures) > 5)
    assert rig.robot.sent[-1][1] == STANDSTILL
    assert sum("sends zero" in record.message for record in caplog.records) == 1
    monkeypatch.undo()
    until(lambda: moving(rig))


def test_a_periodic_work_that_goes_on_failing_is_logged_once_until_it_has_worked(
    caplog: pytest.LogCaptureFixture,
) -> None:
    outcomes, ended = iter(["full", "full", "torn", "torn", "", "torn"]), threading.Event()

    def work() -> None:
        outcome = next(outcomes, None)
        if outcome is None:
            ended.set()
        elif outcome:
            raise StorageFailed(outcome)

    thread = PeriodicThread(work, period_s=0.001, name="to disk")
    thread.start()
    assert ended.wait(30.0)
    thread.stop()
    logged = [str(record.exc_info[1]) for record in caplog.records if record.exc_info]
    assert logged == ["full", "torn", "torn"]


def test_a_jump_of_odometry_holds_the_robot_and_its_map_until_it_jumps_back_or_is_accepted(
    rig: Rig,
) -> None:
    until(lambda: moving(rig))
    rig.robot.jumped_m = 1.0
    until(lambda: Cause.POSE_JUMP in rig.reasons())
    version = rig.controller.navigator.map.version
    count = len(rig.robot.sent)
    until(lambda: len(rig.robot.sent) > count + 30)
    assert all(twist == STANDSTILL for _, twist in rig.robot.sent[count:])
    assert rig.controller.navigator.map.version == version
    rig.robot.jumped_m = 0.0
    until(lambda: moving(rig))
    rig.robot.jumped_m = 0.5
    until(lambda: Cause.POSE_JUMP in rig.reasons())
    rig.controller.trust_pose()
    until(lambda: moving(rig))


@pytest.mark.skipif(
    not sys.platform.startswith("linux") or os.nice(0) >= LOW_PRIORITY_NICENESS,
    reason="no niceness per thread to compare",
)
def test_every_thread_but_the_robots_gets_a_lower_priority() -> None:
    ended = threading.Event()
    threads = {
        name: threading.Thread(target=ended.wait, name=name, daemon=True)
        for name in ("think", "command", "console")
    }
    for thread in threads.values():
        thread.start()
    try:
        before = os.getpriority(os.PRIO_PROCESS, threads["think"].native_id or 0)
        lower_other_priorities()
        niceness = {
            name: os.getpriority(os.PRIO_PROCESS, thread.native_id or 0)
            for name, thread in threads.items()
        }
        assert niceness == {"think": before, "command": before, "console": LOW_PRIORITY_NICENESS}
        assert os.getpriority(os.PRIO_PROCESS, threading.main_thread().native_id or 0) == before
    finally:
        ended.set()
