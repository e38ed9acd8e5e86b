"""The worlds of the BARN challenge and of DynaBARN as scenarios: cylinders to drive between, or
moving ones to dodge.

Of the published cylinders 0.5 m is seen above the floor; here they are taller, which changes
nothing for a body on the floor. Start and goal come to lie symmetrically about the origin.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from navcore.errors import BadConfiguration
from sim.models.solids import Colour
from sim.scenario.schema import Furniture, MapExtent, Mover, Scenario, Wall

HEIGHT_M = 1.2
"""Of everything that stands."""
GREY: Colour = (125, 130, 140)
OPTIMAL_MPS = 2.0
"""Speed by which the challenge reckons the best time."""
ROOM_M = 3.0
"""Floor beyond the outermost thing."""
HUSKY_SCALE = 1.7
"""All lengths by this, and a Husky fits where a Jackal does."""
SCALES = {"jackal": 1.0, "husky": HUSKY_SCALE}
FIRST_DYNAMIC_LENGTH_M = 20.0
"""From start to goal in every DynaBARN world; the published script takes a wrong one."""
Point = Sequence[float]


@dataclass(frozen=True, slots=True, kw_only=True)
class BarnWorld:
    """One world and how a run through it is judged."""

    id: int
    """As published."""
    scenario: Scenario
    """With the start and the goal."""
    reference_m: float
    """Length of the published reference path, scaled."""
    tolerance_m: float
    """So near to the goal is there."""
    limit_s: float
    """After so long it is a time-out."""

    @property
    def optimal_s(self) -> float:
        """The challenge's best time, OT."""
        return self.reference_m / OPTIMAL_MPS

    def score(self, *, success: bool, seconds: float) -> float:
        """success · OT / clip(AT, 2·OT, 8·OT): 0.5 at most."""
        best = self.optimal_s
        return best / min(max(seconds, 2 * best), 8 * best) if success else 0.0


def load_worlds(path: Path, *, scale: float) -> tuple[BarnWorld, ...]:
    """All worlds of a file, in its order, every length `scale` times as large; raises
    `BadConfiguration`.

    Where things move their times are stretched as well, so that they are as fast as published.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        worlds = tuple(_world(world, document["meta"], scale) for world in document["worlds"])
    except FileNotFoundError:
        raise BadConfiguration(
            f"{path}: no such file; --worlds names the JSON file of the BARN or DynaBARN worlds"
        ) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise BadConfiguration(f"{path}: not readable as JSON: {error}") from None
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise BadConfiguration(
            f"{path}: not a file of BARN or DynaBARN worlds: {type(error).__name__} {error}"
        ) from None
    if not worlds:
        raise BadConfiguration(f"{path}: holds no worlds")
    return worlds


def _world(world: dict[str, Any], meta: dict[str, Any], scale: float) -> BarnWorld:
    middle = [(a + b) / 2 for a, b in zip(meta["start"][:2], meta["goal"], strict=True)]

    def at(point: Point) -> tuple[float, float]:
        return scale * (point[0] - middle[0]), scale * (point[1] - middle[1])

    start, goal = at(meta["start"]), at(meta["goal"])
    parts = _dynamic(world, at, scale) if "obstacles" in world else _static(world, meta, at, scale)
    spots = [start, goal, *(piece.at for piece in parts.get("furniture", ()))]
    spots += [point for wall in parts.get("walls", ()) for point in wall.points]
    half = [max(abs(spot[axis]) for spot in spots) + ROOM_M for axis in (0, 1)]
    size_m = (2 * half[0], 2 * half[1])
    return BarnWorld(
        id=int(world["id"]),
        scenario=Scenario(
            name=f"{'dynabarn' if 'obstacles' in world else 'barn'} {world['id']}",
            size_m=size_m,
            map=MapExtent(size_m=size_m),
            start=(*start, math.remainder(meta["start"][2], 2 * math.pi)),
            goals=(goal,),
            **parts,
        ),
        reference_m=scale * float(world.get("path_length", FIRST_DYNAMIC_LENGTH_M)),
        tolerance_m=scale * float(meta["goal_tolerance"]),
        limit_s=float(meta["timeout"]),
    )


def _static(world: dict[str, Any], meta: dict[str, Any], at: Any, scale: float) -> dict[str, Any]:
    diameter = 2 * scale * float(meta["cylinder_radius"])
    size_m = (diameter, diameter, HEIGHT_M)
    cylinders = [*world["walls"], *world["cylinders"]]
    return {
        "furniture": tuple(
            Furniture(kind="cylinder", at=at(spot), size_m=size_m, colour=GREY)
            for spot in cylinders
        )
    }


def _dynamic(world: dict[str, Any], at: Any, scale: float) -> dict[str, Any]:
    movers = tuple(
        Mover(
            keys=tuple((scale * t_s, *at((x, y))) for t_s, x, y in thing["keys"]),
            period_s=scale * thing["period"],
            radius_m=scale * thing["radius"],
            height_m=HEIGHT_M,
        )
        for thing in world["obstacles"]
    )
    return {"walls": tuple(_wall(wall, at, scale) for wall in world["walls"]), "movers": movers}


def _wall(wall: dict[str, Any], at: Any, scale: float) -> Wall:
    """A box as a straight of wall along its longer side."""
    (x, y), (long, wide) = wall["centre"], wall["size"]
    ends = (
        [(x - long / 2, y), (x + long / 2, y)]
        if long > wide
        else [(x, y - wide / 2), (x, y + wide / 2)]
    )
    return Wall(
        points=(at(ends[0]), at(ends[1])), thickness_m=scale * min(long, wide), height_m=HEIGHT_M
    )
