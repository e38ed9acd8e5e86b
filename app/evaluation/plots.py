"""The paper's figures of an episode, as PNG and SVG: top view, progress over time, keyframes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch, Polygon

from app.episode.episode import Episode
from app.episode.keyframes import Keyframe, Keyframes
from app.runtime.control.robot_controller import COMMAND_PERIOD_S
from navcore.geometry.arrays import Points
from navcore.grid.grid import GridSpec, OccupancyGrid
from navcore.planning.route import Route
from sim.scenario.layout import obstacles
from sim.scenario.schema import Scenario
from sim.truth.true_objects import true_objects

Image = npt.NDArray[np.float64]
RED, VIOLET = (0.84, 0.15, 0.16), (0.58, 0.40, 0.74)
CLASS_COLOURS = [to_rgb(colour) for colour in mpl.color_sequences["tab10"]]
"""Colours by class id, repeating."""
DPI = 110


def plot_episode(
    report: Mapping[str, Any], episode: Episode, keyframes: Keyframes, folder: Path
) -> None:
    """Write `top_view`, `progress` and `frames`, each as .png and .svg, into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    decision = episode.controller.tick_state.decision
    if decision is not None:
        seen = episode.controller.navigator.map.explored.seen.bools
        ground = paint(decision.occupancy.grid, seen)
        save(top_view(report, episode, keyframes.routes, ground), folder / "top_view")
    save(progress([report], f"{report['scenario']}, seed {report['seed']}"), folder / "progress")
    names = {entry.class_id: entry.name for entry in episode.controller.intent.beware.classes}
    shots = keyframes.selected()
    if shots:
        save(frames(shots, names), folder / "frames")


def save(figure: Any, path: Path) -> None:
    """Save as PNG and SVG without a time stamp, so that the same run gives the same files."""
    figure.savefig(path.with_suffix(".png"), dpi=DPI, bbox_inches="tight")
    with mpl.rc_context({"svg.hashsalt": path.name}):
        figure.savefig(path.with_suffix(".svg"), bbox_inches="tight", metadata={"Date": None})
    plt.close(figure)


def paint(grid: OccupancyGrid, seen: npt.NDArray[np.bool_]) -> Image:
    """Return the robot's map as (rows, cols, 3) RGB from 0 to 1: unknown grey, seen white,
    obstacles dark, beware cells red, zones violet."""
    image = np.full((*seen.shape, 3), 0.78)
    image[seen] = 1.0
    image[grid.zones] = (0.88, 0.82, 0.94)
    image[grid.geometric] = 0.15
    for layer in grid.beware.values():
        image[layer] = (0.97, 0.55, 0.50)
    return image


def top_view(
    report: Mapping[str, Any], episode: Episode, planned: Sequence[Route], ground: Image
) -> Any:
    """Draw the map with hazards, zones, people, planned paths, waypoints, and the driven path
    coloured by time."""
    spec = episode.spec
    figure, axes = plt.subplots(figsize=(11, 11 * min(max(spec.rows / spec.cols, 0.4), 1.0) + 0.8))
    axes.imshow(ground, origin="lower", extent=extent(spec), interpolation="nearest")
    for polygon in report["zones"]:
        axes.add_patch(
            Polygon(polygon, closed=True, fill=False, edgecolor=VIOLET, hatch="//", linewidth=1.2)
        )
    draw_hazards(axes, episode.scenario)
    for number, route in enumerate(planned):
        axes.plot(
            *route.points.T,
            "--",
            color="0.35",
            linewidth=1.0,
            label=None if number else "planned at first",
        )
        axes.plot(
            *route.waypoints.T,
            ".",
            color="0.2",
            markersize=5,
            label=None if number else "its waypoints",
        )
    driven = draw_driven(axes, np.array(episode.driven))
    if driven is not None:
        figure.colorbar(driven, ax=axes, label="driven path, time in s", fraction=0.03, pad=0.02)
    _draw_stations(axes, report)
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal", title=_title(report))
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.07), ncols=4, frameon=False)
    return figure


def draw_driven(axes: Any, positions: Points) -> Any:
    """Draw the driven positions (N, 2) coloured by time; return the artist for a colour bar, or
    None for fewer than two positions."""
    if len(positions) < 2:
        return None
    pieces = np.stack([positions[:-1], positions[1:]], axis=1)
    line = LineCollection(list(pieces), cmap="turbo", linewidth=2.4, capstyle="round")
    line.set_array(np.arange(len(pieces)) * COMMAND_PERIOD_S)
    return axes.add_collection(line)


def draw_hazards(axes: Any, scenario: Scenario) -> None:
    """Draw the true hazards by name, the outlines of raised ground, and the paths of people."""
    for part in scenario.raised:
        grey = {"edgecolor": "0.45", "linewidth": 0.8}
        axes.add_patch(Polygon(part.outline(), closed=True, fill=False, **grey))
    for hazard in true_objects(scenario):
        for outline in hazard.outlines:
            axes.add_patch(Polygon(outline, closed=True, fill=False, edgecolor=RED, linewidth=1.4))
        axes.annotate(
            hazard.name,
            hazard.outlines[0].mean(axis=0),
            (7, 7),
            textcoords="offset points",
            color=RED,
            fontsize=8,
        )
    for person in scenario.people:
        points = np.array(person.points)
        axes.plot(*points[0], "o", color="goldenrod", markersize=6, zorder=3)
        for here, there in pairwise(points):
            arrow = {"arrowstyle": "<->", "color": "goldenrod", "linewidth": 1.6}
            axes.annotate("", xy=there, xytext=here, arrowprops=arrow)


def progress(reports: Sequence[Mapping[str, Any]], title: str) -> Any:
    """Draw explored volume and driven distance over time, of one or many episodes."""
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 6))
    style = (
        {"color": "tab:blue", "linewidth": 1.8}
        if len(reports) == 1
        else {"color": "tab:blue", "alpha": 0.35}
    )
    for report in reports:
        series = report["series"]
        above.plot(series["t_s"], series["explored_m3"], **style)
        below.plot(series["t_s"], series["distance_m"], **style)
    above.set(ylabel="explored volume, m³", title=title)
    below.set(ylabel="travelled distance, m", xlabel="time, s")
    for axes in (above, below):
        axes.grid(alpha=0.3)
    return figure


def all_drives(reports: Sequence[Mapping[str, Any]], world: Scenario, title: str) -> Any:
    """Draw the true world of one seed with every driven path: successful ones blue, failed ones
    red. Furniture stands elsewhere for each seed."""
    figure, axes = plt.subplots(figsize=(11, 9))
    for obstacle in obstacles(world):
        for outline in obstacle.outlines():
            axes.add_patch(Polygon(outline, closed=True, color="0.25", linewidth=0))
    draw_hazards(axes, world)
    for report in sorted(reports, key=lambda report: not report["success"]):
        colour = "tab:blue" if report["success"] else "tab:red"
        series = report["series"]
        axes.plot(series["x_m"], series["y_m"], color=colour, linewidth=1.2, alpha=0.6)
        axes.plot(
            series["x_m"][-1],
            series["y_m"][-1],
            "o" if report["success"] else "X",
            color=colour,
            markersize=5,
        )
    successes = sum(bool(report["success"]) for report in reports)
    half_x, half_y = world.size_m[0] / 2, world.size_m[1] / 2
    axes.set(
        xlim=(-half_x - 0.5, half_x + 0.5),
        ylim=(-half_y - 0.5, half_y + 0.5),
        aspect="equal",
        xlabel="x, m",
    )
    axes.set(ylabel="y, m", title=f"{title}\n{successes} of {len(reports)} succeeded")
    return figure


def frames(keyframes: Sequence[Keyframe], names: Mapping[int, str]) -> Any:
    """Draw a column per keyframe: colour image, mask of the enabled classes, and overlay."""
    figure, grid = plt.subplots(
        3, len(keyframes), figsize=(2.6 * len(keyframes) + 0.4, 5.0), squeeze=False
    )
    for number, (keyframe, column) in enumerate(zip(keyframes, grid.T, strict=True), start=1):
        mask = np.repeat((keyframe.class_ids > 0)[..., None], 3, axis=2)
        images = (keyframe.rgb, mask.astype(np.float64), overlay(keyframe))
        titles = (f"{number}: {keyframe.t_s:.0f} s", f"{number}*", "")
        for axes, image, title in zip(column, images, titles, strict=True):
            axes.imshow(image)
            axes.set_title(title, fontsize=9)
            axes.set(xticks=[], yticks=[])
    for axes, what in zip(grid[:, 0], ("RGB", "mask", "overlay"), strict=True):
        axes.set_ylabel(what)
    shown = sorted(
        {
            int(class_id)
            for keyframe in keyframes
            for class_id in np.unique(keyframe.class_ids)
            if class_id
        }
    )
    patches = [
        Patch(color=colour_of(class_id), label=names.get(class_id, str(class_id)))
        for class_id in shown
    ]
    if patches:
        figure.legend(
            handles=patches,
            loc="lower center",
            ncols=min(len(patches), 6),
            frameon=False,
            fontsize=9,
        )
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    return figure


def overlay(keyframe: Keyframe) -> Image:
    """Return the image (H, W, 3) from 0 to 1 with the colour of each class over it."""
    image = keyframe.rgb / 255
    for class_id in np.unique(keyframe.class_ids):
        if class_id:
            here = keyframe.class_ids == class_id
            image[here] = 0.35 * image[here] + 0.65 * np.array(colour_of(int(class_id)))
    return image


def colour_of(class_id: int) -> tuple[float, float, float]:
    """Return the RGB colour of a class, from 0 to 1."""
    return CLASS_COLOURS[(class_id + 2) % len(CLASS_COLOURS)]  # class 1, the red floor, is red


def extent(spec: GridSpec) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of a grid in metres."""
    right, top = (
        spec.origin_x_m + spec.cols * spec.resolution_m,
        spec.origin_y_m + spec.rows * spec.resolution_m,
    )
    return spec.origin_x_m, right, spec.origin_y_m, top


def _draw_stations(axes: Any, report: Mapping[str, Any]) -> None:
    x, y, _ = report["start"]
    named = [
        ("S", (x, y)),
        *((f"G{number}", goal) for number, goal in enumerate(report["goals"], start=1)),
    ]
    for name, point in named:
        marker = (
            {"marker": "o", "color": "tab:green"}
            if name == "S"
            else {"marker": "*", "color": "tab:orange"}
        )
        axes.plot(*point, linestyle="", markersize=13, markeredgecolor="black", zorder=4, **marker)
        axes.annotate(
            name, point, (9, -13), textcoords="offset points", fontsize=11, weight="bold", zorder=5
        )


def _title(report: Mapping[str, Any]) -> str:
    outcome = "success" if report["success"] else "; ".join(report["causes"])
    driven = f"{report['distance_m']:.1f} m in {report['sim_time_s']:.0f} s"
    return f"{report['scenario']}, seed {report['seed']}: {outcome}; {driven}"
