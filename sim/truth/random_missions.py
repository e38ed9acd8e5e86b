"""Random start, goal and zones of a seed, such that the goal can be reached on the true map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import cv2
import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.geometry.polyline import length_m, metres_along
from navcore.geometry.transform import wrap_angle
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.robot.profile import RobotProfile
from sim.models.person import PERSON
from sim.models.solids import Polygon, rectangle
from sim.physics.pedestrians import BODY_DIAMETER_M
from sim.scenario.schema import Scenario, map_grid
from sim.truth.clearance import fixed_obstacles, grown_obstacles, is_clear_ahead
from sim.truth.shortest_path import Floats, Point, shortest_path
from sim.truth.true_map import rasterise
from sim.truth.true_objects import true_objects

SALT = 0x7A5C
"""Salt that separates these random numbers from all others of a seed."""
EXTRA_CLEARANCE_M = 0.1
"""Clearance beyond the margins of the robot, because its map is never exact."""
WALK_CLEARANCE_M = 0.6
"""Clearance of goals and starts from the lines of walkers, beyond their body."""
MIN_DISTANCE_SHARE = 0.25
"""Least distance of a goal as a share of the shorter side of the world."""
MIN_DISTANCE_M = 4.0
"""Least distance of a goal where the world is large enough."""
LEAST_SHARE = 0.2
"""Least share of the positions on which the robot can turn that have the clearance of a start."""
TURNED_RAD = 0.6
"""Largest angle between heading and path at a start where the robot has little room."""
TRIES = 200
"""Number of pairs of start and goal that are tried."""
GRID_M = 0.1
"""Cell side of the grid from which start and goal are drawn."""
ZONE_SIDE_M = (0.8, 2.0)
"""Range of the sides of a zone."""
ZONE_GAP_M = 1.2
"""Clearance of zones from start and goals."""


def draw_mission(
    scenario: Scenario,
    seed: int,
    *,
    robot: RobotProfile,
    margin_m: float,
    start_clear_m: float,
    start_ahead_m: float,
    margins_m: Mapping[str, float],
) -> Scenario:
    """Return the scenario of a seed with a start and one goal drawn at random.

    The robot has `start_clear_m` of clearance at its start and `start_ahead_m`, as wide as its
    body, ahead of it. Where the former is less it faces its path, for by turning it sees nothing
    of the floor beside it. Between start and goal the true map leaves a path that keeps half the
    width of the robot and `margin_m` from everything, the `margins_m` of its class from every
    beware object, and a little more. Raises `BadConfiguration` where there is no such pair, or
    where hardly a position has that clearance.
    """
    rng = np.random.default_rng((seed, SALT))
    spec = GridSpec.centred(size_m=scenario.size_m, resolution_m=GRID_M)
    clear_m = _clearance_m(scenario, spec, margins_m, robot)
    reach_m = robot.circumscribed_radius_m + EXTRA_CLEARANCE_M
    possible = (clear_m >= reach_m) & ~_walking_areas(scenario, spec)
    usual = possible & (clear_m >= start_clear_m)
    if usual.sum() < LEAST_SHARE * possible.sum():
        raise BadConfiguration(
            f"world {scenario.name!r}: only {usual.sum()} of {possible.sum()} positions have "
            f"{start_clear_m:.2f} m of clearance; the world is too small or too full for starts "
            "that differ"
        )
    starts, around = np.argwhere(usual), grown_obstacles(scenario, margins_m, robot)
    radius_m = robot.width_m / 2 + margin_m + EXTRA_CLEARANCE_M
    areas = _areas(clear_m >= radius_m)
    goals = (clear_m >= max(reach_m, radius_m)) & ~_walking_areas(scenario, spec)
    side_m = min(scenario.size_m)
    least_m = max(MIN_DISTANCE_SHARE * side_m, min(MIN_DISTANCE_M, 0.4 * side_m))
    for _ in range(TRIES if len(starts) else 0):
        start = starts[rng.integers(len(starts))]
        there = np.argwhere(goals & (areas == areas[tuple(start)]))
        if not len(there):
            continue
        goal = there[rng.integers(len(there))]
        (x, y), (gx, gy) = spec.centres(np.array([start, goal])).tolist()
        if math.hypot(gx - x, gy - y) < least_m:
            continue
        is_narrow = start_clear_m < start_ahead_m
        limit_rad = TURNED_RAD if is_narrow else math.pi
        yaw_rad = float(rng.uniform(-limit_rad, limit_rad))
        if is_narrow:
            path = shortest_path(around, radius_m, map_grid(scenario), [(x, y), (gx, gy)])
            if path is None:
                continue
            yaw_rad = wrap_angle(yaw_rad + _bearing_rad(path, start_ahead_m))
        pose = (round(x, 3), round(y, 3), round(yaw_rad, 4))
        placed = dataclasses.replace(scenario, start=pose, goals=((round(gx, 3), round(gy, 3)),))
        if not is_narrow or is_clear_ahead(
            around, placed.start_pose, ahead_m=start_ahead_m, width_m=robot.width_m
        ):
            return placed
    raise BadConfiguration(
        f"world {scenario.name!r}: no start with {max(start_clear_m, reach_m):.2f} m of clearance "
        f"and a reachable goal {least_m:.1f} m away in {TRIES} tries; "
        "the world is too small or too full for --random"
    )


def _bearing_rad(path: Floats, ahead_m: float) -> float:
    """Return the bearing of the point of a (K, 2) path some metres along it, from its start."""
    along = metres_along(path)
    x, y = (float(np.interp(ahead_m, along, path[:, axis])) for axis in (0, 1))
    return math.atan2(y - path[0, 1], x - path[0, 0])


def draw_zones(
    scenario: Scenario,
    seed: int,
    count: int,
    *,
    robot: RobotProfile,
    inflation_m: float,
    margins_m: Mapping[str, float],
) -> tuple[tuple[Point, ...], ...]:
    """Return up to `count` rectangles of the floor across the shortest path of the robot, each of
    which leaves another path.

    There are fewer where no try leaves another path. The centre of the robot keeps `inflation_m`
    from everything, and also the `margins_m` of its class from beware objects.
    """
    if not count:
        return ()
    polygons = grown_obstacles(scenario, margins_m, robot)
    rng = np.random.default_rng((seed, SALT, 1))
    spec = map_grid(scenario)
    waypoints = [(scenario.start[0], scenario.start[1]), *scenario.goals]
    zones: list[Polygon] = []
    path = shortest_path(polygons, inflation_m, spec, waypoints)
    for _ in range(8 * count):
        if path is None or len(zones) == count:
            break
        zone = _zone_across(path, rng)
        if any(_gap_m(zone, point) < ZONE_GAP_M for point in waypoints):
            continue
        around = shortest_path(
            [*polygons, *zones, zone], inflation_m + EXTRA_CLEARANCE_M, spec, waypoints
        )
        if around is not None:
            zones.append(zone)
            path = around
    return tuple(tuple((round(float(x), 3), round(float(y), 3)) for x, y in zone) for zone in zones)


def _clearance_m(
    scenario: Scenario, spec: GridSpec, margins_m: Mapping[str, float], robot: RobotProfile
) -> npt.NDArray[np.float32]:
    """Return the (rows, cols) distance in metres of each cell from all objects, less the margin of
    their class, and from ground that the robot cannot drive on; not positive off the floor."""
    standing = [np.array(person.points[0]) for person in scenario.people if len(person.points) == 1]
    groups: dict[float, list[Polygon]] = {0.0: fixed_obstacles(scenario, robot)}
    for entry in true_objects(scenario):
        groups.setdefault(margins_m.get(entry.name, 0.0), []).extend(entry.outlines)
    body = rectangle(BODY_DIAMETER_M, BODY_DIAMETER_M)
    groups.setdefault(margins_m.get(PERSON, 0.0), []).extend(body + point for point in standing)
    clear_m = np.full((spec.rows, spec.cols), np.inf, dtype=np.float32)
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
            # The least distance from the middle of the cell to the side of the other.
            clear_m = np.minimum(clear_m, (cells - 0.5) * spec.resolution_m - margin_m)
    return clear_m


def _walking_areas(scenario: Scenario, spec: GridSpec) -> BoolGrid:
    """Return (rows, cols), True where people or movers come along."""
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
            2 * round((WALK_CLEARANCE_M + BODY_DIAMETER_M / 2) / spec.resolution_m),
        )
    return canvas > 0


def _areas(free: BoolGrid) -> npt.NDArray[np.int32]:
    """Return the (rows, cols) number of the connected area of each free cell, −1 for the others."""
    _, areas = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    return np.where(free, areas, -1).astype(np.int32)


def _zone_across(path: Floats, rng: np.random.Generator) -> Polygon:
    """Return a rectangle whose middle is on the path or a little beside it."""
    along = metres_along(path)
    station = rng.uniform(0.15, 0.85) * length_m(path)
    x, y = (float(np.interp(station, along, path[:, axis])) for axis in (0, 1))
    turn = rng.uniform(0, math.pi)
    cos, sin = math.cos(turn), math.sin(turn)
    corners = rectangle(rng.uniform(*ZONE_SIDE_M), rng.uniform(*ZONE_SIDE_M)) @ np.array(
        [[cos, sin], [-sin, cos]]
    )
    return np.asarray(corners + np.array([x, y]) + rng.uniform(-0.4, 0.4, 2))


def _gap_m(zone: Polygon, point: Point) -> float:
    return float(
        np.hypot(*(zone.mean(axis=0) - point)) - np.hypot(*(zone - zone.mean(axis=0)).T).max()
    )
