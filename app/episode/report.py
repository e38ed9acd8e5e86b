"""The report of an episode: the referee's judgement, durations, and the mapped share."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from app.episode.failure_causes import GOAL_RADIUS_M, causes_of
from app.episode.informed_baseline import SensorModel, TrueGrids, ideal_path_m
from app.runtime.control.stage_timer import StageTimer
from app.runtime.record.provenance import machine, version
from navcore.costmap.costmap import layer_grid
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.grid.nearest import nearest_of
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Goal
from sim.referee.detections import DetectionScore
from sim.scenario.schema import Scenario
from sim.simulator import Simulator

Polygon = tuple[tuple[float, float], ...]
PUSH_SETTLED_S = 3.0
"""Time after a push until the robot has its place corrected, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """The state of an episode once a second."""

    t_s: float
    """Simulated time in seconds."""
    pose: Pose2
    """True pose of the robot."""
    distance_m: float
    """Distance driven by the centre of the robot since the start."""
    explored_m2: float
    """Area that the map has observed, m²."""
    explored_m3: float
    """Volume that the map has observed, m³."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ToldPush:
    """A motion that the robot's scans have told and its odometry has not."""

    t_s: float
    """Simulated time in seconds."""
    by_m: float
    """Its length as told, metres."""
    error_before_m: float
    """Error of the estimated position in metres at the tick before."""
    error_after_m: float = math.nan
    """The same `PUSH_SETTLED_S` later: a robot that drives stands for a large correction first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EpisodeRecord:
    """Everything that a report is made of, at the end of an episode."""

    scenario: Scenario
    """The world as the seed made it."""
    seed: int
    """Seed of the episode."""
    simulator: Simulator
    """The simulator with its referee."""
    segmenter: str
    """Identity of what labelled the images."""
    ablation: str
    """What was left out of the navigation."""
    latency: str
    """Time that ticks took on the simulated clock: `none`, `live`, or a fixed one."""
    first_day: dict[str, Any] | None
    """How the kept map was made; None in a new map."""
    placed: Callable[[Points], Points]
    """Returns where the map shows what an (N, 2) outline of the true world covers."""
    goals: tuple[Goal, ...]
    """Goals of the mission, in order."""
    zones: tuple[Polygon, ...]
    """Keep-out zones drawn by the operator."""
    ended: str
    """Why the episode ended."""
    sim_time_s: float
    """Simulated duration, seconds."""
    wall_time_s: float
    """Real duration in seconds."""
    spec: GridSpec
    """Grid of the map."""
    inflation_m: float
    """Inflation radius of the robot's centre in metres."""
    sensor: SensorModel
    """Field of view of the camera."""
    goal_errors_m: dict[int, float]
    """True distance to each goal when the robot reported it reached, by goal id."""
    goal_errors_by_odometry_m: dict[int, float]
    """Distance by odometry to each goal when the robot reported it reached, metres, by goal id."""
    goal_errors_by_estimate_m: dict[int, float]
    """Distance by the robot's estimate to each goal when it reported it reached, metres, by goal
    id."""
    pushes: tuple[ToldPush, ...]
    """Pushes that the robot has noticed."""
    detections: DetectionScore
    """Which items came into view."""
    samples: tuple[Sample, ...]
    """Samples of the episode, one per second."""
    timer: StageTimer
    """Durations of ticks and stages."""
    beware: BewareList
    """The beware list at the end."""
    map: PointMap
    """The navigator's map at the end."""

    @property
    def goal_points(self) -> list[tuple[float, float]]:
        """(x, y) of the goals in the map frame."""
        return [(goal.x_m, goal.y_m) for goal in self.goals]


def report_of(record: EpisodeRecord) -> dict[str, Any]:
    """Make the episode report, a JSON object."""
    referee, timer = record.simulator.referee, record.timer
    judged = referee.summary()
    errors_m = record.goal_errors_m
    reached = sum(errors_m.get(goal.id, math.inf) <= GOAL_RADIUS_M for goal in record.goals)
    success = reached == len(record.goals) and referee.violations() == 0
    shortest_m = referee.shortest_m(record.spec, record.inflation_m, record.goal_points)
    share = 0.0 if shortest_m is None else shortest_m / max(referee.distance_m, shortest_m)
    ideal_m = _ideal_m(record)
    report = {
        "scenario": record.scenario.name,
        "seed": record.seed,
        "version": version(),
        "machine": machine(),
        "robot": record.simulator.profile.name,
        "segmenter": record.segmenter,
        "ablation": record.ablation,
        "odometry": str(record.simulator.odometry_grade),
        "latency": record.latency,
        "map": "new" if record.first_day is None else "kept",
        "camera": str(record.simulator.profile.stream),
        "scanner": "none" if record.simulator.profile.scanner is None else "all round",
        "people": _manner_of(record.scenario),
        "gnss": "none" if record.simulator.gnss is None else record.simulator.gnss.kind,
        "start": list(record.scenario.start),
        "goals": [list(point) for point in record.goal_points],
        "zones": [[list(corner) for corner in zone] for zone in record.zones],
        "goals_reached": reached,
        "success": success,
        "ended": record.ended,
        "sim_time_s": round(record.sim_time_s, 3),
        "wall_time_s": round(record.wall_time_s, 3),
        **judged,
        **{
            name: judged[name] if math.isfinite(judged[name]) else None
            for name in ("min_clearance_m", "min_item_clearance_m")
        },
        "shortest_m": _rounded(shortest_m),
        "spl": round(share, 4) if success else 0.0,
        "ideal_m": _rounded(ideal_m),
        "goal_errors_m": _by_goal(errors_m),
        "goal_errors_by_odometry_m": _by_goal(record.goal_errors_by_odometry_m),
        "goal_errors_by_estimate_m": _by_goal(record.goal_errors_by_estimate_m),
        "pushes": [
            {name: round(value, 3) for name, value in dataclasses.asdict(push).items()}
            for push in record.pushes
        ],
        **({} if record.first_day is None else {"first_day": record.first_day}),
        "items": _items(record),
        "explored_share": _explored_share(record),
        "replans": len(timer.ms["replan"]),
        "plan_ms": timer.summary("replan"),
        "tick_ms": timer.summary("tick"),
        "segment_ms": timer.summary("segment"),
        "series": _series(record),
    }
    return {**report, "causes": causes_of(report)}


def _manner_of(scenario: Scenario) -> str:
    """Return whether the people who walk yield to the robot."""
    yielding = {person.yields for person in scenario.people if len(person.points) > 1}
    if not yielding:
        return "none"
    return "some yield" if len(yielding) > 1 else "yield" if yielding.pop() else "walk on"


def _rounded(length_m: float | None) -> float | None:
    return None if length_m is None else round(length_m, 3)


def _by_goal(errors_m: dict[int, float]) -> dict[str, float]:
    return {str(goal_id): round(error, 3) for goal_id, error in errors_m.items()}


def _series(record: EpisodeRecord) -> dict[str, list[float]]:
    samples = record.samples
    return {
        "t_s": [round(sample.t_s, 3) for sample in samples],
        "distance_m": [round(sample.distance_m, 3) for sample in samples],
        "explored_m2": [round(sample.explored_m2, 2) for sample in samples],
        "explored_m3": [round(sample.explored_m3, 3) for sample in samples],
        "x_m": [round(sample.pose.x_m, 3) for sample in samples],
        "y_m": [round(sample.pose.y_m, 3) for sample in samples],
    }


def _ideal_m(record: EpisodeRecord) -> float | None:
    """Return the length in metres of an ideal driver's path through an unknown world."""
    spec, (x_m, y_m, yaw_rad) = record.spec, record.scenario.start
    tall, low, zones = record.simulator.referee.true_cells(spec)
    return ideal_path_m(
        TrueGrids(high=tall, low=low, zones=zones),
        spec,
        Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad),
        record.goal_points,
        sensor=record.sensor,
        inflation_m=record.inflation_m,
    )


def _items(record: EpisodeRecord) -> dict[str, dict[str, int]]:
    beware = record.beware
    grid = layer_grid(record.map, beware, ())
    held = {entry.detected_as: grid.beware[entry.class_id] for entry in beware.enabled}
    return record.detections.counts_by_class(held, record.spec, record.placed)


def _explored_share(record: EpisodeRecord) -> float:
    """Share of the truly reachable floor that the map has observed; the floor nearest to a start
    that is blocked, e.g. by a zone."""
    spec = record.spec
    free = ~record.simulator.referee.true_blocked(spec, record.simulator.profile.width_m / 2)
    _, areas = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    start = nearest_of(np.argwhere(free), spec.cell(*record.scenario.start[:2]))
    if start is None:
        return 0.0
    floor = areas == areas[start]
    seen = record.map.explored.seen.bools
    return round(float((seen & floor).sum() / floor.sum()), 4)
