"""Builds a scenario in a physics client: floor, walls, furniture, markings, items and people."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pybullet

from navcore.robot import HUSKY, RobotProfile
from navcore.transform import Pose2
from sim.bodies import NO_SHAPE, PARTS, load_texture, put_texture, show_patch, show_solids, show_square
from sim.figure import person_solids
from sim.items import ITEM_MASSES_KG
from sim.layout import Thing, items, obstacles
from sim.movers import Moving
from sim.people import BODY_DIAMETER_M, Walker
from sim.scenario import Item, Marking, Print, Scenario
from sim.shapes import Colour, Solid, box, cylinder, quaternion
from sim.textures import SPILL_SIDE_M, print_texture, spill_texture

PAINT_M = 0.003
"""Paint lies this high above the floor, or the renderer could not tell which of the two it sees."""
PRINT_M = 0.0015
"""And a print lower than paint."""
PERSON_M = 1.75
WHITE: Colour = (255, 255, 255)
GLOSS = {"water": 0.5, "mud": 0.12, "chemical": 0.4}
"""How much light each of them throws back, 0 to 1."""


def build_world(client: int, scenario: Scenario) -> None:
    """Everything of the scenario that is not the robot and not a person."""
    _build_floor(client, scenario)
    for i, marking in enumerate(scenario.markings):
        _paint(client, marking, scenario.floor_colour, i)
    for sheet in scenario.prints:
        _hang(client, sheet)
    for thing in obstacles(scenario):
        for first in range(0, len(thing.solids), PARTS):
            _build_fixed(client, thing.solids[first : first + PARTS], thing.pose)
    for thing, item in zip(items(scenario), scenario.items, strict=True):
        _build_item(client, thing, item)


class Crowd:
    """All people of a world, all that moves by a timetable, and their bodies."""

    def __init__(
        self, client: int, scenario: Scenario, rng: np.random.Generator, period_s: float, robot: RobotProfile = HUSKY
    ) -> None:
        self._client = client
        self.walkers = [Walker(person, rng, period_s, robot) for person in scenario.people]
        self._bodies = [_build_person(client, walker) for walker in self.walkers]
        self._movers = [Moving(mover, period_s) for mover in scenario.movers]
        self._mover_bodies = [_build_mover(client, mover) for mover in self._movers]

    def step(self, robot: Pose2) -> None:
        """Move everybody by one physics step."""
        for walker, body in zip(self.walkers, self._bodies, strict=True):
            if walker.walks:
                walker.step(robot)
                _move(self._client, body, walker.pose)
        for mover, body in zip(self._movers, self._mover_bodies, strict=True):
            mover.step()
            _move(self._client, body, mover.pose)

    def poses(self) -> list[Pose2]:
        """T_map_body of everybody, then of all that moves by a timetable."""
        return [*(walker.pose for walker in self.walkers), *(mover.pose for mover in self._movers)]


def _build_floor(client: int, scenario: Scenario) -> None:
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    x_m, y_m = scenario.size_m
    tiles = show_solids(client, [box((x_m + 2.0, y_m + 2.0, 0.1), (0.0, 0.0), scenario.floor_colour, bottom_m=-0.1)])
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
        collisionFrameOrientations=[quaternion(solid.yaw_rad, solid.pitch_rad) for solid in solids],
        physicsClientId=client,
    )
    visual = show_solids(client, solids)
    return _place(client, 0.0, collision, visual, pose, 0.0)


def _paint(client: int, marking: Marking, floor: Colour, seed: int) -> None:
    """Paint, or something spilt: half of the floor's colour shows through it, and it shines."""
    if marking.surface == "paint":
        patch = show_patch(client, marking.polygon, marking.paint())
        pybullet.createMultiBody(0, NO_SHAPE, patch, [0, 0, PAINT_M], physicsClientId=client)
        return
    patch = show_patch(client, marking.polygon, WHITE, side_m=SPILL_SIDE_M)
    body = pybullet.createMultiBody(0, NO_SHAPE, patch, [0, 0, PAINT_M], physicsClientId=client)
    put_texture(client, body, load_texture(client, spill_texture(marking.seen_on(floor), GLOSS[marking.surface], seed)))


def _hang(client: int, sheet: Print) -> None:
    """A picture without thickness, on the floor or on a wall, which it is seen before."""
    body = pybullet.createMultiBody(
        0,
        NO_SHAPE,
        show_square(client, sheet.size_m),
        [*sheet.at, PRINT_M if sheet.on == "floor" else sheet.height_m],
        sheet.turn(),
        physicsClientId=client,
    )
    put_texture(client, body, load_texture(client, print_texture(sheet.shows)))


def _build_item(client: int, thing: Thing, item: Item) -> None:
    """A loose body: the robot can push it. One box is enough for its collisions."""
    size = item.extent_m()
    middle = size[2] / 2
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=[side / 2 for side in size], physicsClientId=client
    )
    visual = show_solids(client, thing.solids, lower_m=middle)
    body = _place(client, ITEM_MASSES_KG[item.kind], collision, visual, thing.pose, middle)
    pybullet.changeDynamics(body, -1, lateralFriction=0.6, rollingFriction=0.01, physicsClientId=client)


def _build_person(client: int, walker: Walker) -> int:
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_CYLINDER,
        radius=BODY_DIAMETER_M / 2,
        height=PERSON_M,
        collisionFramePosition=[0, 0, PERSON_M / 2],
        physicsClientId=client,
    )
    visual = show_solids(client, person_solids(stride=0.1 if walker.walks else 0.0))
    return _place(client, 0.0, collision, visual, walker.pose, 0.0)


def _build_mover(client: int, mover: Moving) -> int:
    return _build_fixed(client, [cylinder(mover.diameter_m, mover.height_m, (0.0, 0.0), mover.colour)], mover.pose)


def _place(client: int, mass_kg: float, collision: int, visual: int, pose: Pose2, z_m: float) -> int:
    place, turn = [pose.x_m, pose.y_m, z_m], quaternion(pose.yaw_rad)
    return int(pybullet.createMultiBody(mass_kg, collision, visual, place, turn, physicsClientId=client))


def _move(client: int, body: int, pose: Pose2) -> None:
    place = [pose.x_m, pose.y_m, 0.0]
    pybullet.resetBasePositionAndOrientation(body, place, quaternion(pose.yaw_rad), physicsClientId=client)


def _shape_type(solid: Solid) -> int:
    return int(pybullet.GEOM_BOX if solid.kind == "box" else pybullet.GEOM_CYLINDER)
