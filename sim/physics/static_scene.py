"""Walls, furniture and trees merged: one collision mesh, and one visible mesh per material.

A body of its own for each would cost as much in every physics step as if it could move.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace

from navcore.geometry.transform import Pose2
from sim.bullet import pybullet
from sim.models.ground import Ground
from sim.models.mesh import merge_solids
from sim.models.solids import Solid
from sim.models.surface_patterns import pattern_period_m, surface_texture
from sim.physics.bodies import NO_SHAPE, mesh_collision
from sim.rendering.visual import Visual, patterned
from sim.scenario.layout import OVERHEAD_M, PlacedObject

FOUNDATION_M = 0.8
"""Depth to which objects reach into uneven ground, so that their lower side is never seen."""
NATURAL = ("bark", "leaves")
"""Patterns of natural surfaces, whose round solids need few faces."""


def build_static(
    client: int, objects: Iterable[PlacedObject], ground: Ground
) -> tuple[Visual, ...]:
    """Build all static objects, and return what they look like in the map."""
    solids = [solid for entry in objects for solid in _in_map(entry, ground)]
    reachable = [solid for solid, low_m in solids if low_m < OVERHEAD_M]
    if reachable:
        shape = mesh_collision(client, merge_solids(reachable))
        pybullet.createMultiBody(0, shape, NO_SHAPE, physicsClientId=client)
    return _visuals([solid for solid, _ in solids])


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


def _visuals(solids: Sequence[Solid]) -> tuple[Visual, ...]:
    """Return one visible mesh for each material."""
    materials = defaultdict(list)
    for solid in solids:
        materials[solid.colour, solid.pattern].append(solid)
    return tuple(
        patterned(
            merge_solids(parts, coarse=pattern in NATURAL),
            colour,
            surface_texture(pattern) if pattern_period_m(pattern) else None,
            pattern_period_m(pattern),
        )
        for (colour, pattern), parts in materials.items()
    )
