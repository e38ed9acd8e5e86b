"""Plot of a replayed recording: the map with the camera's trajectory and the path, the agreement
with the reference, and two images."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from app.map_planner.plot import FREE, INFLATED, OCCUPIED, UNKNOWN
from app.replay.recording import Recording
from app.replay.reference import Reference, occupied_cells
from app.replay.run import Replayed
from navcore.config.navigator import NavigatorConfig
from navcore.grid.grid import BoolGrid, GridSpec

BEWARE = (217, 26, 26)
BOTH, OURS, THEIRS = (120, 124, 132), (230, 126, 34), (52, 120, 214)
EDGE_M = 0.6
"""Margin of the plot around the blocked cells, metres."""


def draw_replay(
    recording: Recording,
    replayed: Replayed,
    reference: Reference | None,
    config: NavigatorConfig,
    *,
    title: str,
) -> bytes:
    """Return a PNG of the map, of its agreement with the reference, and of the first and the last
    image."""
    columns = 1 if reference is None else 2
    figure = Figure(figsize=(7 * columns, 10), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subfigures(2, 1, height_ratios=(2, 1))  # type: ignore[misc]  # the stubs declare one figure, two are returned
    maps = np.atleast_1d(above.subplots(1, columns))
    _draw_map(maps[0], recording, replayed)
    if reference is not None:
        heights_m = (config.points.obstacle_height_m, config.points.ceiling_m)
        theirs, known = occupied_cells(
            reference, replayed.T_map_world, replayed.navigator.map.spec, heights_m=heights_m
        )
        _draw_agreement(maps[1], replayed, theirs, known)
    for axes, index in zip(below.subplots(1, 2), (0, len(recording) - 1), strict=True):
        axes.imshow(recording.rgb(index))
        axes.set(title=f"frame {recording.numbers[index]}", xticks=(), yticks=())
    figure.suptitle(title, fontsize=10)
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def _draw_map(axes: Axes, recording: Recording, replayed: Replayed) -> None:
    world, occupancy, route = (
        replayed.navigator.map,
        replayed.decision.occupancy,
        replayed.decision.route,
    )
    image = np.full((world.spec.rows, world.spec.cols, 3), UNKNOWN, dtype=np.uint8)
    image[world.explored.seen.bools] = FREE
    image[occupancy.blocked] = INFLATED
    image[occupancy.grid.geometric] = OCCUPIED
    for layer in occupancy.grid.beware.values():
        image[layer] = BEWARE
    _show(axes, image, replayed)
    positions = (
        recording.T_world_camera[:, :3, 3] @ replayed.T_map_world[:2, :3].T
        + replayed.T_map_world[:2, 3]
    )
    axes.plot(*positions.T, color="#0a8f4f", linewidth=1, label="camera")
    if route is not None and len(route.points):
        axes.plot(*route.points.T, color="#0a66d0", linewidth=1.8, label="path")
        axes.plot(*route.waypoints.T, "o", color="#0a66d0", markersize=4, label="waypoints")
    axes.plot(
        *replayed.goal, "*", color="#d03020", markersize=14, markeredgecolor="white", label="goal"
    )
    for colour, name in ((INFLATED, "too close"), (UNKNOWN, "unknown"), (BEWARE, "beware")):
        axes.plot([], [], "s", color=np.array(colour) / 255, label=name)
    axes.set_title("the map, and a path on it")
    axes.legend(fontsize=8, loc="upper left")


def _draw_agreement(axes: Axes, replayed: Replayed, theirs: BoolGrid, known: BoolGrid) -> None:
    ours = replayed.decision.occupancy.grid.geometric
    image = np.full((*ours.shape, 3), UNKNOWN, dtype=np.uint8)
    image[known] = FREE
    for mask, colour in (
        (ours & theirs, BOTH),
        (ours & ~theirs & known, OURS),
        (theirs & ~ours, THEIRS),
    ):
        image[mask] = colour
    _show(axes, image, replayed)
    for colour, name in ((BOTH, "both"), (OURS, "the map alone"), (THEIRS, "the reference alone")):
        axes.plot([], [], "s", color=np.array(colour) / 255, label=name)
    axes.set_title("occupied cells beside the reference")
    axes.legend(fontsize=8, loc="upper left")


def _show(axes: Axes, image: npt.NDArray[np.uint8], replayed: Replayed) -> None:
    spec, route = replayed.navigator.map.spec, replayed.decision.route
    axes.imshow(image, origin="lower", extent=_extent(spec), interpolation="nearest")
    shown = [
        spec.centres(np.argwhere(replayed.decision.occupancy.blocked)),
        np.array([replayed.goal]),
    ]
    points = np.vstack(shown if route is None else [*shown, route.points])
    (left, low), (right, high) = points.min(axis=0) - EDGE_M, points.max(axis=0) + EDGE_M
    axes.set(xlim=(left, right), ylim=(low, high), xlabel="x, m", ylabel="y, m")


def _extent(spec: GridSpec) -> tuple[float, float, float, float]:
    right, top = (
        spec.origin_x_m + spec.cols * spec.resolution_m,
        spec.origin_y_m + spec.rows * spec.resolution_m,
    )
    return spec.origin_x_m, right, spec.origin_y_m, top
