"""Walls, furniture and trees merged for the engine: one collision mesh, and one visual mesh per
material.

A body of its own for each would cost as much in every physics step and every image as if it could
move.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace

from navcore.geometry.transform import Pose2
from sim.bullet import pybullet
from sim.models.ground import Ground
from sim.models.mesh import merge_solids
from sim.models.solids import Pattern, Solid
from sim.models.surface_patterns import pattern_period_m, surface_texture
from sim.physics.bodies import NO_SHAPE, apply_texture, load_texture, mesh_collision, mesh_visual
from sim.scenario.layout import OVERHEAD_M, PlacedObject

FOUNDATION_M = 0.8
"""Depth to which objects reach into uneven ground, so that their lower side is never seen."""
NATURAL = ("bark", "leaves")
"""Patterns of natural surfaces, whose round solids need few faces."""


def build_static(client: int, objects: Iterable[PlacedObject], ground: Ground) -> None:
    """Build all static objects."""
    solids = [solid for entry in objects for solid in _in_map(entry, ground)]
    if not solids:
        return
    reachable = [solid for solid, low_m in solids if low_m < OVERHEAD_M]
    shape = mesh_collision(client, merge_solids(reachable)) if reachable else NO_SHAPE
    textures: dict[Pattern, int] = {}
    for seen, pattern in _visuals(client, [solid for solid, _ in solids]):
        # The first body carries the collision mesh; without a visual shape it would be drawn as
        # that mesh.
        body = pybullet.createMultiBody(0, shape, seen, physicsClientId=client)
        shape = NO_SHAPE
        if pattern_period_m(pattern):
            if pattern not in textures:
                textures[pattern] = load_texture(client, surface_texture(pattern))
            apply_texture(client, body, textures[pattern])


def _in_map(entry: PlacedObject, ground: Ground) -> Iterable[tuple[Solid, float]]:
    """Return the solids of an object in the map frame, each with its height above the ground."""
    for solid in entry.solids:
        (x, y), z = _to_map(solid.centre_m[:2], entry.pose), solid.centre_m[2]
        # An object keeps its parts together on the ground at its middle; a wall, which has none,
        # follows the ground.
        foot = (x, y) if entry.name == "wall" else (entry.pose.x_m, entry.pose.y_m)
        deeper_m = (
            FOUNDATION_M
            if not ground.is_flat and solid.bottom_m < 1e-6 and solid.pitch_rad == 0
            else 0.0
        )
        yield (
            replace(
                solid,
                size_m=(*solid.size_m[:2], solid.size_m[2] + deeper_m),
                centre_m=(x, y, z + ground.height_m(*foot) - deeper_m / 2),
                yaw_rad=solid.yaw_rad + entry.pose.yaw_rad,
            ),
            solid.bottom_m,
        )


def _to_map(at: tuple[float, float], pose: Pose2) -> tuple[float, float]:
    matrix = pose.matrix()
    x, y = matrix[:2, :2] @ at + matrix[:2, 3]
    return float(x), float(y)


def _visuals(client: int, solids: Sequence[Solid]) -> list[tuple[int, Pattern]]:
    """Return a visual shape for each material, with its pattern."""
    materials = defaultdict(list)
    for solid in solids:
        materials[solid.colour, solid.pattern].append(solid)
    return [
        (
            mesh_visual(
                client,
                merge_solids(parts, coarse=pattern in NATURAL),
                colour,
                period_m=pattern_period_m(pattern),
            ),
            pattern,
        )
        for (colour, pattern), parts in materials.items()
    ]
