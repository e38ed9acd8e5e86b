"""Walls, furniture and trees as the engine takes them best: one mesh to run into, and one per
material to be seen.

A body of its own for each would cost as much in every physics step and every picture as if it could
move.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace

import pybullet

from navcore.geometry.transform import Pose2
from sim.models.ground import Ground
from sim.models.mesh import merged
from sim.models.solids import Pattern, Solid
from sim.models.surface_patterns import repeats_m, surface_texture
from sim.physics.bodies import NO_SHAPE, load_texture, put_texture, show_mesh, solid_mesh
from sim.scenario.layout import OVERHEAD_M, Thing

FOUNDATION_M = 0.8
"""On uneven ground what stands on it reaches so far into it, or one would see below its lower side.
"""
NATURAL = ("bark", "leaves")
"""What is never quite round needs few faces."""


def build_static(client: int, things: Iterable[Thing], ground: Ground) -> None:
    """Everything that stands where it stands."""
    solids = [solid for thing in things for solid in _in_map(thing, ground)]
    if not solids:
        return
    touchable = [solid for solid, low_m in solids if low_m < OVERHEAD_M]
    shape = solid_mesh(client, merged(touchable)) if touchable else NO_SHAPE
    textures: dict[Pattern, int] = {}
    for seen, pattern in _show(client, [solid for solid, _ in solids]):
        # The first body is the one that is run into; without a look of its own it would be drawn as
        # the mesh it is.
        body = pybullet.createMultiBody(0, shape, seen, physicsClientId=client)
        shape = NO_SHAPE
        if repeats_m(pattern):
            if pattern not in textures:
                textures[pattern] = load_texture(client, surface_texture(pattern))
            put_texture(client, body, textures[pattern])


def _in_map(thing: Thing, ground: Ground) -> Iterable[tuple[Solid, float]]:
    """Its solids in the map frame, and how high above its own ground each begins."""
    for solid in thing.solids:
        (x, y), z = _moved(solid.centre_m[:2], thing.pose), solid.centre_m[2]
        # A thing keeps its parts together on the ground of its middle; a wall, which has none,
        # follows the ground.
        foot = (x, y) if thing.name == "wall" else (thing.pose.x_m, thing.pose.y_m)
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
                yaw_rad=solid.yaw_rad + thing.pose.yaw_rad,
            ),
            solid.bottom_m,
        )


def _moved(at: tuple[float, float], pose: Pose2) -> tuple[float, float]:
    matrix = pose.matrix()
    x, y = matrix[:2, :2] @ at + matrix[:2, 3]
    return float(x), float(y)


def _show(client: int, solids: Sequence[Solid]) -> list[tuple[int, Pattern]]:
    """A visual shape for each material, with its pattern."""
    materials = defaultdict(list)
    for solid in solids:
        materials[solid.colour, solid.pattern].append(solid)
    return [
        (
            show_mesh(
                client,
                merged(parts, coarse=pattern in NATURAL),
                colour,
                repeats_m=repeats_m(pattern),
            ),
            pattern,
        )
        for (colour, pattern), parts in materials.items()
    ]
