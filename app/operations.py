"""The console's port, satisfied: operators' intents go to the pilot and the store, snapshots come from the newest tick."""

from __future__ import annotations

import dataclasses
import math
import threading
import uuid
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

from app.occupant import occupant
from app.pilot import MOVING, Intent, Pilot
from app.recorder import Recorder
from app.segmenter import Perception
from app.storage import Store
from app.timing import Stopwatch
from navcore.beware import BewareClass, BewareList
from navcore.errors import BadGeometry, NotKnown, Outdated, Refused
from navcore.local_planner import Outcome
from navcore.mission import Goal, Mission, Phase
from navcore.navigator import Decision
from navcore.path import NoPath, Path
from navcore.robot import STANDSTILL, Command, Robot, RobotProfile, Twist
from navcore.safety import Verdict
from navcore.segment import Finder
from navcore.zones import Zone, check_polygon, rasterise
from web.port import Cloud, MissionAction, PathPreview, Picture, State, StopReason, ZoneDraft

MAX_ZONES = 500
MAX_ZONE_MARGIN_M = 2.0
MOVING_MPS = 1e-3
TRANSITIONS = {
    "start": Mission.start,
    "pause": Mission.pause,
    "resume": Mission.resume,
    "cancel": Mission.cancel,
    "leave": Mission.leave,
}


class LiveOperations:
    """Satisfies `web.port.Operations` for a running robot."""

    def __init__(
        self,
        *,
        robot: Robot,
        pilot: Pilot,
        store: Store,
        recorder: Recorder,
        world: str,
        robot_urdf: FilePath | None,
        perception: Perception,
    ) -> None:
        self._robot, self._pilot, self._store, self._recorder = robot, pilot, store, recorder
        self._world, self._urdf, self._perception = world, robot_urdf, perception
        self._stopwatch = Stopwatch(pilot.navigator)
        self._verdict = Verdict(twist=STANDSTILL, reasons=())
        self._editing = threading.Lock()
        self._zones_version = 0

    @property
    def profile(self) -> RobotProfile:
        """The platform's body."""
        return self._pilot.profile

    @property
    def robot_urdf(self) -> FilePath | None:
        """A URDF of the robot for the 3D view."""
        return self._urdf

    def note_verdict(self, verdict: Verdict) -> None:
        """Called by the command thread each time it has sent."""
        self._verdict = verdict
        self._recorder.note_verdict(verdict)

    # What is shown

    def state(self) -> State:
        """The newest snapshot."""
        intent, thought, verdict = self._pilot.intent, self._pilot.thought, self._verdict
        decision, now_ns = thought.decision, self._robot.now_ns()
        ticks = self._stopwatch.ms["tick"]
        reasons = tuple(StopReason(code=reason.cause, text=reason.text) for reason in self._pilot.reasons(now_ns))
        moving = abs(verdict.twist.v_mps) > MOVING_MPS or abs(verdict.twist.w_radps) > MOVING_MPS
        return State(
            stamp_s=now_ns / 1e9,
            scenario=self._world,
            robot=self.profile.name,
            phase=intent.mission.phase,
            moving=moving,
            by_hand=self._pilot.hand(now_ns) is not None,
            summary=_summary(intent, decision, reasons, moving),
            stop_latched=intent.stopped_by is not None or self._pilot.pose_in_doubt,
            reasons=reasons,
            pose=self._recorder.pose,
            twist=decision.frame.twist if decision else STANDSTILL,
            command=verdict.twist,
            queue=intent.mission.queue,
            reached=intent.mission.reached,
            distance_to_goal_m=_length_m(decision) if intent.mission.phase is not Phase.IDLE else None,
            travelled_m=self._recorder.travelled_m,
            explored_m2=self._recorder.explored_m2,
            replans=self._recorder.replans,
            tick_ms=ticks[-1] if ticks else 0.0,
            frame_age_s=(now_ns - thought.frame_ns) / 1e9 if thought.frame_ns is not None else None,
            in_zone=_in_zone(decision),
            zones_version=self._zones_version,
            beware_version=intent.beware.version,
            segmenter=self._perception.title,
            segmenter_warning=self._perception.warning,
        )

    def picture(self) -> Picture | None:
        """The newest tick's values."""
        return self._recorder.picture

    def cloud(self) -> Cloud | None:
        """The map's points."""
        return self._recorder.cloud

    # Mission and stop

    def add_goal(self, x_m: float, y_m: float) -> Goal:
        """Queue a goal; refused where the robot could not stand as far as the map is known."""
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            raise BadGeometry("the goal is not finite; give metres of the map frame")
        spec, picture = self._pilot.navigator.map.spec, self._recorder.picture
        if picture is not None and spec.contains(x_m, y_m) and picture.blocked[spec.cell(x_m, y_m)]:
            where = occupant(picture.grid, spec.cell(x_m, y_m))
            raise BadGeometry(f"goal ({x_m:.2f}, {y_m:.2f}) lies {where}; the robot cannot stand there, pick a free place")
        mission = self._pilot.change_mission(lambda mission: mission.add(x_m, y_m, spec))
        return mission.queue[-1]

    def remove_goal(self, goal_id: int) -> None:
        """Take a goal out of the queue."""
        self._pilot.change_mission(lambda mission: mission.remove(goal_id))

    def mission(self, action: MissionAction) -> None:
        """Start, pause, resume or cancel."""

        def edit(intent: Intent) -> Intent:
            if intent.stopped_by is not None and action in ("start", "resume", "leave"):
                raise Refused(f"the emergency stop by {intent.stopped_by} is latched; reset it first")
            return dataclasses.replace(intent, mission=TRANSITIONS[action](intent.mission))

        self._pilot.change(edit)

    def drive(self, twist: Twist | None) -> None:
        """By hand, for as long as the command lives; a mission that drives is paused, and stays so."""
        if twist is None:
            self._pilot.change(lambda intent: dataclasses.replace(intent, by_hand=None))
            return
        command = Command(twist=twist, stamp_ns=self._robot.now_ns())

        def edit(intent: Intent) -> Intent:
            if intent.stopped_by is not None:
                raise Refused(f"the emergency stop by {intent.stopped_by} is latched; reset it first")
            mission = intent.mission.pause() if intent.mission.phase in MOVING else intent.mission
            return dataclasses.replace(intent, by_hand=command, mission=mission)

        self._pilot.change(edit)

    def stop(self, source: str) -> None:
        """Latch the emergency stop and pause the mission, as one step."""

        def edit(intent: Intent) -> Intent:
            driving = intent.mission.phase in MOVING
            mission = intent.mission.pause() if driving else intent.mission
            return dataclasses.replace(intent, stopped_by=intent.stopped_by or source, mission=mission, by_hand=None)

        self._pilot.change(edit)
        # The command thread would send it within its period; the wheels need not wait for that.
        self._robot.send(STANDSTILL)

    def reset_stop(self) -> None:
        """Release the latch, and accept the pose if odometry has jumped; the mission stays paused."""

        def edit(intent: Intent) -> Intent:
            doubted = self._pilot.pose_in_doubt and intent.mission.phase in MOVING
            return dataclasses.replace(intent, stopped_by=None, mission=intent.mission.pause() if doubted else intent.mission)

        self._pilot.change(edit)
        self._pilot.trust_pose()

    # Zones

    def zones(self) -> tuple[Zone, ...]:
        """All stored zones."""
        return self._pilot.intent.zones

    def add_zone(self, draft: ZoneDraft) -> Zone:
        """Store a zone, then let it bind the robot."""
        with self._editing:
            if len(self.zones()) >= MAX_ZONES:
                raise Refused(f"there are {MAX_ZONES} zones already; delete some first")
            zone = self._checked(draft, zone_id=uuid.uuid4().hex[:12], version=1)
            self._store.save_zone(zone)
            self._bind((*self.zones(), zone))
        return zone

    def replace_zone(self, zone_id: str, draft: ZoneDraft, *, expected_version: int | None = None) -> Zone:
        """Change a stored zone."""
        with self._editing:
            old = self._zone(zone_id, expected_version)
            zone = self._checked(draft, zone_id=zone_id, version=old.version + 1)
            self._store.save_zone(zone)
            self._bind(tuple(zone if other.id == zone_id else other for other in self.zones()))
        return zone

    def delete_zone(self, zone_id: str, *, expected_version: int | None = None) -> None:
        """Forget a zone."""
        with self._editing:
            self._zone(zone_id, expected_version)
            self._store.delete_zone(zone_id)
            self._bind(tuple(zone for zone in self.zones() if zone.id != zone_id))

    def _zone(self, zone_id: str, expected_version: int | None) -> Zone:
        for zone in self.zones():
            if zone.id == zone_id:
                if expected_version is not None and expected_version != zone.version:
                    raise Outdated(f"zone {zone.name!r} is at version {zone.version}, the edit was made on {expected_version}")
                return zone
        raise NotKnown(f"no zone has the id {zone_id!r}")

    def _checked(self, draft: ZoneDraft, *, zone_id: str, version: int) -> Zone:
        polygon = check_polygon(draft.polygon, self._pilot.navigator.map.spec)
        if not 0 <= draft.margin_m <= MAX_ZONE_MARGIN_M:
            raise BadGeometry(f"zone margin {draft.margin_m:g} m is out of range, allowed 0 to {MAX_ZONE_MARGIN_M:g} m")
        return Zone(
            id=zone_id, name=draft.name, polygon=polygon, enabled=draft.enabled, margin_m=draft.margin_m, version=version
        )

    def _bind(self, zones: tuple[Zone, ...]) -> None:
        self._pilot.change(lambda intent: dataclasses.replace(intent, zones=zones))
        self._zones_version += 1
        self._recorder.watch_zones(zones)

    # The beware list

    def beware(self) -> BewareList:
        """The list in force."""
        return self._pilot.intent.beware

    def finder(self, entry: BewareClass) -> Finder:
        """What finds an entry in the pictures."""
        return self._perception.segmenter.finds(entry)

    def edit_beware(self, name: str, changes: Mapping[str, object], *, expected_version: int | None = None) -> BewareList:
        """Change fields of one class."""
        with self._editing:
            self._expect(expected_version)
            return self._put(self.beware().edited(name, **changes))

    def replace_beware(self, beware: BewareList, *, expected_version: int | None = None) -> BewareList:
        """Put another list in force."""
        with self._editing:
            self._expect(expected_version)
            return self._put(self.beware().replaced(beware.classes))

    def _expect(self, expected_version: int | None) -> None:
        version = self.beware().version
        if expected_version is not None and expected_version != version:
            raise Outdated(f"the beware list is at version {version}, the edit was made on {expected_version}")

    def _put(self, beware: BewareList) -> BewareList:
        self._store.save_beware(beware)
        self._pilot.change(lambda intent: dataclasses.replace(intent, beware=beware))
        return beware

    # Drafts and the past

    def preview(self, *, goal: tuple[float, float] | None, polygon: tuple[tuple[float, float], ...] | None) -> PathPreview:
        """Plan over the newest map with the draft added to it; nothing is applied."""
        decision, navigator = self._pilot.thought.decision, self._pilot.navigator
        queue = self._pilot.intent.mission.queue
        target = goal or ((queue[0].x_m, queue[0].y_m) if queue else None)
        if target is None:
            raise Refused("there is no goal to preview a path to; give one")
        if decision is None:
            raise Refused("there is no map yet; the camera has not delivered a picture")
        occupancy = decision.occupancy
        if polygon is not None:
            spec, grid = navigator.map.spec, occupancy.grid
            grid = dataclasses.replace(grid, zones=grid.zones | rasterise(check_polygon(polygon, spec), spec))
            occupancy = navigator.drafted(grid)
        route = navigator.preview(occupancy, decision.frame.pose, target)
        length = route.outcome.length * navigator.map.spec.resolution_m if isinstance(route.outcome, Path) else None
        return PathPreview(outcome=route.outcome, points=route.points, length_m=length)

    def runs(self) -> tuple[Mapping[str, object], ...]:
        """Reports of past missions, newest first, without their series."""
        return tuple({key: value for key, value in report.items() if key != "series"} for report in self._store.runs())

    def run(self, run_id: str) -> Mapping[str, Any]:
        """One mission's whole report."""
        return self._store.run(run_id)


def _length_m(decision: Decision | None) -> float | None:
    if decision is None or decision.route is None or isinstance(decision.route.outcome, NoPath):
        return None
    return decision.route.outcome.length * decision.occupancy.spec.resolution_m


def _in_zone(decision: Decision | None) -> bool:
    return decision is not None and decision.motion.outcome is Outcome.IN_ZONE


def _summary(intent: Intent, decision: Decision | None, reasons: tuple[StopReason, ...], moving: bool) -> str:
    mission = intent.mission
    if reasons:
        return reasons[0].text
    if moving and mission.phase not in MOVING:
        return "Driven by hand."
    if mission.phase is Phase.LEAVING:
        return "Leaving the beware area by the shortest way."
    if _in_zone(decision):
        return "Standing in a beware area; have it leave, or change the area."
    if mission.phase is Phase.DRIVING and decision is not None:
        goal = mission.queue[0]
        what = decision.motion.outcome if moving else "about to move"
        return f"Driving to goal {goal.id} at ({goal.x_m:.1f}, {goal.y_m:.1f}): {what}."
    if mission.queue:
        return f"Standing; {len(mission.queue)} goal{'s wait' if len(mission.queue) > 1 else ' waits'} for start."
    if mission.cancelled:
        return "Standing; the mission was cancelled."
    return "Standing; all goals reached." if mission.reached else "Standing; pick a goal to begin."
