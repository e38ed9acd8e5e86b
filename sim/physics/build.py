"""Builds a scenario in a physics client: floor, walls, furniture, markings, items and people."""

from __future__ import annotations

import numpy as np

from navcore.geometry.transform import Pose2
from navcore.robot.profile import HUSKY, RobotProfile
from sim.bullet import pybullet
from sim.models.ground import Ground
from sim.models.items import ITEM_MASSES_KG
from sim.models.mesh import merge_solids
from sim.models.person import DEFAULT_APPEARANCE, person_solids
from sim.models.solids import Colour, box, cylinder, quaternion
from sim.models.surface_patterns import pattern_period_m, surface_texture
from sim.models.textures import (
    GLOSS,
    PLATE_SHARE,
    SPILL_SIDE_M,
    print_texture,
    spill_texture,
    tag_texture,
)
from sim.physics.bodies import (
    NO_SHAPE,
    apply_texture,
    load_texture,
    mesh_collision,
    mesh_visual,
    polygon_visual,
    solids_visual,
    square_visual,
)
from sim.physics.movers import TimedMover
from sim.physics.pedestrians import BODY_DIAMETER_M, Walker
from sim.physics.static_scene import build_static
from sim.physics.terrain_mesh import drape, terrain_mesh
from sim.scenario.layout import PlacedObject, items, obstacles
from sim.scenario.schema import Item, Marking, Print, Scenario
from sim.scenario.tags import Tag

PAINT_M = 0.003
"""Height of paint above the floor, because the renderer could not order surfaces at the same depth.
"""
PRINT_M = 0.0015
"""Height of a print on the floor, lower than paint."""
WHITE: Colour = (255, 255, 255)
BodyPose = tuple[list[float], list[float]]
"""Position x, y, z and quaternion x, y, z, w in the map frame."""


def build_world(client: int, scenario: Scenario) -> None:
    """Build the floor first, then markings, prints, static objects, and items last."""
    ground = Ground(scenario.relief)
    _build_floor(client, scenario, ground)
    for i, marking in enumerate(scenario.markings):
        _build_marking(client, marking, scenario.floor_colour, i, ground)
    for sheet in scenario.prints:
        _build_print(client, sheet, ground)
    for tag in scenario.tags:
        _build_tag(client, tag, ground)
    build_static(client, obstacles(scenario), ground)
    for entry, item in zip(items(scenario), scenario.items, strict=True):
        _build_item(client, entry, item, ground)


class Crowd:
    """The people and movers of a world, and their bodies."""

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
        self._movers = [TimedMover(mover, period_s) for mover in scenario.movers]
        self._mover_bodies = [_build_mover(client, mover, self._ground) for mover in self._movers]

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


def _build_floor(client: int, scenario: Scenario, ground: Ground) -> None:
    x_m, y_m = scenario.size_m[0] + 2.0, scenario.size_m[1] + 2.0
    side_m, colour = pattern_period_m(scenario.floor_pattern), scenario.floor_colour
    if ground.is_flat:
        shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        slab = box((x_m, y_m, 0.1), (0.0, 0.0), colour, bottom_m=-0.1)
        seen = (
            mesh_visual(client, merge_solids([slab]), colour, period_m=side_m)
            if side_m
            else solids_visual(client, [slab])
        )
    else:
        mesh = terrain_mesh(ground, (x_m, y_m))
        shape, seen = (
            mesh_collision(client, mesh),
            mesh_visual(client, mesh, colour, period_m=side_m),
        )
    # The plane needs a visual shape: without one, the EGL renderer draws it by itself and
    # crashes.
    floor = pybullet.createMultiBody(0, shape, seen, physicsClientId=client)
    pybullet.changeDynamics(floor, -1, lateralFriction=1.0, physicsClientId=client)
    if side_m:
        apply_texture(client, floor, load_texture(client, surface_texture(scenario.floor_pattern)))


def _build_marking(client: int, marking: Marking, floor: Colour, seed: int, ground: Ground) -> None:
    """Build paint, or a spill, which shines and shows part of the floor colour."""
    spilt = marking.surface != "paint"
    colour, side_m = (WHITE, SPILL_SIDE_M) if spilt else (marking.paint(), 1.0)
    if ground.is_flat:
        patch, up_m = polygon_visual(client, marking.polygon, colour, side_m=side_m), PAINT_M
    else:
        patch, up_m = (
            mesh_visual(client, drape(ground, marking.polygon, PAINT_M), colour, period_m=side_m),
            0.0,
        )
    body = pybullet.createMultiBody(0, NO_SHAPE, patch, [0, 0, up_m], physicsClientId=client)
    if spilt:
        apply_texture(
            client,
            body,
            load_texture(
                client, spill_texture(marking.seen_on(floor), GLOSS[marking.surface], seed)
            ),
        )


def _build_print(client: int, sheet: Print, ground: Ground) -> None:
    """Build a print without thickness on the floor or just in front of a wall."""
    height_m = PRINT_M if sheet.on == "floor" else sheet.height_m
    body = pybullet.createMultiBody(
        0,
        NO_SHAPE,
        square_visual(client, sheet.size_m),
        [*sheet.at, ground.height_m(*sheet.at) + height_m],
        sheet.turn(),
        physicsClientId=client,
    )
    apply_texture(client, body, load_texture(client, print_texture(sheet.shows)))


def _build_tag(client: int, tag: Tag, ground: Ground) -> None:
    """Build a plate without thickness, seen from the front."""
    side_m = tag.size_m * PLATE_SHARE
    body = pybullet.createMultiBody(
        0,
        NO_SHAPE,
        square_visual(client, (side_m, side_m)),
        [*tag.at, ground.height_m(*tag.at) + tag.height_m],
        tag.turn(),
        physicsClientId=client,
    )
    apply_texture(client, body, load_texture(client, tag_texture(tag.id)))


def _build_item(client: int, entry: PlacedObject, item: Item, ground: Ground) -> None:
    """Build an item as a loose body that the robot can push; on hills nothing would stay, so there
    it is fixed. Its collision shape is one box."""
    size = item.extent_m()
    middle = size[2] / 2
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=[side / 2 for side in size], physicsClientId=client
    )
    visual = solids_visual(client, entry.solids, lower_m=middle)
    mass_kg = ITEM_MASSES_KG[item.kind] if ground.is_flat else 0.0
    pose = _pose_on(ground, entry.pose, middle, tilted=True)
    body = _create(client, collision, visual, pose, mass_kg=mass_kg)
    pybullet.changeDynamics(
        body, -1, lateralFriction=0.6, rollingFriction=0.01, physicsClientId=client
    )


def _build_person(client: int, walker: Walker, ground: Ground) -> int:
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_CYLINDER,
        radius=BODY_DIAMETER_M / 2,
        height=DEFAULT_APPEARANCE.height_m,
        collisionFramePosition=[0, 0, DEFAULT_APPEARANCE.height_m / 2],
        physicsClientId=client,
    )
    visual = solids_visual(client, person_solids(stride=0.1 if walker.walks else 0.0))
    return _create(client, collision, visual, _pose_on(ground, walker.pose))


def _build_mover(client: int, mover: TimedMover, ground: Ground) -> int:
    size = mover.height_m
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_CYLINDER,
        radius=mover.diameter_m / 2,
        height=size,
        collisionFramePosition=[0, 0, size / 2],
        physicsClientId=client,
    )
    visual = solids_visual(client, [cylinder(mover.diameter_m, size, (0.0, 0.0), mover.colour)])
    return _create(client, collision, visual, _pose_on(ground, mover.pose))


def _create(
    client: int, collision: int, visual: int, pose: BodyPose, *, mass_kg: float = 0.0
) -> int:
    return int(pybullet.createMultiBody(mass_kg, collision, visual, *pose, physicsClientId=client))


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
