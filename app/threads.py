"""The console's threads: think (the navigator's tick) and command (20 times a second, alone sends to the robot).

The third, sense, lives with the link of each robot back end and fills its one-slot mailbox. The web server and viser bring
their own. Command waits on nothing but its own clock: whatever hangs above it, it sends zero by itself when the command is
too old.
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

from app.pilot import COMMAND_PERIOD_S, Pilot
from navcore.frame import Frame
from navcore.navigator import Decision
from navcore.robot import STANDSTILL, Robot
from navcore.safety import Verdict

FRAME_WAIT_S = 0.2
LONGEST_RETRY_S = 2.0
"""A tick that goes on breaking is tried again after 0.2 s, 0.4 s, … and at least this often."""
log = logging.getLogger(__name__)


ROBOT_THREADS = frozenset({"sense", "think", "command", "to-simulator", "MainThread"})
"""Threads that keep their niceness; the main thread only waits, and what it starts inherits its own."""
LATER = 5
"""Niceness of all other threads: on a busy machine each gets a third of the share of a thread of the robot."""


def put_robot_first() -> None:
    """Lower the priority of every thread of this process but the robot's; threads that those start inherit it.

    Only Linux has a niceness for each thread. Lowering a priority needs no privilege.
    """
    if not sys.platform.startswith("linux"):
        return
    for thread in threading.enumerate():
        if thread.name not in ROBOT_THREADS and thread.native_id is not None:
            with contextlib.suppress(OSError):  # it has ended meanwhile
                os.setpriority(os.PRIO_PROCESS, thread.native_id, LATER)


class LiveRobot(Robot, Protocol):
    """A robot that runs by itself: its pictures can be waited for."""

    def wait_frame(self, after: Frame | None, timeout_s: float) -> Frame | None:
        """The newest picture if it is another than `after`; None when none comes in time."""


class Loop:
    """Runs the pilot on a live robot until it is stopped."""

    def __init__(
        self,
        robot: LiveRobot,
        pilot: Pilot,
        *,
        on_decision: Callable[[Decision], None],
        on_verdict: Callable[[Verdict], None],
    ) -> None:
        self._robot, self._pilot = robot, pilot
        self._on_decision, self._on_verdict = on_decision, on_verdict
        self._ended = threading.Event()
        self._threads = [
            threading.Thread(target=self._think, name="think", daemon=True),
            threading.Thread(target=self._command, name="command", daemon=True),
        ]

    def start(self) -> None:
        """Start both threads."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Send zero, then end both threads; a second call does nothing new."""
        self._ended.set()
        think, command = self._threads
        command.join(timeout=2.0)
        self._robot.send(STANDSTILL)
        think.join(timeout=2.0)

    def _think(self) -> None:
        frame: Frame | None = None
        retry_s = FRAME_WAIT_S
        while not self._ended.is_set():
            try:
                newest = self._robot.wait_frame(frame, FRAME_WAIT_S)
                if newest is None:
                    continue
                frame = newest
                decision = self._pilot.think(frame, clock=self._robot.now_ns)
                if decision is not None:
                    self._on_decision(decision)
                retry_s = FRAME_WAIT_S
            except Exception as error:
                # The loop outlives any bug above it: the robot stands with this reason and the next picture is tried.
                log.exception("the tick failed")
                self._pilot.note_failure(frame, error)
                self._ended.wait(retry_s)
                retry_s = min(2 * retry_s, LONGEST_RETRY_S)

    def _command(self) -> None:
        due = last = time.monotonic()
        while not self._ended.is_set():
            now = time.monotonic()
            try:
                newest = self._robot.newest_frame()
                self._on_verdict(self._pilot.command(self._robot.now_ns, now - last, self._robot.send, newest=newest))
            except Exception:
                log.exception("the command thread goes on, and sends zero")
                self._robot.send(STANDSTILL)
            last, due = now, max(due + COMMAND_PERIOD_S, now)
            self._ended.wait(max(due - time.monotonic(), 0.0))


class Clockwork:
    """Does something again and again, in a thread of its own: what has to happen by the clock and not by a picture."""

    def __init__(self, act: Callable[[], None], *, period_s: float, name: str) -> None:
        self._act, self._period_s = act, period_s
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin, at once."""
        self._thread.start()

    def stop(self) -> None:
        """End; waits for what is being done."""
        self._ended.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                self._act()
            except Exception:
                log.exception("%s goes on", self._thread.name)
            self._ended.wait(self._period_s)
