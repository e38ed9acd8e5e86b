"""The operator's intent, the navigator and the gate, joined: what to do with a frame, and what to
send to the wheels.

One pilot serves the headless episode (one thread, simulated time) and the console (threads, real
time) alike. `think` and `command` may run in different threads; what they share is a handful of
references to immutable values, swapped under a lock.
"""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from app.runtime.stage_timer import TICK, StageTimer
from navcore.behaviours.assisted_teleop import stays_out
from navcore.control.motion import ControllerState, Motion
from navcore.costmap.cell_description import describe_cell
from navcore.errors import BadConfiguration, BadFrame
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Mission, Phase
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.navigator import Navigator, TickResult
from navcore.planning.path import NoPath, Path, Reason
from navcore.robot.driver import Command
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile
from navcore.safety.collision_monitor import RecentObstacles
from navcore.safety.gate import (
    BLOCKED_NS,
    COMMAND_LIFE_NS,
    Cause,
    GateDecision,
    GateInput,
    StopReason,
    gate,
    pushes_in_vain,
    ranked,
)
from navcore.safety.sensor_monitor import SensorFault, SensorMonitor

COMMAND_PERIOD_S = 0.05
"""How often a command is sent."""
MOVING = (Phase.DRIVING, Phase.LEAVING)
"""Phases of a mission in which the robot may move."""
STANDS_BELOW_MPS = 0.03
"""A robot slower than this stands, as far as arriving is concerned."""
MEANWHILE_NS = 100_000_000
"""A command so little younger than the clock's reading was decided while the command thread waited
for its turn."""
HAND_LIFE_NS = COMMAND_LIFE_NS
"""How long a velocity that somebody gives by hand is good for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorState:
    """All that the operator wants, at one moment."""

    mission: Mission
    """Goals, and whether to drive."""
    beware: BewareList
    """What must not be touched."""
    zones: tuple[Zone, ...] = ()
    """Where the robot must not be."""
    stopped_by: str | None = None
    """Who latched the emergency stop; None when it is not latched."""
    by_hand: Command | None = None
    """What a hand on the console asked for last; None when there is none."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TickState:
    """The outcome of the newest tick."""

    decision: TickResult | None = None
    """Of the newest good frame."""
    frame_ns: int | None = None
    """Capture time of the newest frame that came in, good or bad."""
    command: Command | None = None
    """What it asks the wheels to do."""
    order: NavigationRequest | None = None
    """What the operator wanted when it was decided."""
    bad_frame: str | None = None
    """Why the newest frame was refused; None when it was not."""
    failure: str | None = None
    """What broke in the newest tick; None when nothing did."""


class RobotController:
    """Joins intent, navigator and gate."""

    def __init__(
        self,
        *,
        navigator: Navigator,
        profile: RobotProfile,
        intent: OperatorState,
        timer: StageTimer | None = None,
    ) -> None:
        """`timer`: the one that the navigator's stages were wrapped with; it times the ticks too."""
        self.navigator = navigator
        self.timer = timer or StageTimer()
        """Durations of ticks and stages."""
        self._tick = self.timer.timed(TICK, navigator.tick)
        self.profile = profile
        self._lock = threading.Lock()
        self._intent = intent
        self._thought = TickState()
        self._sent = STANDSTILL
        # Two observers of the same frames: one for what enters the map, one for the gate, which
        # hears of a frame first and waits for no tick.
        self._mapped, self._watched = SensorMonitor(), SensorMonitor()
        self._near = RecentObstacles()
        self._pushing_ns: int | None = None
        self._corrected: dict[int, Pose2] = {}
        self._put_down = False

    @property
    def intent(self) -> OperatorState:
        """The operator's will, as of now."""
        return self._intent

    @property
    def thought(self) -> TickState:
        """The newest tick's outcome."""
        return self._thought

    @property
    def sent(self) -> Twist:
        """What was last sent to the wheels."""
        return self._sent

    def change(self, edit: Callable[[OperatorState], OperatorState]) -> OperatorState:
        """Replace the intent by `edit(intent)`, as one step; when `edit` raises, nothing has
        changed."""
        with self._lock:
            self._intent = edit(self._intent)
            return self._intent

    def change_mission(self, edit: Callable[[Mission], Mission]) -> Mission:
        """Replace the mission by `edit(mission)`, as one step."""
        return self.change(
            lambda intent: dataclasses.replace(intent, mission=edit(intent.mission))
        ).mission

    def correct_poses(self, poses: Mapping[int, Pose2]) -> None:
        """Past poses as they are known by now, e.g. after a loop closure; the map follows before
        the next tick.

        Raises `BadConfiguration` for a pose ID that is not on the map, and then has changed
        nothing.
        """
        known = len(self.navigator.map.poses)  # it only grows
        for pose_id in poses:
            if not 0 <= pose_id < known:
                raise BadConfiguration(f"pose ID {pose_id} is not on the map, which has {known}")
        with self._lock:
            self._corrected |= poses

    def think(self, frame: Frame, *, clock: Callable[[], int]) -> TickResult | None:
        """One tick; None when the frame was refused or shows nothing new. `clock` dates the
        command, after the work is done."""
        intent = self._intent
        goal = intent.mission.goal
        order = request_of(intent)
        with self._lock:
            corrected, self._corrected = self._corrected, {}
            put_down, self._put_down = self._put_down, False
            senses = self._mapped = self._mapped.after(frame, self.profile)
        if corrected:  # here and not where they come in: only this thread touches the map
            self.navigator.map.correct(corrected)
        if put_down:
            self.navigator.reset_pose()
        if senses.doubt is not None or senses.repeats:
            # What cannot be true must not enter the map; the gate says why the robot stands, or the
            # command just expires.
            command = None if senses.doubt is not None else self._thought.command
            self._thought = dataclasses.replace(
                self._thought, frame_ns=frame.stamp_ns, command=command
            )
            return None
        try:
            decision: TickResult = self._tick(frame, order)
        except BadFrame as error:
            self._thought = dataclasses.replace(
                self._thought, frame_ns=frame.stamp_ns, bad_frame=str(error), command=None
            )
            return None
        command = (
            Command(twist=decision.motion.twist, stamp_ns=clock()) if goal or order.leave else None
        )
        self._thought = TickState(
            decision=decision, frame_ns=frame.stamp_ns, command=command, order=order
        )
        # Without a path the end of the way is where the robot looks at what closes it, and never
        # the goal.
        led_there = decision.route is not None and isinstance(decision.route.outcome, Path)
        if (
            led_there
            and decision.motion.outcome is ControllerState.ARRIVED
            and abs(frame.twist.v_mps) < STANDS_BELOW_MPS
        ):
            if goal:
                self.change_mission(
                    lambda mission: mission.arrive() if mission.goal == goal else mission
                )
            elif order.leave:
                self.change_mission(
                    lambda mission: mission.left() if mission.phase is Phase.LEAVING else mission
                )
        return decision

    def note_failure(self, frame: Frame | None, error: Exception) -> None:
        """The tick of a frame broke, or none could be had: stand, and say so, until one succeeds."""
        failure, frame_ns = (
            f"{type(error).__name__}: {error}",
            self._thought.frame_ns if frame is None else frame.stamp_ns,
        )
        self._thought = dataclasses.replace(
            self._thought, frame_ns=frame_ns, failure=failure, command=None
        )

    def command(
        self,
        clock: Callable[[], int],
        period_s: float,
        send: Callable[[Twist], None] = lambda twist: None,
        *,
        newest: Frame | None,
    ) -> GateDecision:
        """Decide what to send now, `period_s` after the last time, and send it. `newest` is the
        last frame that came in.

        `clock` gives the time in ns. It is read last of all: what has expired while this waited or
        looked is not sent.

        A mission that does not drive never moves the robot. Deciding and sending are one step
        against `change`: once a stop, a cancel or a zone is acknowledged, nothing decided before it
        is sent any more.
        """
        with self._lock:
            if period_s * 1e9 > COMMAND_LIFE_NS:
                self._sent = STANDSTILL  # the driver has forgotten the last command by now
            self._watch(clock(), newest)
            verdict = self._verdict(clock(), period_s)
            self._sent = verdict.twist
            send(verdict.twist)
        return verdict

    @property
    def pose_in_doubt(self) -> bool:
        """Whether odometry has jumped and not come back: the robot stands until `trust_pose`."""
        return self._watched.doubt is SensorFault.POSE or self._mapped.doubt is SensorFault.POSE

    def trust_pose(self) -> None:
        """The operator says that the next frame's pose and stamp are true, whatever came before."""
        with self._lock:
            if self.pose_in_doubt:
                self._put_down = True
                self._near = (
                    RecentObstacles()
                )  # where it was is not told by this pose; else what is out of sight is still there
            self._mapped = self._watched = SensorMonitor()

    def _watch(self, now_ns: int, newest: Frame | None) -> None:
        """Look at the newest frame, independently of the tick, and at whether the wheels obey."""
        if newest is not None and newest is not self._watched.newest:
            self._watched = self._watched.after(newest, self.profile)
            if self._watched.newest_is_trusted:
                self._near = self._near.after(newest)
        held = self._pushing_ns is not None and now_ns - self._pushing_ns >= BLOCKED_NS
        if self._intent.mission.phase not in MOVING:
            self._pushing_ns = None
        elif newest is None or not pushes_in_vain(self._sent, newest.twist, self.profile):
            self._pushing_ns = self._pushing_ns if held else None
        elif self._pushing_ns is None:
            self._pushing_ns = now_ns

    def reasons(self, now_ns: int) -> tuple[StopReason, ...]:
        """Why the robot stands although it was told to drive, as of now; the most severe first."""
        return self._verdict(now_ns, 0.0).reasons

    def _verdict(self, now_ns: int, period_s: float) -> GateDecision:
        intent, thought, hand = self._intent, self._thought, self._slowed(self.hand(now_ns))
        # A velocity decided before the operator's last word is void; the next tick brings one that
        # has heard it.
        driving = intent.mission.phase in MOVING and thought.order == request_of(intent)
        command = hand or (thought.command if driving else None)
        if command is not None and now_ns < command.stamp_ns <= now_ns + MEANWHILE_NS:
            now_ns = command.stamp_ns
        facts = GateInput(
            now_ns=now_ns,
            frame_ns=self._watched.newest.stamp_ns if self._watched.newest is not None else None,
            stopped_by=intent.stopped_by,
            command=command,
            senses=self._watched,
            near=self._near.points,
            pushing_ns=self._pushing_ns,
        )
        verdict = gate(facts, sent=self._sent, period_s=period_s, profile=self.profile)
        found = self._objections_to(hand) if hand is not None else self._obstacles(intent, thought)
        twist = STANDSTILL if hand is not None and found else verdict.twist
        return GateDecision(twist=twist, reasons=ranked([*verdict.reasons, *found]))

    def hand(self, now_ns: int) -> Command | None:
        """What somebody asks for by hand, while it is fresh and no mission drives."""
        command = self._intent.by_hand
        if command is None or self._intent.mission.phase in MOVING:
            return None
        return command if 0 <= now_ns - command.stamp_ns <= HAND_LIFE_NS else None

    def _slowed(self, hand: Command | None) -> Command | None:
        """The same command, as slow as the operator's speed limits want it."""
        newest = self._watched.newest
        if hand is None or newest is None:
            return hand
        asked = Motion(twist=hand.twist, outcome=ControllerState.FOLLOW)
        return dataclasses.replace(
            hand,
            twist=self.navigator.limit(asked, self._intent.zones, newest.pose, newest.twist).twist,
        )

    def _objections_to(self, hand: Command) -> list[StopReason]:
        """A hand may go wherever the gate lets it, but into no zone, and into nothing that the map
        has of the beware list.

        The zones are those of now: they bind a hand before the first tick, too, and when ticks
        fail.
        """
        decision, newest, spec = (
            self._thought.decision,
            self._watched.newest,
            self.navigator.map.spec,
        )
        seen = None if decision is None else decision.occupancy
        if newest is None:
            return []
        if stays_out(
            hand.twist, newest.pose, self.profile, zones=self._intent.zones, spec=spec, seen=seen
        ):
            return []
        return [
            StopReason(
                cause=Cause.BEWARE_AHEAD,
                text="A beware area lies that way; drive by hand in another direction.",
            )
        ]

    def _obstacles(self, intent: OperatorState, thought: TickState) -> list[StopReason]:
        """Why the planners, rather than the gate, keep the robot where it is."""
        found = []
        if (
            thought.bad_frame is not None and not self._watched.malformed
        ):  # then the gate has said so
            found.append(
                StopReason(
                    cause=Cause.BAD_FRAME,
                    text=f"The camera's picture is refused: {thought.bad_frame}.",
                )
            )
        if thought.failure is not None:
            found.append(
                StopReason(
                    cause=Cause.PLANNER_FAILED, text=f"The navigation failed: {thought.failure}."
                )
            )
        if intent.mission.phase is Phase.PAUSED:
            found.append(
                StopReason(cause=Cause.PAUSED, text="The mission is paused; resume it to drive on.")
            )
        if intent.mission.phase not in MOVING or thought.decision is None:
            return found
        route, outcome = thought.decision.route, thought.decision.motion.outcome
        if (
            route is not None
            and isinstance(route.outcome, NoPath)
            and thought.decision.motion.twist == STANDSTILL
        ):
            why = _why_no_path(intent, thought.decision, route.outcome)
            found.append(
                StopReason(cause=Cause.NO_PATH, text=f"There is no path to the goal: {why}.")
            )
        if outcome is ControllerState.IN_ZONE:
            found.append(
                StopReason(
                    cause=Cause.IN_ZONE,
                    text="The robot stands in a beware area: have it leave, or change the area.",
                )
            )
        if outcome is ControllerState.BOXED_IN:
            found.append(
                StopReason(
                    cause=Cause.BOXED_IN,
                    text="No motion keeps clear of what stands near the robot.",
                )
            )
        if outcome is ControllerState.GIVEN_UP:
            tried = "it has waited, backed off and looked round, and found no way"
            text = f"The robot gives up: {tried}. Clear its way, or pick another goal."
            found.append(StopReason(cause=Cause.BOXED_IN, text=text))
        if outcome is ControllerState.YIELD:
            found.append(
                StopReason(
                    cause=Cause.YIELDING,
                    text="Somebody is in the robot's way; it waits until he has passed.",
                )
            )
        return found


def _why_no_path(intent: OperatorState, decision: TickResult, outcome: NoPath) -> str:
    goal, grid = intent.mission.goal, decision.occupancy.grid
    if outcome.reason is not Reason.GOAL_BLOCKED or goal is None:
        return str(outcome.reason)
    return f"{outcome.reason}, it lies {describe_cell(grid, grid.spec.cell(goal.x_m, goal.y_m))}"


def request_of(intent: OperatorState) -> NavigationRequest:
    goal = intent.mission.goal
    return NavigationRequest(
        goal=(goal.x_m, goal.y_m) if goal else None,
        beware=intent.beware,
        zones=intent.zones,
        goal_yaw_rad=goal.yaw_rad if goal else None,
        leave=intent.mission.phase is Phase.LEAVING,
    )
