"""True clearance of a robot that is put down in a world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from navcore.geometry.transform import Pose2
from navcore.robot.profile import RobotProfile
from sim.models.person import PERSON
from sim.models.solids import Polygon, rectangle
from sim.physics.pedestrians import BODY_DIAMETER_M
from sim.scenario.layout import obstacles
from sim.scenario.schema import Scenario
from sim.truth.true_objects import true_objects
from sim.truth.untraversable import untraversable_ground


def fixed_obstacles(scenario: Scenario, robot: RobotProfile) -> list[Polygon]:
    """Return the outlines of walls and furniture, and of the ground that the robot cannot drive
    on."""
    return [
        *(outline for entry in obstacles(scenario) for outline in entry.outlines()),
        *(outline for area in untraversable_ground(scenario, robot) for outline in area.outlines),
    ]


def grown_obstacles(
    scenario: Scenario, margins_m: Mapping[str, float], robot: RobotProfile
) -> list[Polygon]:
    """Return the outlines of all objects, grown by the margin of their class, and of the ground
    that the robot cannot drive on."""
    standing = [
        rectangle(BODY_DIAMETER_M, BODY_DIAMETER_M) + p.points[0]
        for p in scenario.people
        if len(p.points) == 1
    ]
    rules = [
        (outline, margins_m.get(entry.name, 0.0))
        for entry in true_objects(scenario)
        for outline in entry.outlines
    ]
    rules += [(body, margins_m.get(PERSON, 0.0)) for body in standing]
    grown = [shapely.buffer(shapely.Polygon(outline), margin_m) for outline, margin_m in rules]
    return [
        *fixed_obstacles(scenario, robot),
        *(shapely.get_coordinates(area.exterior)[:-1] for area in grown),
    ]


def clearance_m(polygons: Sequence[Polygon], x_m: float, y_m: float) -> float:
    """Return the distance in metres of a point from the nearest polygon, infinite without any."""
    distances = shapely.distance([shapely.Polygon(p) for p in polygons], shapely.Point(x_m, y_m))
    return float(distances.min(initial=float("inf")))


def is_clear_ahead(
    polygons: Sequence[Polygon], pose: Pose2, *, ahead_m: float, width_m: float
) -> bool:
    """Return whether no polygon is in the rectangle of `width_m` that begins at the pose and ends
    `ahead_m` ahead of it."""
    corners = rectangle(ahead_m, width_m) + np.array([ahead_m / 2, 0.0])
    ahead = shapely.Polygon(pose.to_parent(corners))
    return not shapely.intersects([shapely.Polygon(p) for p in polygons], ahead).any()
