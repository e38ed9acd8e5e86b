"""What the console shows and keeps of a drive: newest picture, point cloud, driven path, and each
mission's report."""

from __future__ import annotations

import logging
import uuid
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from app.runtime.robot_controller import RobotController
from app.storage import Store
from navcore.errors import StorageFailed
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.mission.mission import Mission, Phase
from navcore.mission.zone import Zone
from navcore.navigator import TickResult
from navcore.planning.path import Path
from navcore.planning.route import Route, read_only
from navcore.safety.gate import GateDecision
from web.snapshots import Cloud, Picture

log = logging.getLogger(__name__)
CLOUD_PERIOD_S = 1.0
SERIES_PERIOD_S = 1.0
SERIES = ("t_s", "distance_m", "explored_m2", "explored_m3", "speed_mps", "tick_ms")
MAX_SERIES = 7200
"""Rows; of a longer run every second one is kept, and half as many are added from then on."""
DRIVEN_STEP_M = 0.05
MAX_DRIVEN = 20_000
"""The driven path keeps its newest kilometre."""


class Referee(Protocol):
    """Who judges a run from outside; only the simulated robot has one."""

    def watch_zones(self, polygons: list[list[tuple[float, float]]]) -> None:
        """Judge by these zones from now on."""

    def note_stop(self, reason: str | None) -> None:
        """Why the robot is held, None when it is not."""

    def new_run(self) -> None:
        """Start afresh."""

    def referee_report(self) -> dict[str, Any]:
        """What has been judged since."""


class Recorder:
    """Fed by the think and the command thread; read by anyone, each attribute an immutable value
    swapped as a whole."""

    def __init__(
        self, *, pilot: RobotController, store: Store, referee: Referee | None, scenario: str
    ) -> None:
        self._pilot, self._store, self._referee, self._scenario = pilot, store, referee, scenario
        self.picture: Picture | None = None
        self.cloud: Cloud | None = None
        self.pose = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
        self.travelled_m = 0.0
        self.explored_m2 = 0.0
        self.replans = 0
        self.tick_ms: Callable[[], float] = lambda: 0.0
        """How long the newest tick took; set by whoever measures it."""
        self._driven: list[tuple[float, float]] = []
        self._driven_points: Points = np.empty((0, 2))
        self._route: Route | None = None
        self._floor_key: tuple[int, float] = (-1, -1.0)
        self._floor_version = 0
        self._cloud_ns = 0
        self._run: dict[str, Any] | None = None
        self._stop_noted: str | None = None
        self._period_s = SERIES_PERIOD_S
        self._known: set[int] = set()
        self._last: TickResult | None = None

    def note_decision(self, decision: TickResult) -> None:
        """Called by the think thread after each tick."""
        self._note_pose(decision.frame.pose)
        if decision.route is not None and decision.route is not self._route:
            self.replans += isinstance(decision.route.outcome, Path)
        self._route = decision.route
        self.explored_m2 = self._pilot.navigator.map.explored.area_m2
        self.picture = self._painted(decision)
        if decision.frame.stamp_ns - self._cloud_ns > CLOUD_PERIOD_S * 1e9:
            self._cloud_ns = decision.frame.stamp_ns
            self.cloud = self._copied_cloud()
        self._note_run(decision)

    def note_verdict(self, verdict: GateDecision) -> None:
        """Called by the command thread each time it has sent."""
        reason = str(verdict.reasons[0].cause) if verdict.reasons else None
        if self._referee is not None and reason != self._stop_noted:
            self._stop_noted = reason
            self._referee.note_stop(reason)

    def watch_zones(self, zones: tuple[Zone, ...]) -> None:
        """Called when the zones have changed."""
        if self._referee is not None:
            self._referee.watch_zones([list(zone.polygon) for zone in zones if zone.closed])

    def _note_pose(self, pose: Pose2) -> None:
        if not self._driven:
            self._driven = [(pose.x_m, pose.y_m)]
            self._driven_points = read_only(np.array(self._driven))
        step_m = pose.distance_to(*self._driven[-1])
        if step_m >= DRIVEN_STEP_M:
            self.travelled_m += step_m
            self._driven = [*self._driven[-MAX_DRIVEN:], (pose.x_m, pose.y_m)]
            self._driven_points = read_only(np.array(self._driven))
        self.pose = pose

    def _painted(self, decision: TickResult) -> Picture:
        frame, occupancy, route = decision.frame, decision.occupancy, decision.route
        key = (occupancy.version, self.explored_m2)
        if key != self._floor_key:
            self._floor_key = key
            self._floor_version += 1
        nowhere: Points = np.empty((0, 2))
        return Picture(
            serial=frame.stamp_ns,
            pose=frame.pose,
            T_map_camera=frame.T_map_camera,
            intrinsics=frame.intrinsics,
            rgb=frame.rgb,
            labels=decision.labels.class_ids,
            confidence=decision.labels.confidence,
            occupancy=occupancy,
            seen_mask=self._pilot.navigator.map.explored.seen,
            grid_version=self._floor_version,
            path=route.points if route else nowhere,
            waypoints=route.waypoints if route else nowhere,
            driven=self._driven_points,
            people=decision.people,
            closed=decision.closed,
            depth_m=frame.depth_m,
            prior=self._pilot.navigator.map.layers.prior,
        )

    def _copied_cloud(self) -> Cloud:
        points = self._pilot.navigator.map.points
        return Cloud(
            serial=self._cloud_ns,
            points_map=points.points_map,
            rgb=points.rgb,
            class_ids=points.class_ids,
        )

    def _note_run(self, decision: TickResult) -> None:
        """A run begins when the mission starts to drive and ends when it is idle again."""
        mission = self._pilot.intent.mission
        if self._run is None and mission.phase is Phase.DRIVING:
            self._begin_run(decision, mission)
        elif self._run is not None:
            series = self._run["series"]
            if self._run_s(decision) >= len(series["t_s"]) * self._period_s:
                series["t_s"].append(round(self._run_s(decision), 2))
                series["distance_m"].append(
                    round(self.travelled_m - self._run["travelled_at_start_m"], 3)
                )
                series["explored_m2"].append(round(self.explored_m2, 2))
                series["explored_m3"].append(round(self._pilot.navigator.map.explored.volume_m3, 2))
                series["speed_mps"].append(round(decision.frame.twist.v_mps, 3))
                series["tick_ms"].append(round(self.tick_ms(), 2))
                if len(series["t_s"]) >= MAX_SERIES:
                    self._run["series"] = {name: column[::2] for name, column in series.items()}
                    self._period_s *= 2
            self._run["goals"] += [
                [goal.x_m, goal.y_m] for goal in mission.queue if goal.id not in self._known
            ]
            self._known |= {goal.id for goal in mission.queue}
            self._last = decision
            if mission.phase is Phase.IDLE:
                self._end_run(decision, mission)

    def close(self) -> None:
        """Keep the report of a run that has not ended: nothing comes after it. Call when no thread
        feeds this any more."""
        if self._run is not None and self._last is not None:
            self._end_run(self._last, self._pilot.intent.mission)

    def _begin_run(self, decision: TickResult, mission: Mission) -> None:
        if self._referee is not None:
            self._referee.new_run()
            self._stop_noted = None  # a new referee has to be told again
        self._period_s, self._known, self._last = (
            SERIES_PERIOD_S,
            {goal.id for goal in mission.queue},
            decision,
        )
        self._run = {
            "id": uuid.uuid4().hex[:12],
            "scenario": self._scenario,
            "robot": self._pilot.profile.name,
            "goals": [[goal.x_m, goal.y_m] for goal in mission.queue],
            "started_ns": decision.frame.stamp_ns,
            "travelled_at_start_m": self.travelled_m,
            "series": {name: [] for name in SERIES},
        }

    def _end_run(self, decision: TickResult, mission: Mission) -> None:
        assert self._run is not None
        run, self._run = self._run, None
        verdict = self._referee.referee_report() if self._referee is not None else {}
        run["distance_m"] = round(self.travelled_m - run.pop("travelled_at_start_m"), 3)
        run["sim_time_s"] = round((decision.frame.stamp_ns - run.pop("started_ns")) / 1e9, 3)
        try:
            self._store.save_run({**run, **verdict, "goals_reached": len(mission.reached)})
        except StorageFailed:
            log.exception(
                "the run is not in the history"
            )  # a full disk is no reason to stop driving

    def _run_s(self, decision: TickResult) -> float:
        return float(decision.frame.stamp_ns - self._run["started_ns"]) / 1e9 if self._run else 0.0
