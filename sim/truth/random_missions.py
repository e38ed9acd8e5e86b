"""Draws a start, a goal and zones for a seed, so that the goal can be reached on the true map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from navcore.errors import BadConfiguration
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.robot.profile import RobotProfile
from sim.models.solids import Polygon, rectangle
from sim.physics.pedestrians import BODY_DIAMETER_M
from sim.scenario.layout import obstacles
from sim.scenario.schema import Scenario
from sim.truth.shortest_path import Floats, Spot, length_m, shortest_way
from sim.truth.true_map import rasterise
from sim.truth.true_objects import PERSON, true_things

SALT = 0x7A5C
"""Keeps what is drawn here apart from all else that a seed decides."""
ROOM_M = 0.1
"""Beyond the margins that the robot keeps: its map is never quite right."""
WALK_M = 0.6
"""Goals and starts keep so far from where somebody walks, beside his body."""
FAR_SHARE = 0.25
"""A goal is at least this share of the world's shorter side away …"""
LEAST_WAY_M = 4.0
"""… and at least so far, where the world is large enough."""
TRIES = 200
ZONE_SIDE_M = (0.8, 2.0)
ZONE_GAP_M = 1.2
"""Zones keep so far from start and goals."""


def draw_places(
    scenario: Scenario,
    seed: int,
    *,
    robot: RobotProfile,
    margin_m: float,
    start_clear_m: float,
    margins_m: Mapping[str, float],
) -> Scenario:
    """The scenario, as a seed has made it, with a start and one goal drawn at random.

    The robot has `start_clear_m` of room at its start, and between start and goal the true map
    leaves it a way that keeps half its width and `margin_m` from everything, and the `margins_m` of
    its class from everything to beware of, and a little more. Raises `BadConfiguration` where there
    is no such place.
    """
    rng = np.random.default_rng((seed, SALT))
    spec = GridSpec.centred(size_m=scenario.size_m, resolution_m=0.1)
    away_m = room_m(scenario, spec, margins_m)
    reach_m = robot.circumscribed_radius_m + ROOM_M
    starts = np.argwhere((away_m >= max(start_clear_m, reach_m)) & ~_walked(scenario, spec))
    areas = _areas(away_m >= robot.width_m / 2 + margin_m + ROOM_M)
    goals = (away_m >= max(reach_m, robot.width_m / 2 + margin_m + ROOM_M)) & ~_walked(
        scenario, spec
    )
    side_m = min(scenario.size_m)
    least_m = max(FAR_SHARE * side_m, min(LEAST_WAY_M, 0.4 * side_m))
    for _ in range(TRIES if len(starts) else 0):
        start = starts[rng.integers(len(starts))]
        there = np.argwhere(goals & (areas == areas[tuple(start)]))
        if not len(there):
            continue
        goal = there[rng.integers(len(there))]
        (x, y), (gx, gy) = spec.centres(np.array([start, goal])).tolist()
        if math.hypot(gx - x, gy - y) >= least_m:
            pose = (round(x, 3), round(y, 3), round(float(rng.uniform(-math.pi, math.pi)), 4))
            return dataclasses.replace(scenario, start=pose, goals=((round(gx, 3), round(gy, 3)),))
    raise BadConfiguration(
        f"world {scenario.name!r}: no start with {max(start_clear_m, reach_m):.2f} m of room and a goal {least_m:.1f} m away "
        f"that can be reached from it, in {TRIES} tries; the world is too small or too full for --random"
    )


def draw_zones(
    scenario: Scenario, seed: int, count: int, *, inflation_m: float, margins_m: Mapping[str, float]
) -> tuple[tuple[Spot, ...], ...]:
    """Up to `count` rectangles of the floor across the robot's shortest way, each so that there is
    another way.

    Fewer where none of the tries leaves another. The robot's middle keeps `inflation_m` from
    everything, and from what is to beware of the `margins_m` of its class beside.
    """
    if not count:
        return ()
    polygons = _in_the_way(scenario, margins_m)
    rng = np.random.default_rng((seed, SALT, 1))
    spec = GridSpec.centred(size_m=scenario.map.size_m, resolution_m=scenario.map.resolution_m)
    stations = [(scenario.start[0], scenario.start[1]), *scenario.goals]
    zones: list[Polygon] = []
    way = shortest_way(polygons, inflation_m, spec, stations)
    for _ in range(8 * count):
        if way is None or len(zones) == count:
            break
        zone = _zone_on(way, rng)
        if any(_apart_m(zone, spot) < ZONE_GAP_M for spot in stations):
            continue
        around = shortest_way([*polygons, *zones, zone], inflation_m + ROOM_M, spec, stations)
        if around is not None:
            zones.append(zone)
            way = around
    return tuple(tuple((round(float(x), 3), round(float(y), 3)) for x, y in zone) for zone in zones)


def room_m(
    scenario: Scenario, spec: GridSpec, margins_m: Mapping[str, float]
) -> npt.NDArray[np.float32]:
    """(rows, cols) how far each cell is from everything that stands or lies, less the margin of its
    class; 0 off the floor."""
    standing = [np.array(person.points[0]) for person in scenario.people if len(person.points) == 1]
    groups: dict[float, list[Polygon]] = {
        0.0: [outline for thing in obstacles(scenario) for outline in thing.outlines()]
    }
    for thing in true_things(scenario):
        groups.setdefault(margins_m.get(thing.name, 0.0), []).extend(thing.outlines)
    body = rectangle(BODY_DIAMETER_M, BODY_DIAMETER_M)
    groups.setdefault(margins_m.get(PERSON, 0.0), []).extend(body + place for place in standing)
    away_m = np.full((spec.rows, spec.cols), np.inf, dtype=np.float32)
    edge = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    edge[[0, -1]] = edge[:, [0, -1]] = True
    for margin_m, mask in [
        (0.0, edge),
        *((margin_m, rasterise(polygons, spec)) for margin_m, polygons in groups.items()),
    ]:
        if mask.any():
            cells = cv2.distanceTransform(
                (~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
            )
            # From the cell's middle to the side of the other, at least.
            away_m = np.minimum(away_m, (cells - 0.5) * spec.resolution_m - margin_m)
    return away_m


def _walked(scenario: Scenario, spec: GridSpec) -> BoolGrid:
    """(rows, cols) where somebody comes along."""
    canvas = np.zeros((spec.rows, spec.cols), dtype=np.uint8)
    lines = [person.points for person in scenario.people if len(person.points) > 1]
    lines += [tuple((x, y) for _, x, y in mover.keys) for mover in scenario.movers]
    for line in lines:
        cells = np.array([spec.cell(*point)[::-1] for point in line], dtype=np.int32)
        cv2.polylines(
            canvas,
            [cells],
            False,
            (1,),
            2 * round((WALK_M + BODY_DIAMETER_M / 2) / spec.resolution_m),
        )
    return canvas > 0


def _areas(free: BoolGrid) -> npt.NDArray[np.int32]:
    """(rows, cols) number of the connected area of each free cell, −1 for the others."""
    _, areas = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    return np.where(free, areas, -1).astype(np.int32)


def _in_the_way(scenario: Scenario, margins_m: Mapping[str, float]) -> list[Polygon]:
    """Everything that stands and lies, grown by the margin of its class."""
    standing = [
        rectangle(BODY_DIAMETER_M, BODY_DIAMETER_M) + p.points[0]
        for p in scenario.people
        if len(p.points) == 1
    ]
    rules = [
        (outline, margins_m.get(thing.name, 0.0))
        for thing in true_things(scenario)
        for outline in thing.outlines
    ]
    rules += [(body, margins_m.get(PERSON, 0.0)) for body in standing]
    grown = [shapely.buffer(shapely.Polygon(outline), margin_m) for outline, margin_m in rules]
    return [
        *(outline for thing in obstacles(scenario) for outline in thing.outlines()),
        *(shapely.get_coordinates(area.exterior)[:-1] for area in grown),
    ]


def _zone_on(way: Floats, rng: np.random.Generator) -> Polygon:
    """A rectangle whose middle is on the way, or a little beside it."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    station = rng.uniform(0.15, 0.85) * length_m(way)
    x, y = (float(np.interp(station, along, way[:, axis])) for axis in (0, 1))
    turn = rng.uniform(0, math.pi)
    cos, sin = math.cos(turn), math.sin(turn)
    corners = rectangle(rng.uniform(*ZONE_SIDE_M), rng.uniform(*ZONE_SIDE_M)) @ np.array(
        [[cos, sin], [-sin, cos]]
    )
    return np.asarray(corners + np.array([x, y]) + rng.uniform(-0.4, 0.4, 2))


def _apart_m(zone: Polygon, spot: Spot) -> float:
    return float(
        np.hypot(*(zone.mean(axis=0) - spot)) - np.hypot(*(zone - zone.mean(axis=0)).T).max()
    )
