"""The console's threads: segment (labels of the next frame), think (the navigator's tick) and
command (sends to the robot at 20 Hz).

A fourth thread, sense, belongs to the link of each robot back end and keeps the newest frame. The
web server and viser have their own. Command waits for nothing but its own clock: whatever hangs
above it, it sends zero when the command has expired.
"""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Protocol

from app.runtime.control.robot_controller import COMMAND_PERIOD_S, RobotController
from app.runtime.control.segmentation_ahead import SegmentationAhead, SegmentedFrame
from app.runtime.control.steering import OVERDUE
from navcore.geometry.transform import STANDSTILL
from navcore.navigator import TickResult
from navcore.robot.driver import Robot
from navcore.robot.frame import Frame
from navcore.safety.gate import GateDecision

FRAME_WAIT_S = 0.2
"""Longest wait for a frame, and first wait after a failed tick, seconds."""
MAX_RETRY_S = 2.0
"""Longest wait after a failed tick, seconds; each failure doubles the wait."""
LOOK_S = 0.01
"""Time in seconds between two looks for a newer image while labels are waited for."""
JOIN_S = 2.0
"""Longest wait for the end of a thread, seconds."""
ROBOT_THREADS = frozenset({"sense", "segment", "think", "command", "to-simulator", "MainThread"})
"""Names of the threads that keep the priority they have; the main thread only waits, and threads
that it starts inherit its priority."""
LOW_PRIORITY_NICENESS = 5
"""Niceness of all other threads: on a busy machine each gets a third of the CPU share of a robot
thread."""
log = logging.getLogger(__name__)


def lower_other_priorities() -> None:
    """Lower the priority of every thread of this process but the robot's; threads that they start
    inherit it.

    Only Linux has a niceness per thread. Lowering a priority needs no privilege.
    """
    if not sys.platform.startswith("linux"):
        return
    for thread in threading.enumerate():
        if thread.name not in ROBOT_THREADS and thread.native_id is not None:
            with contextlib.suppress(OSError):  # the thread has ended
                os.setpriority(os.PRIO_PROCESS, thread.native_id, LOW_PRIORITY_NICENESS)


class LiveRobot(Robot, Protocol):
    """A robot in real time, whose frames can be waited for."""

    def wait_frame(self, after: Frame | None, timeout_s: float) -> Frame | None:
        """Return the newest frame once it is another than `after`; None when none comes in time.
        Raises a `BewareNavError` when none will come any more."""


class ControlLoop:
    """Runs the controller on a live robot until it is stopped."""

    def __init__(
        self,
        robot: LiveRobot,
        controller: RobotController,
        *,
        on_decision: Callable[[TickResult], None],
        on_verdict: Callable[[GateDecision], None],
    ) -> None:
        self._robot, self._controller = robot, controller
        self._on_decision, self._on_verdict = on_decision, on_verdict
        self._ended = threading.Event()
        self._thought_s = 0.0  # time of the monotonic clock at the end of the newest tick
        self._failure: str | None = None  # of the newest decision between two ticks
        self._ahead = SegmentationAhead(controller.segment)
        self._threads = [
            threading.Thread(target=self._think, name="think", daemon=True),
            threading.Thread(target=self._command, name="command", daemon=True),
        ]

    def start(self) -> None:
        """Start the threads."""
        self._ahead.start()
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Send zero and end the threads; a second call has no effect."""
        self._ended.set()
        think, command = self._threads
        command.join(timeout=JOIN_S)
        self._robot.send(STANDSTILL)
        think.join(timeout=JOIN_S)
        self._ahead.stop()  # not before: the think thread would wait for labels that never come

    def _think(self) -> None:
        frame: Frame | None = None
        retry_s, failure, usual_s = FRAME_WAIT_S, None, 0.0
        while not self._ended.is_set():
            try:
                segmented = self._next(frame, usual_s)
                if segmented is None:
                    continue
                frame = segmented.frame
                usual_s = segmented.took_ms / 1e3
                decision = self._controller.think(frame, clock=self._robot.now_ns, ahead=segmented)
                self._thought_s = time.monotonic()
                self._steer()  # by what has come during the tick
                if decision is not None:
                    self._on_decision(decision)
                if (failed := self._controller.failed) is not None:
                    raise failed
                retry_s, failure = FRAME_WAIT_S, None
            except Exception as error:
                # The loop survives any bug above it: the robot stands with this reason, and the
                # next frame is tried. What goes on failing, such as a robot that is gone, is logged
                # once.
                if str(error) != failure:
                    log.exception("the tick failed")
                failure = str(error)
                self._controller.note_failure(frame, error)
                self._ended.wait(retry_s)
                retry_s = min(2 * retry_s, MAX_RETRY_S)

    def _next(self, last: Frame | None, usual_s: float) -> SegmentedFrame | None:
        """Wait for the next frame with its labels, and begin with the one after it if that is there
        already; None when no frame comes in time. The robot is steered by the images that come
        meanwhile, until labels that usually take `usual_s` seconds are overdue."""
        ahead, beware = self._ahead, self._controller.intent.beware
        if ahead.in_flight is None:
            newest = self._robot.wait_frame(last, FRAME_WAIT_S)
            if newest is None:
                return None
            ahead.begin(newest, beware)
        segmented = None
        while segmented is None and not self._ended.is_set():
            waits_s = time.monotonic() - max(ahead.begun_s, self._thought_s)
            if waits_s < OVERDUE * usual_s:
                self._steer()
            segmented = ahead.take(LOOK_S)
        newest = self._robot.newest_frame()
        if segmented is not None and newest is not None and newest is not segmented.frame:
            ahead.begin(newest, beware)
        return segmented

    def _steer(self) -> None:
        """Decide by the newest frame; where that fails, what the tick has decided still holds."""
        try:
            self._controller.steer(self._robot.now_ns, newest=self._robot.newest_frame())
            self._failure = None
        except Exception as error:
            if str(error) != self._failure:  # as a tick that goes on failing, once
                log.exception("no decision between two ticks")
            self._failure = str(error)

    def _command(self) -> None:
        due = last = time.monotonic()
        failure = None
        while not self._ended.is_set():
            now = time.monotonic()
            try:
                newest = self._robot.newest_frame()
                self._on_verdict(
                    self._controller.command(
                        self._robot.now_ns, now - last, self._robot.send, newest=newest
                    )
                )
                failure = None
            except Exception as error:
                if str(error) != failure:  # as a tick that goes on failing, once
                    log.exception("the command thread continues and sends zero")
                failure = str(error)
                self._robot.send(STANDSTILL)
            last, due = now, max(due + COMMAND_PERIOD_S, now)
            self._ended.wait(max(due - time.monotonic(), 0.0))


class PeriodicThread:
    """Calls a function periodically in a thread of its own."""

    def __init__(self, act: Callable[[], None], *, period_s: float, name: str) -> None:
        self._act, self._period_s = act, period_s
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self.failure: str | None = None
        """Why the newest call has failed; None where it has not."""

    def start(self) -> None:
        """Start the thread; the first call is immediate."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread after the present call."""
        self._ended.set()
        self._thread.join(timeout=JOIN_S)

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                self._act()
                self.failure = None
            except Exception as error:
                # What goes on failing, such as a full disk, once.
                if str(error) != self.failure:
                    log.exception("the thread %r continues", self._thread.name)
                self.failure = str(error)
            self._ended.wait(self._period_s)
