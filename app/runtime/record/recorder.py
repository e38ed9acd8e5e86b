"""The console's view of a drive: newest image, point cloud, driven path and measurements."""

from __future__ import annotations

import numpy as np

from app.runtime.control.robot_controller import RobotController
from app.runtime.record.driven_path import DrivenPath
from app.runtime.record.run_report import Referee, RunReporter
from app.storage import Store
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.mission.zone import Zone
from navcore.navigator import TickResult
from navcore.planning.path import Path
from navcore.planning.route import Route
from navcore.planning.unseen_parts import unseen_parts
from navcore.safety.gate import GateDecision
from web.interface.snapshots import Cloud, TickSnapshot

CLOUD_PERIOD_S = 1.0
"""Time between two copies of the point cloud, seconds."""


class Recorder:
    """Fed by the think and the command thread; read by any.

    Each public attribute is an immutable value that is replaced as a whole. The missions' reports
    are stored on the way (`RunReporter`).
    """

    def __init__(
        self, *, controller: RobotController, store: Store, referee: Referee | None, scenario: str
    ) -> None:
        self._controller = controller
        self.scenario = scenario
        """Name of the world."""
        self._reporter = RunReporter(
            store=store, referee=referee, scenario=scenario, robot=controller.profile.name
        )
        self.picture: TickSnapshot | None = None
        """Values of the newest tick; None before the first."""
        self.cloud: Cloud | None = None
        """Points of the map; None before the first tick."""
        self.pose = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
        """Pose of the robot in the map frame at the newest tick."""
        self.explored_m2 = 0.0
        """Area that the map has observed, m²."""
        self.replans = 0
        """Number of paths planned so far."""
        self.images = 0
        """Number of images processed so far."""
        self._driven = DrivenPath()
        self._route: Route | None = None
        self._floor_key: tuple[int, float] = (-1, -1.0)
        self._floor_version = 0
        self._cloud_ns = 0

    @property
    def travelled_m(self) -> float:
        """Length of the driven path, metres."""
        return self._driven.length_m

    def note_decision(self, decision: TickResult) -> None:
        """Called by the think thread after each tick."""
        self.pose = decision.frame.pose
        self.images += 1
        if decision.correction is not None:
            self._driven.follow(decision.correction.before, decision.correction.after)
        self._driven.add(self.pose, decision.place.T_map_odom.inverse() @ self.pose)
        if decision.route is not None and decision.route is not self._route:
            self.replans += isinstance(decision.route.outcome, Path)
        self._route = decision.route
        self.explored_m2 = self._controller.navigator.map.explored.area_m2
        self.picture = self._picture_of(decision)
        if not 0 <= decision.frame.stamp_ns - self._cloud_ns <= CLOUD_PERIOD_S * 1e9:
            self._cloud_ns = decision.frame.stamp_ns
            self.cloud = self._copied_cloud()
        self._reporter.note_tick(
            decision.frame.stamp_ns,
            self._controller.intent.mission,
            self.travelled_m,
            lambda: self.measurements(decision),
        )

    def note_verdict(self, verdict: GateDecision) -> None:
        """Called by the command thread after each command."""
        self._reporter.note_stop(str(verdict.reasons[0].cause) if verdict.reasons else None)

    def forget_path(self) -> None:
        """Begin another driven path, on another map; called by the think thread."""
        self._driven.forget()

    def watch_zones(self, zones: tuple[Zone, ...]) -> None:
        """Called with all zones whenever they have changed."""
        self._reporter.watch_zones(zones)

    def measurements(self, decision: TickResult | None) -> dict[str, float]:
        """Return a row of a time series, without its time."""
        return {
            "speed_mps": decision.frame.twist.v_mps if decision is not None else 0.0,
            "distance_m": self.travelled_m,
            "explored_m2": self.explored_m2,
            "explored_m3": self._controller.navigator.map.explored.volume_m3,
            "tick_ms": self._controller.timer.tick_ms,
        }

    def keep_run(self) -> None:
        """Store what the present run has come to; any thread may call it."""
        self._reporter.keep()

    def close(self) -> None:
        """Store the report of an unfinished run; call when no thread feeds this any more."""
        self._reporter.close(self._controller.intent.mission)

    def _picture_of(self, decision: TickResult) -> TickSnapshot:
        frame, occupancy, route = decision.frame, decision.occupancy, decision.route
        key = (occupancy.version, self.explored_m2)
        if key != self._floor_key:
            self._floor_key = key
            self._floor_version += 1
        empty: Points = np.empty((0, 2))
        world = self._controller.navigator.map
        path, seen = route.points if route else empty, world.explored.floor
        return TickSnapshot(
            serial=frame.stamp_ns,
            pose=frame.pose,
            T_map_camera=frame.T_map_camera,
            intrinsics=frame.intrinsics,
            rgb=frame.rgb,
            labels=decision.labels.class_ids,
            confidence=decision.labels.confidence,
            occupancy=occupancy,
            seen_mask=seen,
            grid_version=self._floor_version,
            path=path,
            unseen=unseen_parts(path, seen, world.explored.spec),
            waypoints=route.waypoints if route else empty,
            driven=self._driven.points,
            people=decision.people,
            closed=decision.closed,
            depth_m=frame.depth_m,
            prior=world.layers.prior,
        )

    def _copied_cloud(self) -> Cloud:
        points = self._controller.navigator.map.points
        return Cloud(
            serial=self._cloud_ns,
            points_map=points.points_map,
            rgb=points.rgb,
            class_ids=points.class_ids,
        )
