"""Backing off: half a metre straight back on the operator's word, out of a tight place.

It is driving by hand in every respect but the hand: commands that expire, through the gate, out of
no beware area into another. A mission that was driving is paused meanwhile and goes on afterwards.
"""

from __future__ import annotations

import dataclasses
import logging
import threading
from collections.abc import Callable

from app.runtime.control.operator_state import StateHolder
from navcore.errors import BewareNavError, Refused
from navcore.geometry.transform import Pose2, Twist
from navcore.mission.mission import Mission, Phase

log = logging.getLogger(__name__)
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
        drive: Callable[[Twist | None], None],
        pose: Callable[[], Pose2],
        resume: Callable[[], None],
        wait: Callable[[threading.Event], bool] = lambda ended: ended.wait(PERIOD_S),
    ) -> None:
        """`drive` drives by hand, `pose` gives the present pose, `resume` goes on with a paused
        mission as an operator would; `wait` waits for the next command and returns whether to
        end."""
        self._holder, self._drive, self._pose = holder, drive, pose
        self._resume, self._wait = resume, wait
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
        # A robot that was leaving an area waits for the operator as soon as it is out of it.
        self._change_mission(
            lambda mission: mission.interrupt() if mission.phase is Phase.DRIVING else mission
        )
        try:
            self._drive(BACK)
        except BewareNavError:
            self._change_mission(_stays)
            raise
        self._thread = threading.Thread(
            target=self._run, args=(self._pose(),), name="back off", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """End the thread; a second call has no effect."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(2.0)

    def _change_mission(self, edit: Callable[[Mission], Mission]) -> None:
        self._holder.change(
            lambda intent: dataclasses.replace(intent, mission=edit(intent.mission))
        )

    def _run(self, begin: Pose2) -> None:
        try:
            for _ in range(MAX_STEPS):
                own = self._holder.intent.by_hand
                ended = self._wait(self._ended)
                if ended or own is None or self._holder.intent.by_hand is not own:
                    return  # an operator drives, or has stopped or paused the robot
                if self._pose().distance_to(begin.x_m, begin.y_m) >= DISTANCE_M:
                    break
                self._drive(BACK)
            self._drive(None)
            if self._holder.intent.mission.goes_on:
                self._resume()
        except BewareNavError as refused:
            log.info("backing off has ended: %s", refused)
        finally:
            self._change_mission(_stays)


def _stays(mission: Mission) -> Mission:
    """Return the mission that does not go on by itself."""
    return dataclasses.replace(mission, goes_on=False)
