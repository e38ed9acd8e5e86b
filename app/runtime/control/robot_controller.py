"""The robot controller: operator's state, navigator and safety gate joined.

One controller serves the headless episode (one thread, simulated time) and the console (threads,
real time) alike. `think` and `command` may run in different threads; they share a few references
to immutable values, replaced under a lock.
"""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from app.runtime.control.background import Background, InlineBackground
from app.runtime.control.held_timer import HeldTimer
from app.runtime.control.map_requests import MapRequests, ShownPlace
from app.runtime.control.operator_state import MOVING, OperatorState, PlaceSearch
from app.runtime.control.segmentation_ahead import SegmentedFrame
from app.runtime.control.stage_timer import TICK, StageTimer
from app.runtime.control.steering import may_steer, steered, twist_of
from app.runtime.control.stop_reasons import hand_stops, planner_stops
from app.runtime.control.tick_state import TickState
from app.runtime.control.watched_frames import watched_after
from navcore.behaviours.search_turn import SearchTurn
from navcore.config.safety import DEFAULT_SAFETY, SensorMonitorConfig
from navcore.control.motion import ControllerState, Motion
from navcore.errors import BadFrame, BewareNavError, Refused
from navcore.geometry.transform import IDENTITY, STANDSTILL, Matrix, Pose2, Twist
from navcore.localisation.cell_margins import GrownCells
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.pose_ids import check_movable
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Mission, Phase
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator, TickResult
from navcore.perception.labels import Labels
from navcore.robot.driver import Command
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile
from navcore.safety.collision_monitor import RecentObstacles
from navcore.safety.gate import (
    GateDecision,
    GateInput,
    StopReason,
    gate,
    ranked,
    wheels_blocked,
)
from navcore.safety.keep_out_monitor import KeepOuts
from navcore.safety.sensor_monitor import SensorMonitor
from navcore.safety.sent_motion import SentMotion
from navcore.safety.stopping import check_stopping
from web.interface.sites import at_another_site

COMMAND_PERIOD_S = 0.05
"""Time between two commands, seconds."""
STANDSTILL_MPS = 0.03
"""Speed below which the robot may have arrived, m/s."""
STANDSTILL_RADPS = 0.05
"""Yaw rate below which the robot stands, rad/s."""
CLOCK_SLACK_NS = 100_000_000
"""A command that is younger than the clock's reading by at most this much was decided while the
command thread waited for the lock, nanoseconds."""
HAND_LIFE_NS = DEFAULT_SAFETY.gate.command_life_ns
"""Lifetime of a command of teleoperation, nanoseconds."""
REASONS_NS = 2 * round(COMMAND_PERIOD_S * 1e9)
"""Age from which the reasons of a decision are found again though nothing has changed,
nanoseconds."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Found:
    """Reasons, and the values that they were found for."""

    now_ns: int
    intent: OperatorState
    tick_state: TickState
    watched: SensorMonitor
    reasons: tuple[StopReason, ...]


class RobotController:
    """Decides what to do with a frame (`think`) and what to send to the wheels (`command`)."""

    def __init__(
        self,
        *,
        navigator: Navigator,
        profile: RobotProfile,
        intent: OperatorState,
        timer: StageTimer | None = None,
        background: Background | None = None,
        sensors: SensorMonitorConfig = DEFAULT_SAFETY.sensors,
    ) -> None:
        """`timer`: the timer of the navigator's stages, which times the ticks too. `background`
        runs what the tick does not wait for; by default at once, for simulated time. `sensors`:
        which frames are plausible. Raises `BadConfiguration` for a platform that the safety gate
        could not stop in time."""
        check_stopping(profile)
        self._sensors = sensors
        self._background = background or InlineBackground()
        self.navigator = navigator
        self.timer = timer or StageTimer()
        """Durations of the ticks and their stages."""
        self.profile = profile
        self._lock, self._segmenting = threading.Lock(), threading.Lock()
        self._intent = intent
        self._listeners: list[Callable[[OperatorState], None]] = []
        self._tick_state = TickState()
        self._sent = SentMotion()
        # Two monitors of the same frames: for what enters the map, and for the gate, which gets a
        # frame first and waits for no tick.
        self._mapped, self._watched = SensorMonitor(), SensorMonitor()
        self._recent_obstacles = RecentObstacles()
        self._tried: Frame | None = None  # newest frame by which `steer` has tried since a tick
        self._blocked_since_ns: int | None = None
        self._held = HeldTimer()
        self._found: _Found | None = None
        self._requests = MapRequests()
        self._search, self._was_located = SearchTurn(), False
        self.failed: Exception | None = None
        """What failed beside the newest tick, whose result counts; for who called `think`."""

    @property
    def intent(self) -> OperatorState:
        """The operator's state at present."""
        return self._intent

    @property
    def tick_state(self) -> TickState:
        """Outcome of the newest tick."""
        return self._tick_state

    @property
    def sent(self) -> Twist:
        """Velocity that was last sent to the wheels."""
        return self._sent.twist

    def change(self, edit: Callable[[OperatorState], OperatorState]) -> OperatorState:
        """Replace the operator's state by `edit(state)` in one step; nothing changes when `edit`
        raises."""
        with self._lock:
            return self._replace(edit(self._intent))

    def on_change(self, listener: Callable[[OperatorState], None]) -> None:
        """Call `listener` with each new operator's state, in order. It runs in the thread that
        changes the state, so it must be quick and must not change it."""
        self._listeners.append(listener)

    def change_mission(self, edit: Callable[[Mission], Mission]) -> Mission:
        """Replace the mission by `edit(mission)` in one step."""
        return self.change(
            lambda intent: dataclasses.replace(intent, mission=edit(intent.mission))
        ).mission

    def correct_poses(self, poses: Mapping[int, Pose2], *, site_id: str | None = None) -> None:
        """Correct past poses, by pose ID, e.g. after a loop closure; the map follows before the
        next tick. `site_id` as for `place_robot`.

        Raises `BadConfiguration`, and changes nothing, for a pose ID that is not on the map, or
        belongs to a loaded one.
        """
        pose_ids = self.navigator.map.pose_ids
        check_movable(poses, len(pose_ids), pose_ids.frozen)
        with self._lock:
            self._require_site(site_id)
            self._ask(poses={**self._requests.poses, **poses})

    def edit_map(self, edit: Callable[[PointMap], None]) -> None:
        """Have the think thread edit the map before the next tick, after the edits before."""
        with self._lock:
            self._ask(edits=(*self._requests.edits, edit))

    def finish_edits(self) -> None:
        """Do what was asked of the map, when no tick will come that does it."""
        with self._lock:
            requests, self._requests = self._requests, MapRequests()
        requests.apply(self.navigator, None)

    def place_robot(
        self,
        T_map_base: Pose2,
        covariance: Matrix,
        *,
        is_sure: bool = True,
        site_id: str | None = None,
    ) -> None:
        """Set the pose of the robot, with its (3, 3) covariance, before the next tick; unless it
        `is_sure`, it has to prove itself. `site_id`: that of the site for whose map it is meant, if
        it may have changed; then raises `OtherSite`."""
        shown = ShownPlace(T_map_base=T_map_base, covariance=covariance, is_sure=is_sure)
        with self._lock:
            self._require_site(site_id)
            self._ask(place=shown, search=False)

    def enter_site(
        self, edit: Callable[[OperatorState], OperatorState], replace_map: Callable[[], None]
    ) -> None:
        """Replace the operator's state now, and the map before the next tick, where `replace_map`
        runs in the think thread. Raises `Refused`, and changes nothing, unless the robot stands."""
        with self._lock:
            self.require_standing()
            self._replace(edit(self._intent))
            # What was asked before is about the map before, but for the pose by odometry.
            self._requests = MapRequests(
                replace_map=replace_map, trust_pose=self._requests.trust_pose
            )

    def _require_site(self, site_id: str | None) -> None:
        """Raise `OtherSite` where a site is named that is not the one in use. For a caller with the
        lock."""
        if site_id not in (None, self._intent.site_id):
            raise at_another_site()

    def require_standing(self, then: str = "change the site") -> None:
        """Raise `Refused` while the robot moves or a mission drives; `then` names what was
        asked."""
        newest = self._watched.newest
        if self._intent.mission.phase in MOVING:
            raise Refused(
                f"the mission is {self._intent.mission.phase}; pause or cancel it, then {then}"
            )
        twist = STANDSTILL if newest is None else newest.twist
        moves = abs(twist.v_mps) > STANDSTILL_MPS or abs(twist.w_radps) > STANDSTILL_RADPS
        if moves or self.sent != STANDSTILL:
            raise Refused(f"the robot moves; let it stand, then {then}")

    def search_place(self, *, site_id: str | None = None) -> None:
        """Forget the place, and turn round to find it in the whole map. `site_id` as for
        `place_robot`. Raises `Refused`, and changes nothing, unless the robot stands and no stop is
        latched."""
        with self._lock:
            self._require_site(site_id)
            self.require_standing("look for its place")
            if self._intent.stopped_by is not None:
                raise Refused("the emergency stop is latched; reset it first")
            self._replace(dataclasses.replace(self._intent, search=PlaceSearch.TURNING))
            self._search = SearchTurn()
            self._ask(search=True, place=None)

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Label a frame for `think`, one at a time, in any thread. Raises `BadFrame`."""
        with self._segmenting:
            return self.navigator.segment(frame, beware)

    def think(
        self, frame: Frame, *, clock: Callable[[], int], ahead: SegmentedFrame | None = None
    ) -> TickResult | None:
        """Run one tick; None when the frame was refused or shows nothing new.

        `clock` gives the time in ns, which no frame may be ahead of, and dates the command when
        the tick has ended. `ahead`: the same frame, labelled beside the tick before.
        """
        self.failed, self._tried, now_ns = None, None, clock()
        with self._lock:
            intent = self._intent
            requests, self._requests = self._requests, MapRequests()
            senses = self._mapped = self._mapped.after(
                frame, self.profile, self._sensors, now_ns=now_ns
            )
        is_refused = senses.fault is not None or senses.repeats
        request = intent.request
        if requests.replace_map is not None:
            self._background.discard()  # it computes on the map before
        if (outcome := self._background.poll()) is not None:
            try:
                self.navigator.take(outcome)
            except Exception as error:
                self.failed = error
        later = requests  # all of them, where the map cannot be replaced
        try:
            later = requests.apply(self.navigator, None if is_refused else frame)
        finally:
            with self._lock:
                self._requests = later.before(self._requests)
        if is_refused:
            # An implausible frame must not enter the map; the gate says why the robot stands, or
            # the command just expires.
            command = None if senses.fault is not None else self._tick_state.command
            self._tick_state = dataclasses.replace(
                self._tick_state, frame_ns=frame.stamp_ns, command=command
            )
            return None
        try:
            decision = self._timed_tick(frame, request, ahead)
        except BadFrame as error:
            self._tick_state = dataclasses.replace(
                self._tick_state, frame_ns=frame.stamp_ns, bad_frame=str(error), command=None
            )
            return None
        try:
            self._follow(decision, frame, intent, clock)
        except Exception as error:  # a correction by the tick is returned all the same
            self.failed = error
            self.note_failure(frame, error)
        return decision

    def steer(self, clock: Callable[[], int], *, newest: Frame | None) -> None:
        """Decide again by a frame that is newer than that of the last decision, while labels are
        waited for: called by the thread that calls `think`."""
        if newest is None or newest is self._tried or not may_steer(self._tick_state, newest):
            return
        self._tried = newest
        with self._lock:
            intent, before = self._intent, (self._watched, self._recent_obstacles)
            is_elsewhere = intent.searching or self._requests.concerns_place
        if not is_elsewhere:
            # Kept by the command thread alone, which may have read the frame before this one.
            watched = watched_after(before, newest, self.profile, self._sensors, now_ns=clock())
            last, request = self._tick_state, intent.request
            self._tick_state = steered(last, self.navigator, watched, request, clock)

    def _follow(
        self, decision: TickResult, frame: Frame, intent: OperatorState, clock: Callable[[], int]
    ) -> None:
        """Do what follows from a tick for the robot, the mission and the next task."""
        goal, request = intent.mission.goal, intent.request
        command = (
            Command(twist=twist_of(decision, self.navigator), stamp_ns=clock())
            if (goal or request.leave) and decision.place.is_known
            else None
        )
        if intent.searching:
            command = self._turn_round(frame, decision.place, clock)
        self._tick_state = TickState(
            decision=decision,
            frame_ns=frame.stamp_ns,
            command=command,
            request=request,
            zone_covariances=self.navigator.zone_margins.covariances(request.zones, decision.place),
            waits_for_correction=self.navigator.waits_for_standstill,
        )
        if self._background.is_idle and (task := self.navigator.next_task()) is not None:
            self._background.submit(task)
        state, was_known = decision.place.state, self._was_located
        self._was_located = decision.place.is_known
        if state is LocalisationState.LOST or (was_known and not self._was_located):
            # The robot never goes on by itself: where it is then is for the operator to see.
            self.change_mission(Mission.halt)
        # At a viewpoint before a gap the robot has not arrived at the goal.
        on_path = decision.route is not None and decision.route.reaches_goal
        if (
            on_path
            and decision.place.is_known
            and decision.motion.outcome is ControllerState.ARRIVED
            and abs(frame.twist.v_mps) < STANDSTILL_MPS
        ):
            if goal:
                self.change_mission(
                    lambda mission: mission.arrive() if mission.goal == goal else mission
                )
            elif request.leave:
                self.change_mission(
                    lambda mission: mission.left() if mission.phase is Phase.LEAVING else mission
                )

    def _ask(self, **requests: Any) -> None:
        self._requests = dataclasses.replace(self._requests, **requests)

    def _replace(self, intent: OperatorState) -> OperatorState:
        self._intent = intent
        for listener in self._listeners:
            listener(intent)
        return intent

    def _timed_tick(
        self, frame: Frame, request: NavigationRequest, ahead: SegmentedFrame | None
    ) -> TickResult:
        """Run the tick; its duration counts the segmentation, wherever that was done."""
        with self.timer.measure(TICK, before_ms=0.0 if ahead is None else ahead.took_ms):
            labels = None
            if ahead is not None:
                labels = ahead.labels_by(request.beware) or self.segment(frame, request.beware)
            with self._lock:
                if held := self._held.is_over(frame.stamp_ns):
                    self._held = HeldTimer()  # what the robot tries next is judged afresh
            return self.navigator.tick(frame, request, labels, held=held)

    def _turn_round(
        self, frame: Frame, place: LocalisationEstimate, clock: Callable[[], int]
    ) -> Command | None:
        """Return the command of a robot that looks for its place, until it has found it or turned
        round, or cannot turn."""
        self._search, now_ns = self._search.after(frame.pose, frame.stamp_ns), clock()
        if place.is_known or self._search.is_over:
            self._end_search(PlaceSearch.NONE)
        elif self._search.has_failed or self._wheels_block(now_ns):
            self._end_search(PlaceSearch.FAILED)
        else:
            return Command(twist=self._search.twist, stamp_ns=now_ns)
        return None

    def _end_search(self, search: PlaceSearch) -> None:
        """End the turn, unless the operator has ended it meanwhile."""
        self.change(
            lambda intent: (
                dataclasses.replace(intent, search=search) if intent.searching else intent
            )
        )

    def note_failure(self, frame: Frame | None, error: Exception) -> None:
        """Note that a tick failed, or that no frame could be read; the robot then stands with this
        reason until a tick succeeds."""
        self._tick_state = dataclasses.replace(
            self._tick_state,
            frame_ns=self._tick_state.frame_ns if frame is None else frame.stamp_ns,
            failure=str(error)
            if isinstance(error, BewareNavError)
            else f"{type(error).__name__}: {error}",
            command=None,
        )

    def command(
        self,
        clock: Callable[[], int],
        period_s: float,
        send: Callable[[Twist], None] = lambda twist: None,
        *,
        newest: Frame | None,
    ) -> GateDecision:
        """Decide what to send now, `period_s` after the last command, and send it.

        `newest` is the newest frame. `clock` gives the time in ns and is read last, so that a
        command that expired while this waited for the lock or checked the frame is not sent.

        A mission that does not drive never moves the robot. Deciding and sending are one step
        with respect to `change`: once a stop, a cancel or a zone is acknowledged, nothing decided
        before it is sent any more.
        """
        with self._lock:
            now_ns = clock()
            if period_s * 1e9 > DEFAULT_SAFETY.gate.command_life_ns:
                # The last command has expired in the driver, and the wheels stood meanwhile.
                self._sent = self._sent.after(STANDSTILL, now_ns)
                if not self._wheels_block(now_ns - round(period_s * 1e9)):
                    self._blocked_since_ns = None
            self._watch(now_ns, newest)
            now_ns = clock()
            verdict = self._verdict(now_ns, period_s)
            self._sent = self._sent.after(verdict.twist, now_ns)
            newest = self._watched.newest
            self._held = self._held.after(verdict, None if newest is None else newest.stamp_ns)
            send(verdict.twist)
        return verdict

    @property
    def sensors_in_doubt(self) -> bool:
        """Whether the robot stands until pose and stamps agree again, or until `trust_pose`."""
        return self._watched.awaits_reset or self._mapped.awaits_reset

    def trust_pose(self) -> None:
        """Accept pose and stamp of the next frame, whatever came before, on the operator's word;
        without a doubt nothing is accepted: what comes later the operator has not seen."""
        with self._lock:
            if not self.sensors_in_doubt:
                return
            self._ask(trust_pose=True)
            # The new pose does not tell where the obstacles are that are out of view.
            self._recent_obstacles = RecentObstacles()
            self._mapped = self._watched = SensorMonitor()

    def _watch(self, now_ns: int, newest: Frame | None) -> None:
        """Check the newest frame, independently of the tick, and whether the wheels turn."""
        if newest is not None:
            before = self._watched, self._recent_obstacles
            self._watched, self._recent_obstacles = watched_after(
                before, newest, self.profile, self._sensors, now_ns=now_ns
            )
        if not self._intent.drives:
            self._blocked_since_ns = None
        elif newest is None or not wheels_blocked(self.sent, newest.twist, self.profile):
            if not self._wheels_block(now_ns):
                self._blocked_since_ns = None
        elif self._blocked_since_ns is None:
            self._blocked_since_ns = now_ns

    def _wheels_block(self, now_ns: int) -> bool:
        """Whether the gate takes the wheels for blocked, until the operator has freed them."""
        since_ns = self._blocked_since_ns
        return since_ns is not None and now_ns - since_ns >= DEFAULT_SAFETY.gate.blocked_ns

    def reasons(self, now_ns: int) -> tuple[StopReason, ...]:
        """Return why the robot stands although it was told to drive, the most severe reason
        first. Those of the newest command, unless something has changed since: every page asks for
        them many times a second."""
        found = self._found
        if (
            found is not None
            and 0 <= now_ns - found.now_ns < REASONS_NS
            and found.intent is self._intent
            and found.tick_state is self._tick_state
            and found.watched is self._watched
        ):
            return found.reasons
        return self._verdict(now_ns, 0.0).reasons

    def _verdict(self, now_ns: int, period_s: float) -> GateDecision:
        intent, tick_state = self._intent, self._tick_state
        watched, began_ns = self._watched, now_ns
        hand = self._limited(self.hand(now_ns))
        # A command decided before the newest change of the operator's state is void; the next tick
        # decides for the new one.
        driving = intent.drives and tick_state.request == intent.request
        command = hand or (tick_state.command if driving else None)
        if command is not None and now_ns < command.stamp_ns <= now_ns + CLOCK_SLACK_NS:
            now_ns = command.stamp_ns
        frame_ns = None if watched.newest is None else watched.newest.stamp_ns
        moved = IDENTITY if frame_ns is None else self._sent.since(frame_ns, now_ns)
        facts = GateInput(
            now_ns=now_ns,
            frame_ns=frame_ns,
            stopped_by=intent.stopped_by,
            command=command,
            sensors=watched,
            obstacles=self._recent_obstacles.all_points,
            moved=moved,
            keep_outs=self._keep_outs(moved),
            blocked_since_ns=self._blocked_since_ns,
        )
        verdict = gate(facts, sent=self.sent, period_s=period_s, profile=self.profile)
        found = (
            self._teleop_stops(hand, moved)
            if hand is not None
            else planner_stops(intent, tick_state, malformed=bool(self._watched.malformed))
        )
        twist = STANDSTILL if hand is not None and found else verdict.twist
        reasons = ranked([*verdict.reasons, *found])
        self._found = _Found(
            now_ns=began_ns, intent=intent, tick_state=tick_state, watched=watched, reasons=reasons
        )
        return GateDecision(twist=twist, reasons=reasons)

    @property
    def _well_formed(self) -> Frame | None:
        """Newest frame; None where it is malformed, so that the gate objects to it: it may have no
        pose."""
        watched = self._watched
        return None if watched.malformed else watched.newest

    def _keep_outs(self, moved: Pose2) -> KeepOuts:
        """Return what the gate keeps the robot out of, in a mission and by hand: the operator's
        present zones, and the beware cells of the newest tick. `moved`: T_frame_now of the newest
        frame."""
        newest, place, tick_state = self._well_formed, self.place, self._tick_state
        grown = tick_state.decision.grown_cells if tick_state.decision else GrownCells()
        return KeepOuts(
            pose=newest.placed(place.T_map_odom).pose @ moved
            if newest and place.is_known
            else None,
            zones=self._intent.zones,
            cells=grown.cells,
            cell_growth_m=grown.growth_m,
            cell_objects=grown.objects,
            leaving=self._intent.mission.phase is Phase.LEAVING,
            covariance=place.covariance[:2, :2],
            covariances=tick_state.zone_covariances,
        )

    @property
    def place(self) -> LocalisationEstimate:
        """Where the robot is in the map, by the newest tick."""
        return self.navigator.place

    def hand(self, now_ns: int) -> Command | None:
        """Return the command of teleoperation while it is fresh and no mission drives."""
        command = self._intent.by_hand
        if command is None or self._intent.mission.phase in MOVING:
            return None
        return command if 0 <= now_ns - command.stamp_ns <= HAND_LIFE_NS else None

    def _limited(self, hand: Command | None) -> Command | None:
        """Return a command of teleoperation within the operator's speed limits."""
        newest = self._well_formed
        if hand is None or newest is None or self.place.is_lost:
            return hand
        asked = Motion(twist=hand.twist, outcome=ControllerState.FOLLOW)
        return dataclasses.replace(
            hand,
            twist=self.navigator.limit(
                asked,
                self._intent.zones,
                newest.placed(self.place.T_map_odom).pose,
                newest.twist,
            ).twist,
        )

    def _teleop_stops(self, hand: Command, moved: Pose2) -> list[StopReason]:
        """Return why teleoperation may not go on; `moved`: T_frame_now of the newest frame. A lost
        robot may be driven anywhere: neither zones nor the map tell what is beside it."""
        newest = self._well_formed
        if newest is None or self.place.is_lost:
            return []
        pose = newest.placed(self.place.T_map_odom).pose @ moved
        spec = self.navigator.map.spec
        return hand_stops(
            hand.twist, pose, self._intent.zones, self._tick_state, self.profile, spec
        )
