"""Replay of a recording through the navigator: the map, a report, and the path from the last
pose."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from app.replay.annotation import Annotation, BewareAgreement, judge_beware
from app.replay.carried_camera import for_recordings
from app.replay.recording import Recording
from app.replay.reference import Agreement, Reference, agreement, occupied_cells
from app.replay.robot import base_below, frames_of, map_around
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadGeometry
from navcore.geometry.transform import Matrix
from navcore.grid.grid import DEFAULT_RESOLUTION_M
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator, TickResult
from navcore.perception.labels import Segmenter
from navcore.planning.path import NoPath, Path
from navcore.robot.profile import RobotProfile


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replayed:
    """Result of a replayed recording."""

    navigator: Navigator
    """Navigator with the map."""
    decision: TickResult
    """Result of the last tick, with the route."""
    frames: int
    """Number of frames."""
    T_map_world: Matrix
    """(4, 4) transform from the recording's world frame to the map frame."""
    goal: tuple[float, float]
    """Goal of the route, metres of the map frame."""
    tick_ms: float
    """Median duration of a tick, milliseconds."""


def replay(
    recording: Recording,
    T_map_world: Matrix,
    *,
    profile: RobotProfile,
    config: NavigatorConfig,
    segmenter: Segmenter,
    beware: BewareList,
    goal: tuple[float, float] | None = None,
    on_progress: Callable[[int, int], None] = lambda done, of: None,
) -> Replayed:
    """Tick through all frames; at the last one plan to `goal`, by default the camera's start.

    Whatever odometry `config` expects, it is that of recordings. Raises `BadGeometry` for a goal
    outside the map.
    """
    spec = map_around(
        recording, T_map_world, reach_m=config.points.max_range_m, resolution_m=DEFAULT_RESOLUTION_M
    )
    start = base_below(T_map_world @ recording.T_world_camera[0])
    goal = goal or (start.x_m, start.y_m)
    if not spec.contains(*goal):
        raise BadGeometry(
            f"the goal ({goal[0]:g}, {goal[1]:g}) is outside the recording's map, {spec.extent()}"
        )
    navigator = Navigator(
        spec=spec, profile=profile, segmenter=segmenter, config=for_recordings(config)
    )
    durations_ms = []
    for done, frame in enumerate(frames_of(recording, T_map_world), start=1):
        order = NavigationRequest(
            goal=goal if done == len(recording) else None, beware=beware, zones=()
        )
        started = time.perf_counter()
        decision = navigator.tick(frame, order)
        durations_ms.append((time.perf_counter() - started) * 1e3)
        on_progress(done, len(recording))
    return Replayed(
        navigator=navigator,
        decision=decision,
        frames=len(recording),
        T_map_world=T_map_world,
        goal=goal,
        tick_ms=float(np.median(durations_ms)),
    )


def compare(replayed: Replayed, reference: Reference, config: NavigatorConfig) -> Agreement:
    """Compare the geometric layer of the map with the reference between obstacle height and
    ceiling."""
    rules, spec = config.points, replayed.navigator.map.spec
    heights_m = (rules.obstacle_height_m, rules.ceiling_m)
    return agreement(
        replayed.decision.occupancy.grid.geometric,
        *occupied_cells(reference, replayed.T_map_world, spec, heights_m=heights_m),
    )


def compare_objects(
    replayed: Replayed, annotation: Annotation, beware: BewareList, config: NavigatorConfig
) -> BewareAgreement:
    """Compare what the map takes for objects of the list with those that are annotated."""
    world = replayed.navigator.map
    return judge_beware(
        world.points,
        world.spec,
        replayed.T_map_world,
        annotation,
        beware,
        certain=config.map.confidence.certain,
    )


def as_report(
    replayed: Replayed, judged: Agreement | None, objects: BewareAgreement | None = None
) -> dict[str, Any]:
    """Return the report as a JSON object."""
    world, grid, route = (
        replayed.navigator.map,
        replayed.decision.occupancy.grid,
        replayed.decision.route,
    )
    outcome = route.outcome if route is not None else None
    path = outcome if isinstance(outcome, Path) else None
    return {
        "frames": replayed.frames,
        "explored_m2": round(world.explored.area_m2, 2),
        "explored_m3": round(world.explored.volume_m3, 2),
        "occupied_cells": int(grid.geometric.sum()),
        "beware_cells": int(
            np.any([np.zeros_like(grid.geometric), *grid.beware.values()], axis=0).sum()
        ),
        "points": len(world.points.class_ids),
        "tick_ms": round(replayed.tick_ms, 1),
        "T_map_world": replayed.T_map_world.tolist(),
        "start": [replayed.decision.frame.pose.x_m, replayed.decision.frame.pose.y_m],
        "goal": list(replayed.goal),
        "path_m": None if path is None else round(path.length * world.spec.resolution_m, 3),
        "no_path": None if path is not None else _refusal(outcome),
        "waypoints": route.waypoints.tolist() if route is not None else [],
        "reference": None if judged is None else asdict(judged),
        "objects": None if objects is None else asdict(objects),
    }


def _refusal(outcome: NoPath | Path | None) -> str:
    return str(outcome.reason) if isinstance(outcome, NoPath) else ""
