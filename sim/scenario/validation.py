"""Validation of scenarios beyond types and ranges. Each refusal names the key."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from shapely import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.validation import explain_validity

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.robot.profile import HUSKY, RobotProfile
from sim.models.items import item_shapes
from sim.scenario.beware import check_beware_off
from sim.scenario.layout import PlacedObject, items, obstacles
from sim.scenario.schema import Scenario
from sim.scenario.tags import check_tags
from sim.sensors.faults import check_faults
from sim.sensors.gnss_settings import check_gnss

Point2 = tuple[float, float]


def check_scenario(scenario: Scenario, where: str, robot: RobotProfile = HUSKY) -> None:
    """Raise `BadConfiguration` when the world is impossible or the robot cannot stand at its start
    or goals."""
    _check_lists(scenario, where)
    _check_inside(scenario, where)
    _check_markings(scenario, where)
    _check_clearance(scenario, where, robot)
    check_tags(scenario.tags, where)
    check_faults(scenario.faults, where)
    check_beware_off(scenario, where)
    if scenario.gnss is not None:
        check_gnss(scenario.gnss, where)


def _check_lists(scenario: Scenario, where: str) -> None:
    if not scenario.name:
        raise BadConfiguration(f"{where}.name: is empty, expected a name for reports")
    for i, wall in enumerate(scenario.walls):
        if len(wall.points) < 2:
            raise BadConfiguration(
                f"{where}.walls[{i}].points: {len(wall.points)} points, expected 2 or more"
            )
        _check_no_repeats(wall.points, f"{where}.walls[{i}]")
        length_m = sum(math.dist(a, b) for a, b in pairwise(wall.points))
        for j, along_m in enumerate(wall.doors_m):
            if not wall.door_m / 2 < along_m < length_m - wall.door_m / 2:
                raise BadConfiguration(
                    f"{where}.walls[{i}].doors_m[{j}]: a door of {wall.door_m:g} m at "
                    f"{along_m:g} m does not fit into a wall of {length_m:g} m"
                )
    if scenario.relief is not None and scenario.raised:
        raise BadConfiguration(
            f"{where}.raised: raised parts stand on a floor without relief; leave one of them out"
        )
    for i, item in enumerate(scenario.items):
        if item.shape and item.shape not in (known := item_shapes(item.kind)):
            raise BadConfiguration(
                f"{where}.items[{i}].shape: {item.shape!r}, expected one of: {', '.join(known)}"
            )
    for i, person in enumerate(scenario.people):
        if not person.points:
            raise BadConfiguration(
                f"{where}.people[{i}].points: is empty, "
                "expected one point to stand on, or more to walk"
            )
        _check_no_repeats(person.points, f"{where}.people[{i}]")
        if person.pauses_s and len(person.pauses_s) != len(person.points):
            raise BadConfiguration(
                f"{where}.people[{i}].pauses_s: has {len(person.pauses_s)} values, "
                f"expected {len(person.points)}, one for each point"
            )
        if len(person.points) > 1 and person.speed_mps == 0:
            raise BadConfiguration(
                f"{where}.people[{i}].speed_mps: is 0 for a walker, "
                "expected more, or a single point"
            )

    for key, corners in _areas(scenario):
        (x0, y0), (x1, y1) = corners
        if not (x0 < x1 and y0 < y1):
            raise BadConfiguration(
                f"{where}.{key}.corners: expected the lowest x, y and then the highest, "
                f"got {corners}"
            )
    for i, group in enumerate(scenario.scatter):
        if any(low > high for low, high in zip(group.least_m, group.most_m, strict=True)):
            raise BadConfiguration(
                f"{where}.scatter[{i}].most_m: {group.most_m} is less than least_m, {group.least_m}"
            )
    for i, mover in enumerate(scenario.movers):
        times = [t_s for t_s, _, _ in mover.keys]
        if not times or times != sorted(times) or times[0] < 0:
            raise BadConfiguration(
                f"{where}.movers[{i}].keys: expected one or more, from 0 s on, in order of time"
            )


def _check_no_repeats(points: Sequence[Point2], key: str) -> None:
    for j, (a, b) in enumerate(pairwise(points), start=1):
        if a == b:
            raise BadConfiguration(f"{key}.points[{j}]: repeats the previous point {a}; remove it")


def _areas(scenario: Scenario) -> Iterator[tuple[str, tuple[Point2, Point2]]]:
    yield from ((f"rooms[{i}]", room.corners) for i, room in enumerate(scenario.rooms))
    yield from (
        (f"scatter[{i}]", group.corners)
        for i, group in enumerate(scenario.scatter)
        if group.corners
    )


def _check_inside(scenario: Scenario, where: str) -> None:
    half_x, half_y = scenario.size_m[0] / 2, scenario.size_m[1] / 2
    for key, (x, y) in _spots(scenario):
        if abs(x) > half_x or abs(y) > half_y:
            raise BadConfiguration(
                f"{where}.{key}: ({x:g}, {y:g}) lies outside the world, "
                f"x ±{half_x:g} m, y ±{half_y:g} m; see size_m"
            )


def _spots(scenario: Scenario) -> Iterator[tuple[str, Point2]]:
    yield "start", scenario.start[:2]
    for i, goal in enumerate(scenario.goals):
        yield f"goals[{i}]", goal
    for i, wall in enumerate(scenario.walls):
        yield from ((f"walls[{i}].points[{j}]", point) for j, point in enumerate(wall.points))
    for i, part in enumerate(scenario.raised):
        yield f"raised[{i}].at", part.at
    for i, piece in enumerate(scenario.furniture):
        yield f"furniture[{i}].at", piece.at
    for i, marking in enumerate(scenario.markings):
        yield from (
            (f"markings[{i}].polygon[{j}]", point) for j, point in enumerate(marking.polygon)
        )
    for i, item in enumerate(scenario.items):
        yield f"items[{i}].at", item.at
    for i, sheet in enumerate(scenario.prints):
        yield f"prints[{i}].at", sheet.at
    for i, tag in enumerate(scenario.tags):
        yield f"tags[{i}].at", tag.at
    for i, room in enumerate(scenario.rooms):
        yield from ((f"rooms[{i}].corners[{j}]", corner) for j, corner in enumerate(room.corners))
    for i, group in enumerate(scenario.scatter):
        yield from (
            (f"scatter[{i}].corners[{j}]", corner) for j, corner in enumerate(group.corners or ())
        )
    for i, person in enumerate(scenario.people):
        yield from ((f"people[{i}].points[{j}]", point) for j, point in enumerate(person.points))


def _check_markings(scenario: Scenario, where: str) -> None:
    for i, marking in enumerate(scenario.markings):
        key = f"{where}.markings[{i}].polygon"
        if len(marking.polygon) < 3:
            raise BadConfiguration(f"{key}: {len(marking.polygon)} corners, expected 3 or more")
        polygon = Polygon(marking.polygon)
        if not polygon.is_valid:
            raise BadConfiguration(
                f"{key}: {explain_validity(polygon)}; "
                "expected corners in order, without crossing edges"
            )
        if polygon.area < 1e-4:
            raise BadConfiguration(f"{key}: has no area, expected more than 1 cm²")
        if marking.pattern is not None and marking.surface != "paint":
            raise BadConfiguration(
                f"{where}.markings[{i}].pattern: {marking.pattern!r} on {marking.surface}; "
                "only paint has a pattern"
            )


def _check_clearance(scenario: Scenario, where: str, robot: RobotProfile) -> None:
    """Check that the footprint fits at the start, and the robot's width in every direction at each
    goal."""
    footprint = Polygon(scenario.start_pose.to_parent(robot.footprint()))
    areas: list[tuple[str, BaseGeometry]] = [("start", footprint)]
    areas += [
        (f"goals[{i}]", Point(goal).buffer(robot.width_m / 2))
        for i, goal in enumerate(scenario.goals)
    ]
    taken = _taken(scenario)
    for key, area in areas:
        _check_free(area, taken, f"{where}.{key}")


def check_standing(scenario: Scenario, pose: Pose2, robot: RobotProfile, where: str) -> None:
    """Raise `BadConfiguration` unless the robot can stand at a T_map_base: finite, on the floor,
    and clear of walls, furniture, items and beware markings."""
    if not np.isfinite((pose.x_m, pose.y_m, pose.yaw_rad)).all():
        raise BadConfiguration(f"{where}: {pose} is not finite")
    footprint = pose.to_parent(robot.footprint())
    half_x, half_y = scenario.size_m[0] / 2, scenario.size_m[1] / 2
    if (np.abs(footprint) > (half_x, half_y)).any():
        raise BadConfiguration(
            f"{where}: at ({pose.x_m:g}, {pose.y_m:g}) the robot would stand outside the world, "
            f"x ±{half_x:g} m, y ±{half_y:g} m"
        )
    _check_free(Polygon(footprint), _taken(scenario), where)


def started_at(scenario: Scenario, pose: Pose2, robot: RobotProfile) -> Scenario:
    """Return the world with another start; raises `BadConfiguration` as `check_standing` does."""
    check_standing(scenario, pose, robot, "start")
    return replace(scenario, start=(pose.x_m, pose.y_m, pose.yaw_rad))


def _taken(scenario: Scenario) -> list[tuple[str, BaseGeometry]]:
    """Return the areas that the robot must not stand in, with their keys."""
    return [(entry.key, _shape(entry)) for entry in (*obstacles(scenario), *items(scenario))] + [
        (f"markings[{i}]", Polygon(m.polygon)) for i, m in enumerate(scenario.markings) if m.beware
    ]


def _check_free(area: BaseGeometry, taken: list[tuple[str, BaseGeometry]], key: str) -> None:
    for other, shape in taken:
        if area.intersects(shape):
            raise BadConfiguration(f"{key}: the robot would stand in {other}; move one of them")


def _shape(entry: PlacedObject) -> BaseGeometry:
    return MultiPolygon([Polygon(np.asarray(outline)) for outline in entry.outlines()]).buffer(0)
