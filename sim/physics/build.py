"""Builds a scenario in a physics client: floor, walls, furniture, markings, items and people."""

from __future__ import annotations

import numpy as np
import pybullet

from navcore.geometry.transform import Pose2
from navcore.robot.profile import HUSKY, RobotProfile
from sim.models.ground import Ground
from sim.models.items import ITEM_MASSES_KG
from sim.models.mesh import merged
from sim.models.person import person_solids
from sim.models.solids import Colour, box, cylinder, quaternion
from sim.models.surface_patterns import repeats_m, surface_texture
from sim.models.textures import SPILL_SIDE_M, print_texture, spill_texture
from sim.physics.bodies import (
    NO_SHAPE,
    load_texture,
    put_texture,
    show_mesh,
    show_patch,
    show_solids,
    show_square,
    solid_mesh,
)
from sim.physics.movers import Moving
from sim.physics.pedestrians import BODY_DIAMETER_M, Walker
from sim.physics.static_scene import build_static
from sim.physics.terrain_mesh import draped, terrain_mesh
from sim.scenario.layout import Thing, items, obstacles
from sim.scenario.schema import Item, Marking, Print, Scenario

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
    ground = Ground(scenario.relief)
    _build_floor(client, scenario, ground)
    for i, marking in enumerate(scenario.markings):
        _paint(client, marking, scenario.floor_colour, i, ground)
    for sheet in scenario.prints:
        _hang(client, sheet, ground)
    build_static(client, obstacles(scenario), ground)
    for thing, item in zip(items(scenario), scenario.items, strict=True):
        _build_item(client, thing, item, ground)


class Crowd:
    """All people of a world, all that moves by a timetable, and their bodies."""

    def __init__(
        self,
        client: int,
        scenario: Scenario,
        rng: np.random.Generator,
        period_s: float,
        robot: RobotProfile = HUSKY,
    ) -> None:
        self._client, self._ground = client, Ground(scenario.relief)
        self.walkers = [Walker(person, rng, period_s, robot) for person in scenario.people]
        self._bodies = [_build_person(client, walker, self._ground) for walker in self.walkers]
        self._movers = [Moving(mover, period_s) for mover in scenario.movers]
        self._mover_bodies = [_build_mover(client, mover, self._ground) for mover in self._movers]

    def step(self, robot: Pose2) -> None:
        """Move everybody by one physics step."""
        for walker, body in zip(self.walkers, self._bodies, strict=True):
            if walker.walks:
                walker.step(robot)
                _move(self._client, body, walker.pose, self._ground)
        for mover, body in zip(self._movers, self._mover_bodies, strict=True):
            mover.step()
            _move(self._client, body, mover.pose, self._ground)

    def poses(self) -> list[Pose2]:
        """T_map_body of everybody, then of all that moves by a timetable."""
        return [*(walker.pose for walker in self.walkers), *(mover.pose for mover in self._movers)]


def _build_floor(client: int, scenario: Scenario, ground: Ground) -> None:
    x_m, y_m = scenario.size_m[0] + 2.0, scenario.size_m[1] + 2.0
    side_m, colour = repeats_m(scenario.floor_pattern), scenario.floor_colour
    if ground.is_flat:
        shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        slab = box((x_m, y_m, 0.1), (0.0, 0.0), colour, bottom_m=-0.1)
        seen = (
            show_mesh(client, merged([slab]), colour, repeats_m=side_m)
            if side_m
            else show_solids(client, [slab])
        )
    else:
        mesh = terrain_mesh(ground, (x_m, y_m))
        shape, seen = solid_mesh(client, mesh), show_mesh(client, mesh, colour, repeats_m=side_m)
    # The plane needs something to be seen: without, the EGL renderer draws it by itself and falls
    # over.
    floor = pybullet.createMultiBody(0, shape, seen, physicsClientId=client)
    pybullet.changeDynamics(floor, -1, lateralFriction=1.0, physicsClientId=client)
    if side_m:
        put_texture(client, floor, load_texture(client, surface_texture(scenario.floor_pattern)))


def _paint(client: int, marking: Marking, floor: Colour, seed: int, ground: Ground) -> None:
    """Paint, or something spilt: half of the floor's colour shows through it, and it shines."""
    spilt = marking.surface != "paint"
    colour, side_m = (WHITE, SPILL_SIDE_M) if spilt else (marking.paint(), 1.0)
    if ground.is_flat:
        patch, up_m = show_patch(client, marking.polygon, colour, side_m=side_m), PAINT_M
    else:
        patch, up_m = (
            show_mesh(client, draped(ground, marking.polygon, PAINT_M), colour, repeats_m=side_m),
            0.0,
        )
    body = pybullet.createMultiBody(0, NO_SHAPE, patch, [0, 0, up_m], physicsClientId=client)
    if spilt:
        put_texture(
            client,
            body,
            load_texture(
                client, spill_texture(marking.seen_on(floor), GLOSS[marking.surface], seed)
            ),
        )


def _hang(client: int, sheet: Print, ground: Ground) -> None:
    """A picture without thickness, on the floor or on a wall, which it is seen before."""
    height_m = PRINT_M if sheet.on == "floor" else sheet.height_m
    body = pybullet.createMultiBody(
        0,
        NO_SHAPE,
        show_square(client, sheet.size_m),
        [*sheet.at, ground.height_m(*sheet.at) + height_m],
        sheet.turn(),
        physicsClientId=client,
    )
    put_texture(client, body, load_texture(client, print_texture(sheet.shows)))


def _build_item(client: int, thing: Thing, item: Item, ground: Ground) -> None:
    """A loose body: the robot can push it; but on hills nothing would stay, so there it is fixed.
    One box is for collisions."""
    size = item.extent_m()
    middle = size[2] / 2
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=[side / 2 for side in size], physicsClientId=client
    )
    visual = show_solids(client, thing.solids, lower_m=middle)
    mass_kg = ITEM_MASSES_KG[item.kind] if ground.is_flat else 0.0
    body = _place(client, mass_kg, collision, visual, thing.pose, ground, middle, tilted=True)
    pybullet.changeDynamics(
        body, -1, lateralFriction=0.6, rollingFriction=0.01, physicsClientId=client
    )


def _build_person(client: int, walker: Walker, ground: Ground) -> int:
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_CYLINDER,
        radius=BODY_DIAMETER_M / 2,
        height=PERSON_M,
        collisionFramePosition=[0, 0, PERSON_M / 2],
        physicsClientId=client,
    )
    visual = show_solids(client, person_solids(stride=0.1 if walker.walks else 0.0))
    return _place(client, 0.0, collision, visual, walker.pose, ground)


def _build_mover(client: int, mover: Moving, ground: Ground) -> int:
    size = mover.height_m
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_CYLINDER,
        radius=mover.diameter_m / 2,
        height=size,
        collisionFramePosition=[0, 0, size / 2],
        physicsClientId=client,
    )
    visual = show_solids(client, [cylinder(mover.diameter_m, size, (0.0, 0.0), mover.colour)])
    return _place(client, 0.0, collision, visual, mover.pose, ground)


def _place(
    client: int,
    mass_kg: float,
    collision: int,
    visual: int,
    pose: Pose2,
    ground: Ground,
    above_m: float = 0.0,
    *,
    tilted: bool = False,
) -> int:
    place, turn = _stand(pose, ground, above_m, tilted=tilted)
    return int(
        pybullet.createMultiBody(mass_kg, collision, visual, place, turn, physicsClientId=client)
    )


def _move(client: int, body: int, pose: Pose2, ground: Ground) -> None:
    pybullet.resetBasePositionAndOrientation(body, *_stand(pose, ground), physicsClientId=client)


def _stand(
    pose: Pose2, ground: Ground, above_m: float = 0.0, *, tilted: bool = False
) -> tuple[list[float], list[float]]:
    """Place and turn of what stands `above_m` above the ground: upright, or tilted as the ground
    is."""
    place = [pose.x_m, pose.y_m, ground.height_m(pose.x_m, pose.y_m) + above_m]
    if tilted and not ground.is_flat:
        return place, list(pybullet.getQuaternionFromEuler(ground.attitude(pose)))
    return place, quaternion(pose.yaw_rad)
