"""One query on a stored map: the path, or in words why there is none."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.map_planner.stored_map import PlanMap
from navcore.grid.nearest import nearest_reachable
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan
from navcore.planning.waypoints import DEFAULT_VERTEX_ANGLE_RAD, choose_waypoints

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What came of a query; points are in the map's unit."""

    start: Point
    """As asked."""
    goal: Point
    """As asked."""
    reached: Point | None
    """Where the path ends: the goal, or the nearest reachable place; None without a path."""
    refusal: str | None
    """Why the goal itself cannot be had, in words; None if it can."""
    length: float | None
    """Of the path."""
    cells: npt.NDArray[np.int64]
    """(N, 2) every cell (row, col) from start to end, row 0 at the smallest y."""
    path: npt.NDArray[np.float64]
    """(N, 2) their centres (x, y)."""
    waypoints: npt.NDArray[np.float64]
    """(M, 2) the path's corners and its end."""
    plan_ms: float
    """Duration of the search on the inflated cells."""


def ask(plan_map: PlanMap, start: Point, goal: Point, *, nearest: bool) -> Answer:
    """The shortest path between two points; with `nearest`, to as near as one can get to a goal
    that cannot be reached."""
    plan(
        np.zeros((3, 3), dtype=np.bool_), (0, 0), (2, 2)
    )  # loads the compiled code, which is no part of the figures
    ends, reached, refusal = (plan_map.cell(start), plan_map.cell(goal)), goal, None
    begun = time.perf_counter()
    outcome = plan(plan_map.blocked, *ends)
    if isinstance(outcome, NoPath):
        refusal = explain(plan_map, start, goal, outcome)
        cell = nearest_reachable(plan_map.blocked, *ends) if nearest else None
        if cell is not None:
            reached, outcome = plan_map.spec.centre(*cell), plan(plan_map.blocked, ends[0], cell)
    plan_ms = (time.perf_counter() - begun) * 1e3
    found, spec = outcome if isinstance(outcome, Path) else None, plan_map.spec
    return Answer(
        start=start,
        goal=goal,
        reached=reached if found else None,
        refusal=refusal,
        length=found.length * spec.resolution_m if found else None,
        cells=found.cells if found else np.empty((0, 2), dtype=np.int64),
        path=spec.centres(found.cells) if found else np.empty((0, 2)),
        waypoints=choose_waypoints(found, spec, max_vertex_angle_rad=DEFAULT_VERTEX_ANGLE_RAD)
        if found
        else np.empty((0, 2)),
        plan_ms=plan_ms,
    )


def explain(plan_map: PlanMap, start: Point, goal: Point, outcome: NoPath) -> str:
    """Why there is no path, in words."""
    if outcome.reason is Reason.UNREACHABLE:
        return (
            f"every way from ({start[0]:g}, {start[1]:g}) to ({goal[0]:g}, {goal[1]:g}) is closed"
        )
    refusals = (plan_map.refusal("start", start), plan_map.refusal("goal", goal))
    return "; ".join(refusal for refusal in refusals if refusal) or str(outcome.reason)


def as_report(plan_map: PlanMap, answer: Answer) -> dict[str, object]:
    """The answer as JSON."""
    return {
        "map": plan_map.name,
        "unit": plan_map.unit,
        "resolution": plan_map.spec.resolution_m,
        "inflation": {"width": plan_map.width, "margin": plan_map.margin, "cells": plan_map.radius},
        "start": answer.start,
        "goal": answer.goal,
        "found": answer.reached is not None,
        "reached": answer.reached,
        "reason": answer.refusal,
        "length": answer.length,
        "plan_ms": answer.plan_ms,
        "waypoints": answer.waypoints.tolist(),
        "path": answer.path.tolist(),
        "cells": answer.cells.tolist(),
    }


def in_words(plan_map: PlanMap, answer: Answer) -> list[str]:
    """The answer in a line or a few."""
    lines = [] if answer.refusal is None else [f"no path: {answer.refusal}"]
    if answer.reached is None or answer.length is None:
        return lines
    if answer.refusal is not None:
        (x, y), away = answer.reached, math.dist(answer.reached, answer.goal)
        lines.append(
            f"nearest reachable place: ({x:g}, {y:g}), {away:.2f} {plan_map.unit} from the goal"
        )
    steps, corners = len(answer.cells) - 1, len(answer.waypoints)
    lines.append(
        f"{answer.length:.{2 if plan_map.unit == 'm' else 4}f} {plan_map.unit} in {steps} step{'s' * (steps != 1)}, "
        f"{corners} waypoint{'s' * (corners != 1)}, planned in {answer.plan_ms:.2f} ms; "
        f"obstacles inflated by {plan_map.radius} cells"
    )
    return lines
