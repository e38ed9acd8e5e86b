"""The paper's pictures of an episode: the driven path over the map, and explored volume and distance over time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt

mpl.use("Agg")
import matplotlib.pyplot as plt

from app.episode import Episode
from navcore.grid import GridSpec, OccupancyGrid
from navcore.local_planner import Points


def plot_episode(report: dict[str, Any], episode: Episode, folder: Path) -> None:
    """Write `map.png` and `progress.png` into a folder."""
    decision, world = episode.pilot.thought.decision, episode.pilot.navigator.map
    folder.mkdir(parents=True, exist_ok=True)
    if decision is not None:
        _plot_map(report, decision.occupancy.grid, world.explored.seen.bools, np.array(episode.driven), folder / "map.png")
    _plot_progress(report, folder / "progress.png")


def _plot_map(report: dict[str, Any], grid: OccupancyGrid, seen: npt.NDArray[np.bool_], driven: Points, path: Path) -> None:
    picture = np.full((*seen.shape, 3), 0.75)
    picture[seen] = 1.0
    picture[grid.geometric] = 0.1
    for layer in grid.beware.values():
        picture[layer] = (0.85, 0.1, 0.1)
    picture[grid.zones] = (0.8, 0.2, 0.8)
    figure, axes = plt.subplots(figsize=(10, 7))
    axes.imshow(picture, origin="lower", extent=_extent(grid.spec), interpolation="nearest")
    axes.plot(driven[:, 0], driven[:, 1], color="tab:blue", label="driven")
    axes.plot(*driven[0], "o", color="tab:green", label="S")
    for number, goal in enumerate(report["goals"], start=1):
        axes.plot(*goal, "*", color="tab:orange", markersize=14)
        axes.annotate(f"G{number}", goal, textcoords="offset points", xytext=(8, 8))
    axes.set(xlabel="x, m", ylabel="y, m", title=f"{report['scenario']}, seed {report['seed']}")
    axes.legend(loc="upper right")
    figure.savefig(path, dpi=100, bbox_inches="tight")
    plt.close(figure)


def _plot_progress(report: dict[str, Any], path: Path) -> None:
    series = report["series"]
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 6))
    above.plot(series["t_s"], series["explored_m3"])
    above.set(ylabel="explored volume, m³")
    below.plot(series["t_s"], series["distance_m"])
    below.set(ylabel="travelled distance, m", xlabel="time, s")
    figure.savefig(path, dpi=100, bbox_inches="tight")
    plt.close(figure)


def _extent(spec: GridSpec) -> tuple[float, float, float, float]:
    right, top = spec.origin_x_m + spec.cols * spec.resolution_m, spec.origin_y_m + spec.rows * spec.resolution_m
    return spec.origin_x_m, right, spec.origin_y_m, top
