"""One planning query on a stored map: the path, or the reason for a refusal in words."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.map_planner.stored_map import PlanMap
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, Cell
from navcore.grid.nearest import nearest_reachable
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan
from navcore.planning.string_pulling import taut_corners

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """Result of a query; points and lengths are in the map's unit."""

    start: Point
    """Start of the query."""
    goal: Point
    """Goal of the query."""
    reached: Point | None
    """End of the path: the goal, or the nearest reachable cell; None without a path."""
    refusal: str | None
    """Why the goal cannot be reached, in words; None if it can."""
    length: float | None
    """Length of the path; None without one."""
    cells: npt.NDArray[np.int64]
    """(N, 2) cells (row, col) from start to end, row 0 at the smallest y."""
    path: npt.NDArray[np.float64]
    """(N, 2) centres (x, y) of the cells."""
    waypoints: npt.NDArray[np.float64]
    """(M, 2) corners of the taut path and its end."""
    plan_ms: float
    """Duration of the search on the inflated cells that gave the path or the refusal,
    milliseconds."""


def ask(plan_map: PlanMap, start: Point, goal: Point, *, nearest: bool) -> Answer:
    """Plan the shortest path between two points; with `nearest`, to the reachable cell nearest to
    an unreachable goal."""
    # Load the compiled code first, which is no part of the measured time.
    plan(np.zeros((3, 3), dtype=np.bool_), (0, 0), (2, 2))
    ends, reached, refusal = (plan_map.cell(start), plan_map.cell(goal)), goal, None
    outcome, plan_ms = _timed_plan(plan_map.blocked, *ends)
    if isinstance(outcome, NoPath):
        refusal = explain(plan_map, start, goal, outcome)
        cell = nearest_reachable(plan_map.blocked, *ends) if nearest else None
        if cell is not None:
            reached = plan_map.spec.centre(*cell)
            outcome, plan_ms = _timed_plan(plan_map.blocked, ends[0], cell)
    found, spec = outcome if isinstance(outcome, Path) else None, plan_map.spec
    return Answer(
        start=start,
        goal=goal,
        reached=reached if found else None,
        refusal=refusal,
        length=found.length * spec.resolution_m if found else None,
        cells=found.cells if found else np.empty((0, 2), dtype=np.int64),
        path=spec.centres(found.cells) if found else np.empty((0, 2)),
        waypoints=_waypoints(found, plan_map) if found else np.empty((0, 2)),
        plan_ms=plan_ms,
    )


def _timed_plan(blocked: BoolGrid, start: Cell, end: Cell) -> tuple[Path | NoPath, float]:
    """Return the outcome of a search and its duration in milliseconds."""
    started = time.perf_counter()
    outcome = plan(blocked, start, end)
    return outcome, (time.perf_counter() - started) * 1e3


def _waypoints(found: Path, plan_map: PlanMap) -> npt.NDArray[np.float64]:
    corners = taut_corners(found.cells, CellMask.of(~plan_map.blocked).plane)
    return plan_map.spec.centres(np.vstack([corners[1:-1], corners[-1:]]))


def explain(plan_map: PlanMap, start: Point, goal: Point, outcome: NoPath) -> str:
    """Return why there is no path, in words."""
    if outcome.reason is Reason.UNREACHABLE:
        return (
            f"every path from ({start[0]:g}, {start[1]:g}) to ({goal[0]:g}, {goal[1]:g}) is blocked"
        )
    refusals = (plan_map.refusal("start", start), plan_map.refusal("goal", goal))
    return "; ".join(refusal for refusal in refusals if refusal) or str(outcome.reason)


def as_report(plan_map: PlanMap, answer: Answer) -> dict[str, object]:
    """Return the answer as a JSON object."""
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
    """Return the answer as lines of text."""
    lines = [] if answer.refusal is None else [f"no path: {answer.refusal}"]
    if answer.reached is None or answer.length is None:
        return lines
    if answer.refusal is not None:
        (x, y), distance = answer.reached, math.dist(answer.reached, answer.goal)
        lines.append(
            f"nearest reachable cell: ({x:g}, {y:g}), {distance:.2f} {plan_map.unit} from the goal"
        )
    steps, corners = len(answer.cells) - 1, len(answer.waypoints)
    decimals = 2 if plan_map.unit == "m" else 4
    lines.append(
        f"{answer.length:.{decimals}f} {plan_map.unit} in {steps} step{'s' * (steps != 1)}, "
        f"{corners} waypoint{'s' * (corners != 1)}, planned in {answer.plan_ms:.2f} ms; "
        f"obstacles inflated by {plan_map.radius} cells"
    )
    return lines
