"""Plot of a planned path over its map."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from app.map_planner.query import Answer
from app.map_planner.stored_map import PlanMap

Rgb = tuple[int, int, int]

FREE: Rgb = (255, 255, 255)
UNKNOWN: Rgb = (205, 208, 214)
INFLATED: Rgb = (255, 222, 178)
OCCUPIED: Rgb = (30, 32, 38)
LONGEST_SIDE_IN, DPI = 9.0, 150
"""Longer side of the map in inches, and resolution of the image."""


def draw_plan(plan_map: PlanMap, answer: Answer, *, title: str) -> bytes:
    """Return a PNG of the map, the inflated cells, the path and its waypoints."""
    rows, cols = plan_map.occupied.shape
    scale = LONGEST_SIDE_IN / max(rows, cols)
    figure = Figure(
        figsize=(max(cols * scale, 6) + 1, max(rows * scale, 3) + 1.5),
        dpi=DPI,
        layout="constrained",
    )
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    spec = plan_map.spec
    left, low = spec.origin_x_m, spec.origin_y_m
    extent = (left, left + cols * spec.resolution_m, low, low + rows * spec.resolution_m)
    axes.imshow(_coloured(plan_map), origin="lower", extent=extent, aspect="equal")
    if plan_map.unit == "cells":
        axes.invert_yaxis()  # row 0 of a MovingAI map is at the top
    if answer.reached is not None:
        axes.plot(*answer.path.T, color="#0a66d0", linewidth=1.6, label="path")
        axes.plot(*answer.waypoints.T, "o", color="#0a66d0", markersize=3.5, label="waypoints")
    if answer.reached not in (None, answer.goal):
        axes.plot(*answer.path[-1], "D", color="#c02878", markersize=6, label="nearest reachable")
    axes.plot(
        *answer.start, "o", color="#0a8f4f", markersize=8, markeredgecolor="white", label="start"
    )
    axes.plot(
        *answer.goal, "*", color="#d03020", markersize=14, markeredgecolor="white", label="goal"
    )
    for colour, name in ((INFLATED, "too close"), (UNKNOWN, "unknown")):
        axes.plot([], [], "s", color=np.array(colour) / 255, markersize=9, label=name)
    axes.set(xlabel=f"x, {plan_map.unit}", ylabel=f"y, {plan_map.unit}")
    axes.set_title(title, wrap=True, fontsize=9)
    figure.legend(loc="outside lower center", ncols=7, frameon=False)
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def _coloured(plan_map: PlanMap) -> npt.NDArray[np.uint8]:
    """Return the map as RGB (rows, cols, 3)."""
    image = np.full((*plan_map.occupied.shape, 3), FREE, dtype=np.uint8)
    image[plan_map.unknown] = UNKNOWN
    image[plan_map.blocked] = INFLATED
    image[plan_map.blocked & plan_map.unknown] = tuple(
        (a + b) // 2 for a, b in zip(INFLATED, UNKNOWN, strict=True)
    )
    image[plan_map.occupied] = OCCUPIED
    return image
