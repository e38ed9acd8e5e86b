"""The operator's intent, the navigator and the gate, joined: what to do with a frame, and what to send to the wheels.

One pilot serves the headless episode (one thread, simulated time) and the console (threads, real time) alike. `think` and
`command` may run in different threads; what they share is a handful of references to immutable values, swapped under a lock.
"""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from dataclasses import dataclass

from navcore.beware import BewareList
from navcore.errors import BadFrame
from navcore.frame import Frame
from navcore.local_planner import Outcome
from navcore.mission import Mission, Phase
from navcore.navigator import Decision, Navigator, Order
from navcore.path import NoPath
from navcore.robot import STANDSTILL, Command, RobotProfile, Twist
from navcore.safety import COMMAND_LIFE_NS, Cause, Facts, StopReason, Verdict, guard, ranked
from navcore.zones import Zone

COMMAND_PERIOD_S = 0.05
"""How often a command is sent."""
STANDS_BELOW_MPS = 0.03
"""A robot slower than this stands, as far as arriving is concerned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Intent:
    """All that the operator wants, at one moment."""

    mission: Mission
    """Goals, and whether to drive."""
    beware: BewareList
    """What must not be touched."""
    zones: tuple[Zone, ...] = ()
    """Where the robot must not be."""
    stopped_by: str | None = None
    """Who latched the emergency stop; None when it is not latched."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Thought:
    """The outcome of the newest tick."""

    decision: Decision | None = None
    """Of the newest good frame."""
    frame_ns: int | None = None
    """Capture time of the newest frame that came in, good or bad."""
    command: Command | None = None
    """What it asks the wheels to do."""
    order: Order | None = None
    """What the operator wanted when it was decided."""
    bad_frame: str | None = None
    """Why the newest frame was refused; None when it was not."""
    failure: str | None = None
    """What broke in the newest tick; None when nothing did."""


class Pilot:
    """Joins intent, navigator and gate."""

    def __init__(self, *, navigator: Navigator, profile: RobotProfile, intent: Intent) -> None:
        self.navigator = navigator
        self.profile = profile
        self._lock = threading.Lock()
        self._intent = intent
        self._thought = Thought()
        self._sent = STANDSTILL

    @property
    def intent(self) -> Intent:
        """The operator's will, as of now."""
        return self._intent

    @property
    def thought(self) -> Thought:
        """The newest tick's outcome."""
        return self._thought

    @property
    def sent(self) -> Twist:
        """What was last sent to the wheels."""
        return self._sent

    def change(self, edit: Callable[[Intent], Intent]) -> Intent:
        """Replace the intent by `edit(intent)`, as one step; when `edit` raises, nothing has changed."""
        with self._lock:
            self._intent = edit(self._intent)
            return self._intent

    def change_mission(self, edit: Callable[[Mission], Mission]) -> Mission:
        """Replace the mission by `edit(mission)`, as one step."""
        return self.change(lambda intent: dataclasses.replace(intent, mission=edit(intent.mission))).mission

    def think(self, frame: Frame, *, clock: Callable[[], int]) -> Decision | None:
        """One tick; None when the frame was refused. `clock` dates the command, after the work is done."""
        intent = self._intent
        goal = intent.mission.goal
        order = _order(intent)
        try:
            decision = self.navigator.tick(frame, order)
        except BadFrame as error:
            self._thought = dataclasses.replace(self._thought, frame_ns=frame.stamp_ns, bad_frame=str(error), command=None)
            return None
        command = Command(twist=decision.motion.twist, stamp_ns=clock()) if goal else None
        self._thought = Thought(decision=decision, frame_ns=frame.stamp_ns, command=command, order=order)
        if goal and decision.motion.outcome is Outcome.ARRIVED and abs(frame.twist.v_mps) < STANDS_BELOW_MPS:
            self.change_mission(lambda mission: mission.arrive() if mission.goal == goal else mission)
        return decision

    def note_failure(self, frame: Frame, error: Exception) -> None:
        """The tick broke: stand, and say so, until one succeeds."""
        failure = f"{type(error).__name__}: {error}"
        self._thought = dataclasses.replace(self._thought, frame_ns=frame.stamp_ns, failure=failure, command=None)

    def command(self, now_ns: int, period_s: float, send: Callable[[Twist], None] = lambda twist: None) -> Verdict:
        """Decide what to send now, `period_s` after the last time, and send it.

        A mission that does not drive never moves the robot. Deciding and sending are one step against `change`: once a stop, a
        cancel or a zone is acknowledged, nothing decided before it is sent any more.
        """
        with self._lock:
            if period_s * 1e9 > COMMAND_LIFE_NS:
                self._sent = STANDSTILL  # the driver has forgotten the last command by now
            verdict = self._verdict(now_ns, period_s)
            self._sent = verdict.twist
            send(verdict.twist)
        return verdict

    def reasons(self, now_ns: int) -> tuple[StopReason, ...]:
        """Why the robot stands although it was told to drive, as of now; the most severe first."""
        return self._verdict(now_ns, 0.0).reasons

    def _verdict(self, now_ns: int, period_s: float) -> Verdict:
        intent, thought = self._intent, self._thought
        # A velocity decided before the operator's last word is void; the next tick brings one that has heard it.
        driving = intent.mission.phase is Phase.DRIVING and thought.order == _order(intent)
        facts = Facts(
            now_ns=now_ns,
            frame_ns=thought.frame_ns,
            stopped_by=intent.stopped_by,
            command=thought.command if driving else None,
        )
        verdict = guard(facts, sent=self._sent, period_s=period_s, profile=self.profile)
        return Verdict(twist=verdict.twist, reasons=ranked([*verdict.reasons, *self._obstacles(intent, thought)]))

    def _obstacles(self, intent: Intent, thought: Thought) -> list[StopReason]:
        """Why the planners, rather than the gate, keep the robot where it is."""
        found = []
        if thought.bad_frame is not None:
            found.append(StopReason(cause=Cause.BAD_FRAME, text=f"The camera's picture is refused: {thought.bad_frame}."))
        if thought.failure is not None:
            found.append(StopReason(cause=Cause.PLANNER_FAILED, text=f"The navigation failed: {thought.failure}."))
        if intent.mission.phase is Phase.PAUSED:
            found.append(StopReason(cause=Cause.PAUSED, text="The mission is paused; resume it to drive on."))
        if intent.mission.phase is not Phase.DRIVING or thought.decision is None:
            return found
        route, outcome = thought.decision.route, thought.decision.motion.outcome
        if route is not None and isinstance(route.outcome, NoPath):
            found.append(StopReason(cause=Cause.NO_PATH, text=f"There is no path to the goal: {route.outcome.reason}."))
        if outcome is Outcome.IN_ZONE:
            found.append(StopReason(cause=Cause.IN_ZONE, text="The robot stands in a beware area; edit or move the area."))
        if outcome is Outcome.BOXED_IN:
            found.append(StopReason(cause=Cause.BOXED_IN, text="No motion keeps clear of what stands near the robot."))
        return found


def _order(intent: Intent) -> Order:
    goal = intent.mission.goal
    return Order(goal=(goal.x_m, goal.y_m) if goal else None, beware=intent.beware, zones=intent.zones)
