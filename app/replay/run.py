"""A recording through the navigator: the map it builds, what is told of it, and the path from where
the camera ended."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from app.replay.recording import Recording
from app.replay.reference import Agreement, Reference, agreement, standing
from app.replay.robot import base_beneath, frames_of, map_around
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadGeometry
from navcore.geometry.transform import Matrix
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator, TickResult
from navcore.perception.labels import Segmenter
from navcore.planning.path import Path
from navcore.robot.profile import RobotProfile

RESOLUTION_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replayed:
    """A recording that has gone through the navigator."""

    navigator: Navigator
    """With the map."""
    decision: TickResult
    """Of the last frame, with the route."""
    frames: int
    """How many there were."""
    T_map_world: Matrix
    """(4, 4) from the recording's world to the map."""
    goal: tuple[float, float]
    """Where the route leads, or should."""
    tick_ms: float
    """Median duration of a tick."""


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
    """Tick through all frames, and at the last plan to a goal, by default to where the camera
    began.

    Raises `BadGeometry` for a goal that is not on the map.
    """
    spec = map_around(
        recording, T_map_world, reach_m=config.points.max_range_m, resolution_m=RESOLUTION_M
    )
    began = base_beneath(T_map_world @ recording.T_world_camera[0])
    goal = goal or (began.x_m, began.y_m)
    if not spec.contains(*goal):
        raise BadGeometry(
            f"the goal ({goal[0]:g}, {goal[1]:g}) is outside the recording's map, {spec.extent()}"
        )
    navigator = Navigator(spec=spec, profile=profile, segmenter=segmenter, config=config)
    durations_ms = []
    for done, frame in enumerate(frames_of(recording, T_map_world), start=1):
        order = NavigationRequest(
            goal=goal if done == len(recording) else None, beware=beware, zones=()
        )
        begun = time.perf_counter()
        decision = navigator.tick(frame, order)
        durations_ms.append((time.perf_counter() - begun) * 1e3)
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
    """The geometric layer of the map against what the reference has between obstacle height and
    ceiling."""
    rules, spec = config.points, replayed.navigator.map.spec
    heights_m = (rules.obstacle_height_m, rules.ceiling_m)
    return agreement(
        replayed.decision.occupancy.grid.geometric,
        *standing(reference, replayed.T_map_world, spec, heights_m=heights_m),
    )


def as_report(replayed: Replayed, judged: Agreement | None) -> dict[str, Any]:
    """What came of it, as JSON."""
    world, grid, route = (
        replayed.navigator.map,
        replayed.decision.occupancy.grid,
        replayed.decision.route,
    )
    outcome = route.outcome if route is not None else None
    found = isinstance(outcome, Path)
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
        "path_m": round(outcome.length * world.spec.resolution_m, 3)
        if isinstance(outcome, Path)
        else None,
        "no_path": None if found else str(getattr(outcome, "reason", "")),
        "waypoints": route.waypoints.tolist() if route is not None else [],
        "reference": None if judged is None else asdict(judged),
    }
