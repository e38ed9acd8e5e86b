"""Viewpoints before gaps: where only the safety margin or a person blocks the path, the robot
drives to the gap and measures again before it believes that there is no path.

From afar depth scatters, and a gap that is wide enough appears too narrow; a person who stood in
the gap may have walked on. So where there is no path, the robot drives to the entry of the most
promising gap: of all paths that its body fits through without the safety margin and without people,
the one with the fewest cells that margin or people close. It enters none of these cells, apart from
those within reach of its own cell, as at every start: these it may leave in any direction.

Depth scatters, so of two gaps that lack about equally much now one and now the other lacks less:
the robot keeps to the one that it drives to as long as its body fits through it.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from navcore.costmap.costmap import Costmap
from navcore.grid.bitplane import BitPlane, cells_of, complement, contains, plane_of
from navcore.grid.flood_fill import crossings, flood
from navcore.grid.grid import Cell, inflation_radius
from navcore.grid.inflation import inflated
from navcore.grid.nearest import cells_around, nearest_of
from navcore.mission.beware_list import NOTHING

Area = tuple[Cell, BitPlane]
"""A connected free area: its cell nearest to the robot, and all its cells."""


def viewpoint_before_gap(
    occupancy: Costmap,
    start: Cell,
    goal: Cell,
    *,
    people: Collection[int] = (),
    vehicle_width_m: float,
    relief_cells: float,
    body_m: float,
    present: BitPlane | None = None,
) -> tuple[Cell, Cell] | None:
    """Return the cell to start from and the viewpoint, both (row, col); None where no viewpoint
    would help.

    Both cells are free and connected. `start` is the robot's cell and may be closed: free cells
    within `relief_cells` of it count as reachable. Layers and zones keep their own margins, except
    the layers of `people`, class ids, since people walk on; geometric cells within `body_m` of
    theirs belong to the same bodies. Of equally promising gaps the one that is entered nearest to
    the goal is chosen; before all others one whose closed cells lie in `present`, the surroundings
    of the gap that the robot drives to.
    """
    areas = _areas(occupancy, start, relief_cells)
    for first, area in areas:
        if contains(area, goal):
            return None if first == goal else (first, goal)
    if not areas:
        return None
    within: BitPlane = np.bitwise_or.reduce([area for _, area in areas])
    closed = closed_by_margins(occupancy, people, vehicle_width_m=vehicle_width_m, body_m=body_m)
    entries = _entries(occupancy, within, goal, closed)
    if present is not None and entries.any():
        kept = _entries(occupancy, within, goal, closed & present)
        entries = kept if kept.any() else entries
    nearest = nearest_of(cells_of(entries), goal)
    if nearest is None:
        return None
    row, col = nearest
    first = next(first for first, area in areas if contains(area, (row, col)))
    return None if first == (row, col) else (first, (row, col))


def closed_by_margins(
    occupancy: Costmap, people: Collection[int], *, vehicle_width_m: float, body_m: float
) -> BitPlane:
    """Return the cells that only the safety margin or people close."""
    free, spec = occupancy.free.plane, occupancy.spec
    closed = free | _solid(occupancy, people, vehicle_width_m, body_m)
    complement(closed, spec.rows, spec.cols)
    return closed


def _areas(occupancy: Costmap, start: Cell, relief_cells: float) -> list[Area]:
    """The free areas within reach of the robot, that with the nearest cell first."""
    free = occupancy.free
    cells = cells_around(free, start, int(relief_cells))
    away = np.hypot(*(cells - start).T)
    areas: list[Area] = []
    for row, col in cells[
        np.argsort(away, kind="stable")[: int((away <= relief_cells).sum())]
    ].tolist():
        if not any(contains(area, (row, col)) for _, area in areas):
            area = plane_of((row, col), like=free.plane)
            flood(free.plane, area, area)
            areas.append(((row, col), area))
    return areas


def _entries(occupancy: Costmap, within: BitPlane, goal: Cell, closed: BitPlane) -> BitPlane:
    """The cells of `within` next to those at which the paths to the goal with the fewest cells of
    `closed` leave it."""
    free = occupancy.free.plane
    end = plane_of(goal, like=free)
    # Mostly there is no such path at all, and one flood tells.
    reached = np.zeros_like(end)
    flood(free | closed, reached, end & (free | closed))
    return crossings(free, closed, within, end) if (reached & within).any() else np.zeros_like(end)


def _solid(
    occupancy: Costmap, people: Collection[int], vehicle_width_m: float, body_m: float
) -> BitPlane:
    """The cells in which the body does not fit even without a safety margin and without people."""
    spec, rows, cols = occupancy.spec, occupancy.spec.rows, occupancy.spec.cols
    bodies = [
        mask.plane
        for class_id, _, mask in occupancy.layers
        if class_id in people and mask.plane.any()
    ]
    by_radius: dict[int, BitPlane] = {}
    for class_id, margin_m, mask in occupancy.layers:
        cells = mask.plane
        if class_id == NOTHING and bodies:
            cells = cells & ~inflated(
                {math.ceil(body_m / spec.resolution_m): np.bitwise_or.reduce(bodies)}, rows, cols
            )
        if class_id == NOTHING or (class_id not in people and cells.any()):
            radius = inflation_radius(
                vehicle_width_m=vehicle_width_m,
                safety_margin_m=margin_m,
                resolution_m=spec.resolution_m,
            )
            by_radius[radius] = by_radius[radius] | cells if radius in by_radius else cells
    return inflated(by_radius, rows, cols)
