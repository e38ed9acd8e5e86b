"""Random scattering of trees, rocks and mines that leaves passages for the robot: each keeps a gap
around it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import shapely

from sim.models.ground import Floats
from sim.scenario.layout import items, obstacles
from sim.scenario.schema import Furniture, Item, Scenario

KEEP_CLEAR_M = 2.5
"""Clearance around the start, goals, people and the lines of walkers."""
TRIES = 12
"""Number of positions that are tried for each object."""
EDGE_M = 1.0
"""Clearance from the edge of the world."""
ROUND = ("tree", "conifer", "bush")
"""Round kinds, whose width equals their depth."""


def scatter(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """Return the scenario with the objects of its `scatter` as furniture and items."""
    occupied, kept_free = _occupied(scenario), _kept_free(scenario)
    placed = np.empty((0, 4))
    furniture, mines = list(scenario.furniture), list(scenario.items)
    for group in scenario.scatter:
        (x0, y0), (x1, y1) = group.corners or _whole_floor(scenario)
        low, high = np.array(group.least_m), np.array(group.most_m)
        tries = TRIES * group.count
        at = np.column_stack([rng.uniform(x0, x1, tries), rng.uniform(y0, y1, tries)])
        sizes = low + (high - low) * rng.random((tries, 3))
        if group.kind in ROUND:
            sizes[:, 1] = sizes[:, 0]
        turns = rng.uniform(-180, 180, tries)
        circles = np.column_stack(
            [at, np.hypot(sizes[:, 0], sizes[:, 1]) / 2, np.full(tries, group.gap_m)]
        )
        points = shapely.points(at)
        circles[:, 2] /= np.sqrt(2) if group.kind in ROUND else 1.0
        free = shapely.distance(points, occupied) > circles[:, 2] + group.gap_m
        free &= shapely.distance(points, kept_free) > circles[:, 2] + KEEP_CLEAR_M
        free &= (np.abs(at) + circles[:, 2, None] < np.array(scenario.size_m) / 2).all(axis=1)
        chosen, placed = _select_apart(np.flatnonzero(free), circles, placed, group.count)
        for i in chosen:
            x, y, depth, width, height, turn = (
                round(float(v), 4) for v in (*at[i], *sizes[i], turns[i])
            )
            size = (depth, width, height)
            if group.kind == "landmine":
                mines.append(Item(kind="landmine", at=(x, y), yaw_deg=turn, size_m=size))
            else:
                furniture.append(Furniture(kind=group.kind, at=(x, y), yaw_deg=turn, size_m=size))
    return replace(scenario, furniture=tuple(furniture), items=tuple(mines))


def _select_apart(
    candidates: npt.NDArray[np.int64], circles: Floats, placed: Floats, count: int
) -> tuple[list[int], Floats]:
    """Return the first `count` candidates that keep clear of all circles, and all circles then.

    Circles are (N, 4): x, y, radius and gap; of two neighbours the larger gap counts.
    """
    found = np.concatenate([placed, np.empty((count, 4))])
    chosen: list[int] = []
    for i in candidates.tolist():
        others, own = found[: len(placed) + len(chosen)], circles[i]
        spacing = own[2] + others[:, 2] + np.maximum(own[3], others[:, 3])
        if ((others[:, 0] - own[0]) ** 2 + (others[:, 1] - own[1]) ** 2 > spacing**2).all():
            found[len(placed) + len(chosen)] = own
            chosen.append(i)
            if len(chosen) == count:
                break
    return chosen, found[: len(placed) + len(chosen)]


def _occupied(scenario: Scenario) -> shapely.Geometry:
    """Return the outlines of all objects in the file; scattered objects keep a gap from them."""
    objects = (*obstacles(scenario), *items(scenario))
    shapes = [shapely.Polygon(outline) for entry in objects for outline in entry.outlines()]
    shapes += [shapely.Polygon(marking.polygon) for marking in scenario.markings]
    occupied = shapely.union_all([*shapes, shapely.Point(1e6, 1e6)])
    shapely.prepare(occupied)
    return occupied


def _kept_free(scenario: Scenario) -> shapely.Geometry:
    """Return start, goals, people and the lines of walkers."""
    paths = [
        shapely.LineString(person.points) for person in scenario.people if len(person.points) > 1
    ]
    points = [
        scenario.start[:2],
        *scenario.goals,
        *(person.points[0] for person in scenario.people),
    ]
    return shapely.union_all([*paths, *(shapely.Point(point) for point in points)])


def _whole_floor(scenario: Scenario) -> tuple[tuple[float, float], tuple[float, float]]:
    x, y = (side / 2 - EDGE_M for side in scenario.size_m)
    return (-x, -y), (x, y)
