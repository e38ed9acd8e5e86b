"""Builds a scenario: its bodies in a physics client, and what a camera sees of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from navcore.geometry.transform import Pose2
from navcore.robot.profile import HUSKY, RobotProfile
from sim.bullet import pybullet
from sim.models.floor_paint import painted_parts
from sim.models.ground import Ground
from sim.models.items import ITEM_MASSES_KG
from sim.models.mesh import merge_solids
from sim.models.person import DEFAULT_APPEARANCE, PERSON, person_solids
from sim.models.solids import Colour, box, cylinder, quaternion
from sim.models.surface_patterns import pattern_period_m, surface_texture
from sim.models.textures import (
    GLOSS,
    PLATE_SHARE,
    SPILL_SIDE_M,
    print_texture,
    spill_texture,
    tag_texture,
    worn_texture,
)
from sim.physics.bodies import NO_SHAPE, body_pose, mesh_collision, pose_matrix
from sim.physics.movers import TimedMover
from sim.physics.pedestrians import BODY_DIAMETER_M, Walker
from sim.physics.static_scene import build_static
from sim.physics.terrain_mesh import drape, terrain_mesh
from sim.rendering.visible_world import VisibleWorld
from sim.rendering.visual import WHITE, flat_polygon, patterned, rectangle, solid_visuals
from sim.scenario.layout import PlacedObject, items, obstacles
from sim.scenario.schema import Item, Marking, Print, Scenario
from sim.scenario.tags import Tag

PAINT_M = 0.003
"""Height of paint above the floor, because the renderer could not order surfaces at the same depth.
"""
PRINT_M = 0.0015
"""Height of a print on the floor, lower than paint."""
BodyPose = tuple[list[float], list[float]]
"""Position x, y, z and quaternion x, y, z, w in the map frame."""


@dataclass(slots=True)
class World:
    """A scenario in a physics client, and what a camera sees of it."""

    client: int
    """Number of the physics client."""
    seen: VisibleWorld = field(default_factory=VisibleWorld)
    """What a camera sees."""
    class_of: dict[int, str] = field(default_factory=dict)
    """Visible object → class, of beware objects and people."""
    item_bodies: list[int] = field(default_factory=list)
    """Physics bodies of the items of the scenario, in its order."""
    _moving: dict[int, int] = field(default_factory=dict)
    """Visible object → physics body, of what can move."""

    def follow(self, number: int, body: int) -> None:
        """Let a visible object move with a physics body."""
        self._moving[number] = body

    def update_visible(self) -> None:
        """Put every visible object where its body is now."""
        for number, body in self._moving.items():
            self.seen.place(number, body_pose(self.client, body))


def build_world(client: int, scenario: Scenario) -> World:
    """Build ground, markings, prints, static objects and items; people come with `Crowd`."""
    ground, world = Ground(scenario.relief, scenario.raised), World(client)
    _build_floor(world, scenario, ground)
    for i, marking in enumerate(scenario.markings):
        _build_marking(world, marking, scenario, i, ground)
    for sheet in scenario.prints:
        _build_print(world, sheet, ground)
    for tag in scenario.tags:
        _build_tag(world, tag, ground)
    world.seen.add(build_static(client, obstacles(scenario), ground))
    for entry, item in zip(items(scenario), scenario.items, strict=True):
        _build_item(world, entry, item, ground)
    return world


class Crowd:
    """The people and movers of a world, and their bodies."""

    def __init__(
        self,
        world: World,
        scenario: Scenario,
        rng: np.random.Generator,
        period_s: float,
        robot: RobotProfile = HUSKY,
    ) -> None:
        self._client, self._ground = world.client, Ground(scenario.relief, scenario.raised)
        self.walkers = [Walker(person, rng, period_s, robot) for person in scenario.people]
        self._bodies = [_build_person(world, walker, self._ground) for walker in self.walkers]
        self._movers = [TimedMover(mover, period_s) for mover in scenario.movers]
        self._mover_bodies = [_build_mover(world, mover, self._ground) for mover in self._movers]

    def step(self, robot: Pose2) -> None:
        """Move every person and mover by one physics step."""
        for walker, body in zip(self.walkers, self._bodies, strict=True):
            if walker.walks:
                walker.step(robot)
                _move(self._client, body, walker.pose, self._ground)
        for mover, body in zip(self._movers, self._mover_bodies, strict=True):
            mover.step()
            _move(self._client, body, mover.pose, self._ground)

    def poses(self) -> list[Pose2]:
        """Return T_map_body of every person and then of every mover."""
        return [*(walker.pose for walker in self.walkers), *(mover.pose for mover in self._movers)]


def _build_floor(world: World, scenario: Scenario, ground: Ground) -> None:
    x_m, y_m = scenario.size_m[0] + 2.0, scenario.size_m[1] + 2.0
    side_m, colour = pattern_period_m(scenario.floor_pattern), scenario.floor_colour
    if not ground.rolls:
        shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=world.client)
        mesh = merge_solids([box((x_m, y_m, 0.1), (0.0, 0.0), colour, bottom_m=-0.1)])
    else:
        mesh = terrain_mesh(ground, (x_m, y_m))
        shape = mesh_collision(world.client, mesh)
    floor = pybullet.createMultiBody(0, shape, NO_SHAPE, physicsClientId=world.client)
    pybullet.changeDynamics(floor, -1, lateralFriction=1.0, physicsClientId=world.client)
    texture = surface_texture(scenario.floor_pattern) if side_m else None
    world.seen.add([patterned(mesh, colour, texture, side_m)])
    for part in ground.raised:
        mesh = part.mesh()
        shape = mesh_collision(world.client, mesh)
        pybullet.createMultiBody(0, shape, NO_SHAPE, physicsClientId=world.client)
        world.seen.add([patterned(mesh, part.colour, None, 1.0)])


def _build_marking(
    world: World, marking: Marking, scenario: Scenario, seed: int, ground: Ground
) -> None:
    """Build paint, plain or worn in a pattern, or a spill, which shines and shows part of the floor
    colour."""
    colour, texture, side_m = marking.paint(), None, 1.0
    parts: list[tuple[Colour, BaseGeometry]] = []
    if marking.pattern is not None:
        parts = painted_parts(marking.polygon, marking.pattern, colour)
        texture, side_m = worn_texture(seed), SPILL_SIDE_M
    elif marking.surface != "paint":
        seen = marking.seen_on(scenario.floor_colour)
        texture = spill_texture(seen, GLOSS[marking.surface], seed)
        colour, side_m = WHITE, SPILL_SIDE_M
    parts = parts or [(colour, shapely.Polygon(marking.polygon))]
    if not ground.rolls:
        patches = [flat_polygon(area, colour, texture, side_m=side_m) for colour, area in parts]
        pose = pose_matrix([0.0, 0.0, PAINT_M], quaternion(0.0))
    else:
        patches = [
            patterned(drape(ground, area, PAINT_M), colour, texture, side_m)
            for colour, area in parts
        ]
        pose = np.eye(4)
    number = world.seen.add(patches, pose)
    if marking.beware:
        world.class_of[number] = marking.beware_class


def _build_print(world: World, sheet: Print, ground: Ground) -> None:
    """Build a print without thickness on the floor or just in front of a wall."""
    height_m = PRINT_M if sheet.on == "floor" else sheet.height_m
    world.seen.add(
        [rectangle(sheet.size_m, print_texture(sheet.shows))],
        pose_matrix([*sheet.at, ground.height_m(*sheet.at) + height_m], sheet.turn()),
    )


def _build_tag(world: World, tag: Tag, ground: Ground) -> None:
    """Build a plate without thickness, seen from the front."""
    side_m = tag.size_m * PLATE_SHARE
    world.seen.add(
        [rectangle((side_m, side_m), tag_texture(tag.id))],
        pose_matrix([*tag.at, ground.height_m(*tag.at) + tag.height_m], tag.turn()),
    )


def _build_item(world: World, entry: PlacedObject, item: Item, ground: Ground) -> None:
    """Build an item as a loose body that the robot can push; on hills nothing would stay, so there
    it is fixed. Its collision shape is one box."""
    size = item.extent_m()
    middle = size[2] / 2
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=[side / 2 for side in size], physicsClientId=world.client
    )
    mass_kg = ITEM_MASSES_KG[item.kind] if ground.is_flat else 0.0
    pose = _pose_on(ground, entry.pose, middle, tilted=True)
    body = _create(world.client, collision, pose, mass_kg=mass_kg)
    pybullet.changeDynamics(
        body, -1, lateralFriction=0.6, rollingFriction=0.01, physicsClientId=world.client
    )
    number = world.seen.add(solid_visuals(entry.solids, lower_m=middle))
    world.follow(number, body)
    world.class_of[number] = item.kind
    world.item_bodies.append(body)


def _build_person(world: World, walker: Walker, ground: Ground) -> int:
    body = _upright_cylinder(
        world, BODY_DIAMETER_M, DEFAULT_APPEARANCE.height_m, _pose_on(ground, walker.pose)
    )
    number = world.seen.add(solid_visuals(person_solids(stride=0.1 if walker.walks else 0.0)))
    world.follow(number, body)
    world.class_of[number] = PERSON
    return body


def _build_mover(world: World, mover: TimedMover, ground: Ground) -> int:
    size = mover.height_m
    body = _upright_cylinder(world, mover.diameter_m, size, _pose_on(ground, mover.pose))
    seen = solid_visuals([cylinder(mover.diameter_m, size, (0.0, 0.0), mover.colour)])
    world.follow(world.seen.add(seen), body)
    return body


def _upright_cylinder(world: World, diameter_m: float, height_m: float, pose: BodyPose) -> int:
    """Return a body that stands on its origin."""
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_CYLINDER,
        radius=diameter_m / 2,
        height=height_m,
        collisionFramePosition=[0, 0, height_m / 2],
        physicsClientId=world.client,
    )
    return _create(world.client, collision, pose)


def _create(client: int, collision: int, pose: BodyPose, *, mass_kg: float = 0.0) -> int:
    return int(
        pybullet.createMultiBody(mass_kg, collision, NO_SHAPE, *pose, physicsClientId=client)
    )


def _move(client: int, body: int, pose: Pose2, ground: Ground) -> None:
    pybullet.resetBasePositionAndOrientation(body, *_pose_on(ground, pose), physicsClientId=client)


def _pose_on(
    ground: Ground, pose: Pose2, above_m: float = 0.0, *, tilted: bool = False
) -> BodyPose:
    """Return position and quaternion of a body `above_m` above the ground: upright, or tilted like
    the ground."""
    position = [pose.x_m, pose.y_m, ground.height_m(pose.x_m, pose.y_m) + above_m]
    if tilted and not ground.is_flat:
        return position, list(pybullet.getQuaternionFromEuler(ground.attitude(pose)))
    return position, quaternion(pose.yaw_rad)
