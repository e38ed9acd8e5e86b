"""Strews trees, rocks and mines at random, but never so that a robot no longer gets through: around
each there is room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import shapely

from sim.models.ground import Floats
from sim.scenario.layout import items, obstacles
from sim.scenario.schema import Furniture, Item, Scenario

CLEAR_M = 2.5
"""Nothing is strewn nearer to the start, a goal or somebody's way than this."""
TRIES = 12
"""Places that are looked at for each thing."""
EDGE_M = 1.0
"""Nothing is strewn nearer to the end of the world."""
ROUND = ("tree", "conifer", "bush")
"""As wide as they are deep."""


def strew(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The scenario with all that its `scatter` tells of, as furniture and items."""
    taken, kept_free = _taken(scenario), _kept_free(scenario)
    there = np.empty((0, 4))
    furniture, mines = list(scenario.furniture), list(scenario.items)
    for strewn in scenario.scatter:
        (x0, y0), (x1, y1) = strewn.corners or _whole(scenario)
        low, high = np.array(strewn.least_m), np.array(strewn.most_m)
        tries = TRIES * strewn.count
        at = np.column_stack([rng.uniform(x0, x1, tries), rng.uniform(y0, y1, tries)])
        sizes = low + (high - low) * rng.random((tries, 3))
        if strewn.kind in ROUND:
            sizes[:, 1] = sizes[:, 0]
        turns = rng.uniform(-180, 180, tries)
        circles = np.column_stack(
            [at, np.hypot(sizes[:, 0], sizes[:, 1]) / 2, np.full(tries, strewn.gap_m)]
        )
        spots = shapely.points(at)
        circles[:, 2] /= np.sqrt(2) if strewn.kind in ROUND else 1.0
        free = shapely.distance(spots, taken) > circles[:, 2] + strewn.gap_m
        free &= shapely.distance(spots, kept_free) > circles[:, 2] + CLEAR_M
        free &= (np.abs(at) + circles[:, 2, None] < np.array(scenario.size_m) / 2).all(axis=1)
        chosen, there = _apart(np.flatnonzero(free), circles, there, strewn.count)
        for i in chosen:
            x, y, depth, width, height, turn = (
                round(float(v), 4) for v in (*at[i], *sizes[i], turns[i])
            )
            size = (depth, width, height)
            if strewn.kind == "landmine":
                mines.append(Item(kind="landmine", at=(x, y), yaw_deg=turn, size_m=size))
            else:
                furniture.append(Furniture(kind=strewn.kind, at=(x, y), yaw_deg=turn, size_m=size))
    return replace(scenario, furniture=tuple(furniture), items=tuple(mines))


def _apart(
    candidates: npt.NDArray[np.int64], circles: Floats, there: Floats, count: int
) -> tuple[list[int], Floats]:
    """The first `count` of the candidates that keep off all that is there, and all that is there
    then.

    Circles are (N, 4): x, y, radius and the room around; of two neighbours the one that wants more
    room gets it.
    """
    found = np.concatenate([there, np.empty((count, 4))])
    chosen: list[int] = []
    for i in candidates.tolist():
        others, own = found[: len(there) + len(chosen)], circles[i]
        room = own[2] + others[:, 2] + np.maximum(own[3], others[:, 3])
        if ((others[:, 0] - own[0]) ** 2 + (others[:, 1] - own[1]) ** 2 > room**2).all():
            found[len(there) + len(chosen)] = own
            chosen.append(i)
            if len(chosen) == count:
                break
    return chosen, found[: len(there) + len(chosen)]


def _taken(scenario: Scenario) -> shapely.Geometry:
    """Outlines of all that the file places: what is strewn keeps its own room off it."""
    things = (*obstacles(scenario), *items(scenario))
    shapes = [shapely.Polygon(outline) for thing in things for outline in thing.outlines()]
    shapes += [shapely.Polygon(marking.polygon) for marking in scenario.markings]
    taken = shapely.union_all([*shapes, shapely.Point(1e6, 1e6)])
    shapely.prepare(taken)
    return taken


def _kept_free(scenario: Scenario) -> shapely.Geometry:
    """Start, goals and everybody's way."""
    ways = [
        shapely.LineString(person.points) for person in scenario.people if len(person.points) > 1
    ]
    spots = [scenario.start[:2], *scenario.goals, *(person.points[0] for person in scenario.people)]
    return shapely.union_all([*ways, *(shapely.Point(spot) for spot in spots)])


def _whole(scenario: Scenario) -> tuple[tuple[float, float], tuple[float, float]]:
    x, y = (side / 2 - EDGE_M for side in scenario.size_m)
    return (-x, -y), (x, y)
