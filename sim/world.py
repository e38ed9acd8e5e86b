"""Builds a scenario in a physics client: floor, walls, furniture, markings, items and people."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pybullet
import shapely

from navcore.transform import Pose2
from sim.furniture import ITEM_SIZES, person_solids
from sim.layout import Thing, items, obstacles
from sim.people import BODY_DIAMETER_M, Walker
from sim.scenario import Marking, Scenario
from sim.shapes import Colour, Solid, box

PAINT_M = 0.003
"""Paint lies this high above the floor, or the renderer could not tell which of the two it sees."""
PARTS = 16
"""The engine takes at most so many solids for one body."""
PERSON_M = 1.75
ITEM_MASS_KG = {"cup": 0.3, "book": 0.6, "bag": 3.0, "shoe": 0.4}
NO_SHAPE = -1
MESHES = {kind: Path(__file__).parent / "meshes" / f"{mesh}.obj" for kind, mesh in (("box", "cube"), ("cylinder", "cylinder"))}
"""Of side 1, about the origin."""


def build_world(client: int, scenario: Scenario) -> None:
    """Everything of the scenario that is not the robot and not a person."""
    _build_floor(client, scenario)
    for thing in obstacles(scenario):
        for first in range(0, len(thing.solids), PARTS):
            _build_fixed(client, thing.solids[first : first + PARTS], thing.pose)
    for marking in scenario.markings:
        _paint(client, marking)
    for item in items(scenario):
        _build_item(client, item)


class Crowd:
    """All people of a world, and their bodies."""

    def __init__(self, client: int, scenario: Scenario, rng: np.random.Generator, period_s: float) -> None:
        self._client = client
        self.walkers = [Walker(person, rng, period_s) for person in scenario.people]
        self._bodies = [_build_person(client, walker) for walker in self.walkers]

    def step(self, robot: Pose2) -> None:
        """Move everybody by one physics step."""
        for walker, body in zip(self.walkers, self._bodies, strict=True):
            if walker.walks:
                walker.step(robot)
                _move(self._client, body, walker.pose)


def _build_floor(client: int, scenario: Scenario) -> None:
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    x_m, y_m = scenario.size_m
    tiles = _build_visual(client, [box((x_m + 2.0, y_m + 2.0, 0.1), (0.0, 0.0), scenario.floor_colour, bottom_m=-0.1)])
    # The plane needs something to be seen: without, the EGL renderer draws it by itself and falls over.
    floor = pybullet.createMultiBody(0, plane, tiles, physicsClientId=client)
    pybullet.changeDynamics(floor, -1, lateralFriction=1.0, physicsClientId=client)


def _build_fixed(client: int, solids: Sequence[Solid], pose: Pose2) -> int:
    """One body without mass."""
    collision = pybullet.createCollisionShapeArray(
        shapeTypes=[_shape_type(solid) for solid in solids],
        radii=[solid.size_m[0] / 2 for solid in solids],
        halfExtents=[[side / 2 for side in solid.size_m] for solid in solids],
        lengths=[solid.size_m[2] for solid in solids],
        collisionFramePositions=[solid.centre_m for solid in solids],
        collisionFrameOrientations=[_quaternion(solid.yaw_rad) for solid in solids],
        physicsClientId=client,
    )
    visual = _build_visual(client, solids)
    return _place(client, 0.0, collision, visual, pose, 0.0)


def _build_visual(client: int, solids: Sequence[Solid], *, lower_m: float = 0.0) -> int:
    """Solids to look at, `lower_m` below where they are in the frame of their thing.

    As meshes with normals of their own: those that the EGL renderer makes up for boxes are wrong, and so is their light.
    """
    return int(
        pybullet.createVisualShapeArray(
            shapeTypes=[pybullet.GEOM_MESH for _ in solids],
            fileNames=[str(MESHES[solid.kind]) for solid in solids],
            meshScales=[list(solid.size_m) for solid in solids],
            rgbaColors=[_rgba(solid.colour) for solid in solids],
            visualFramePositions=[(x, y, z - lower_m) for x, y, z in (solid.centre_m for solid in solids)],
            visualFrameOrientations=[_quaternion(solid.yaw_rad) for solid in solids],
            physicsClientId=client,
        )
    )


def _paint(client: int, marking: Marking) -> None:
    with tempfile.TemporaryDirectory() as folder:
        # As a file, because the EGL renderer takes no mesh from memory; its name is new each time, because meshes are cached.
        mesh = Path(folder) / "marking.obj"
        mesh.write_text(_patch(marking), encoding="ascii")
        patch = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            fileName=str(mesh),
            rgbaColor=_rgba(marking.colour),
            specularColor=[0, 0, 0],
            physicsClientId=client,
        )
    pybullet.createMultiBody(0, NO_SHAPE, patch, [0, 0, PAINT_M], physicsClientId=client)


def _patch(marking: Marking) -> str:
    """Its polygon as a flat mesh in Wavefront's OBJ format, seen from above."""
    triangles = shapely.constrained_delaunay_triangles(shapely.Polygon(marking.polygon)).geoms
    corners = [xy for triangle in triangles for xy in shapely.get_coordinates(shapely.orient_polygons(triangle))[:3]]
    vertices = [f"v {x:.6f} {y:.6f} 0" for x, y in corners]
    faces = [f"f {i}//1 {i + 1}//1 {i + 2}//1" for i in range(1, len(corners), 3)]
    return "\n".join([*vertices, "vn 0 0 1", *faces, ""])


def _build_item(client: int, item: Thing) -> None:
    """A loose body: the robot can push it. One box is enough for its collisions."""
    size = ITEM_SIZES[item.name]
    middle = size[2] / 2
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=[side / 2 for side in size], physicsClientId=client
    )
    visual = _build_visual(client, item.solids, lower_m=middle)
    body = _place(client, ITEM_MASS_KG[item.name], collision, visual, item.pose, middle)
    pybullet.changeDynamics(body, -1, lateralFriction=0.6, rollingFriction=0.01, physicsClientId=client)


def _build_person(client: int, walker: Walker) -> int:
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_CYLINDER,
        radius=BODY_DIAMETER_M / 2,
        height=PERSON_M,
        collisionFramePosition=[0, 0, PERSON_M / 2],
        physicsClientId=client,
    )
    visual = _build_visual(client, person_solids(stride=0.1 if walker.walks else 0.0))
    return _place(client, 0.0, collision, visual, walker.pose, 0.0)


def _place(client: int, mass_kg: float, collision: int, visual: int, pose: Pose2, z_m: float) -> int:
    place, turn = [pose.x_m, pose.y_m, z_m], _quaternion(pose.yaw_rad)
    return int(pybullet.createMultiBody(mass_kg, collision, visual, place, turn, physicsClientId=client))


def _move(client: int, body: int, pose: Pose2) -> None:
    place = [pose.x_m, pose.y_m, 0.0]
    pybullet.resetBasePositionAndOrientation(body, place, _quaternion(pose.yaw_rad), physicsClientId=client)


def _shape_type(solid: Solid) -> int:
    return int(pybullet.GEOM_BOX if solid.kind == "box" else pybullet.GEOM_CYLINDER)


def _quaternion(yaw_rad: float) -> list[float]:
    return [0.0, 0.0, float(np.sin(yaw_rad / 2)), float(np.cos(yaw_rad / 2))]


def _rgba(colour: Colour) -> list[float]:
    return [level / 255 for level in colour] + [1.0]
