"""Backing off: half a metre straight back on the operator's word, out of a tight place.

It is driving by hand in every respect but the hand: commands that expire, through the gate, out of
no beware area into another. A mission that was driving is paused meanwhile and goes on afterwards.
"""

from __future__ import annotations

import dataclasses
import logging
import threading
from collections.abc import Callable

from app.runtime.control.operator_state import OperatorState, StateHolder
from navcore.errors import BewareNavError, Refused
from navcore.geometry.transform import Pose2, Twist
from navcore.mission.mission import Phase
from navcore.robot.driver import Command

log = logging.getLogger(__name__)
Edit = Callable[[OperatorState], OperatorState]
DISTANCE_M = 0.5
"""Distance, metres."""
BACK = Twist(v_mps=-0.2, w_radps=0.0)
"""Velocity."""
PERIOD_S = 0.1
"""Time between two commands, seconds; each holds for 0.25 s."""
MAX_STEPS = 60
"""Number of commands after which backing off is given up: something is in the way."""


class BackOff:
    """Drives back in a thread of its own, one manoeuvre at a time."""

    def __init__(
        self,
        holder: StateHolder,
        *,
        drive: Callable[[Twist], Edit],
        resume: Edit,
        pose: Callable[[], Pose2],
        wait: Callable[[threading.Event], bool] = lambda ended: ended.wait(PERIOD_S),
    ) -> None:
        """`drive` gives the edit of an operator who drives by hand now, `resume` is that of one who
        goes on with a paused mission; `pose` gives the pose by odometry, or raises `Refused`
        where that is not known at present; `wait` waits for the next command and returns whether
        to end."""
        self._holder, self._drive, self._resume = holder, drive, resume
        self._pose, self._wait = pose, wait
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def is_running(self) -> bool:
        """Whether the robot backs off."""
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> None:
        """Begin; raises `Refused` while it goes on, and for the reasons of driving by hand."""
        if self.is_running:
            raise Refused("the robot is backing off already")
        begin, drive = self._pose(), self._drive(BACK)

        def begun(intent: OperatorState) -> OperatorState:
            # A robot that was leaving an area waits for the operator as soon as it is out of it.
            if intent.mission.phase is Phase.DRIVING:
                intent = dataclasses.replace(intent, mission=intent.mission.interrupt())
            return drive(intent)

        own = self._holder.change(begun).by_hand
        self._thread = threading.Thread(
            target=self._run, args=(begin, own), name="back off", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """End the thread; a second call has no effect."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(2.0)

    def _run(self, begin: Pose2, own: Command | None) -> None:
        def ended(intent: OperatorState) -> OperatorState:
            return dataclasses.replace(
                intent,
                by_hand=None if intent.by_hand is own else intent.by_hand,
                mission=dataclasses.replace(intent.mission, goes_on=False),
            )

        try:
            for _ in range(MAX_STEPS):
                if self._wait(self._ended):
                    return
                if self._pose().distance_to(begin.x_m, begin.y_m) >= DISTANCE_M:
                    break
                own = self._change(own, self._drive(BACK)).by_hand
            self._change(own, self._go_on)
        except BewareNavError as refused:
            log.info("backing off has ended: %s", refused)
        finally:
            self._holder.change(ended)

    def _change(self, own: Command | None, edit: Edit) -> OperatorState:
        """Edit the operator's state in one step; raises `Refused` unless `own` is still the newest
        command by hand: an operator drives by now, or has stopped or paused the robot."""

        def checked(intent: OperatorState) -> OperatorState:
            if intent.by_hand is not own:
                raise Refused("an operator has taken over")
            return edit(intent)

        return self._holder.change(checked)

    def _go_on(self, intent: OperatorState) -> OperatorState:
        return self._resume(intent) if intent.mission.goes_on else intent
