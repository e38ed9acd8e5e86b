"""The report of an episode: what the referee says, how the navigator did, and what its map holds of
the true world."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from app.episode.failure_causes import GOAL_RADIUS_M, causes_of
from app.episode.informed_baseline import TrueGrids, ideal_way_m
from navcore.costmap.costmap import layer_grid
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mission.mission import Phase

if TYPE_CHECKING:
    from app.episode.episode import Episode


def report_of(episode: Episode, *, wall_time_s: float, cut_short: bool) -> dict[str, Any]:
    """The report of the contract; `cut_short` when somebody ended the run before its time."""
    referee, watch = episode.simulator.referee, episode.stopwatch
    judged = referee.summary()
    reached = sum(episode.arrived.get(goal.id, math.inf) <= GOAL_RADIUS_M for goal in episode.goals)
    everywhere = reached == len(episode.goals)
    shortest_m = _shortest_m(episode)
    share = 0.0 if shortest_m is None else shortest_m / max(referee.distance_m, shortest_m)
    ideal_m = _ideal_m(episode)
    done = episode.pilot.intent.mission.phase is not Phase.DRIVING
    report = {
        "scenario": episode.scenario.name,
        "seed": episode.seed,
        "robot": episode.simulator.profile.name,
        "segmenter": episode.seen_by,
        "ablation": str(episode.ablation),
        "start": list(episode.scenario.start),
        "goals": [[goal.x_m, goal.y_m] for goal in episode.goals],
        "zones": [[list(corner) for corner in zone] for zone in episode.zones],
        "goals_reached": reached,
        "success": everywhere and referee.violations() == 0,
        "ended": "all goals"
        if done
        else "by its judge"
        if cut_short
        else "standing"
        if episode.stands
        else "time",
        "sim_time_s": round(episode.now_s, 3),
        "wall_time_s": round(wall_time_s, 3),
        **judged,
        "min_clearance_m": judged["min_clearance_m"]
        if math.isfinite(judged["min_clearance_m"])
        else None,
        "shortest_m": None if shortest_m is None else round(shortest_m, 3),
        "spl": round(share, 4) if everywhere else 0.0,
        "ideal_m": None if ideal_m is None else round(ideal_m, 3),
        "goal_errors_m": {
            str(goal_id): round(error, 3) for goal_id, error in episode.arrived.items()
        },
        "goal_errors_by_odometry_m": {
            str(goal_id): round(error, 3) for goal_id, error in episode.believed.items()
        },
        "items": _items(episode),
        "explored_share": _explored_share(episode),
        "replans": len(watch.ms["plan"]),
        "plan_ms": watch.summary("plan"),
        "tick_ms": watch.summary("tick"),
        "segment_ms": watch.summary("label"),
        "series": _series(episode),
    }
    return {**report, "causes": causes_of(report)}


def _series(episode: Episode) -> dict[str, list[float]]:
    samples, referee = episode.samples, episode.simulator.referee
    return {
        "t_s": [round(sample.t_s, 3) for sample in samples],
        "distance_m": [round(referee.distance_at(sample.t_s), 3) for sample in samples],
        "explored_m2": [round(sample.explored_m2, 2) for sample in samples],
        "explored_m3": [round(sample.explored_m3, 3) for sample in samples],
        "x_m": [round(sample.pose.x_m, 3) for sample in samples],
        "y_m": [round(sample.pose.y_m, 3) for sample in samples],
    }


def _shortest_m(episode: Episode) -> float | None:
    """The shortest way through all goals for who knows the true map and keeps the navigator's
    margin."""
    goals = [(goal.x_m, goal.y_m) for goal in episode.goals]
    return episode.simulator.referee.shortest_m(episode.spec, episode.inflation_m, goals)


def _ideal_m(episode: Episode) -> float | None:
    """The way of a driver without faults who has to see the world first."""
    spec, (x_m, y_m, yaw_rad) = episode.spec, episode.scenario.start
    tall, low, zones = episode.simulator.referee.true_cells(spec)
    return ideal_way_m(
        TrueGrids(tall=tall, low=low, known=zones),
        spec,
        Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad),
        [(goal.x_m, goal.y_m) for goal in episode.goals],
        eyes=episode.eyes,
        inflation_m=episode.inflation_m,
    )


def _items(episode: Episode) -> dict[str, dict[str, int]]:
    beware = episode.pilot.intent.beware
    grid = layer_grid(episode.pilot.navigator.map, beware, ())
    held = {entry.name: grid.beware[entry.class_id] for entry in beware.enabled}
    return episode.finds.verdict(held, episode.spec)


def _explored_share(episode: Episode) -> float:
    """How much of the floor that the robot could stand on, truly and from its start, its map has
    seen."""
    spec: GridSpec = episode.spec
    free = ~episode.simulator.referee.true_blocked(spec, episode.simulator.profile.width_m / 2)
    _, areas = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    floor = areas == areas[spec.cell(*episode.scenario.start[:2])]
    seen = episode.pilot.navigator.map.explored.seen.bools
    return round(float((seen & floor).sum() / floor.sum()), 4)
