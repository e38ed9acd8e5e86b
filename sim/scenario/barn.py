"""The worlds of the BARN challenge and of DynaBARN as scenarios: cylinders to drive between, or
moving ones to avoid.

The published cylinders are 0.5 m high; here they are taller, which changes nothing for a robot on
the floor. Start and goal lie symmetrically about the origin.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from navcore.errors import BadConfiguration
from sim.models.solids import Colour
from sim.scenario.schema import Furniture, MapExtent, Mover, Scenario, Wall

HEIGHT_M = 1.2
"""Height of all obstacles."""
GREY: Colour = (125, 130, 140)
OPTIMAL_MPS = 2.0
"""Speed from which the challenge computes the optimal time."""
FLOOR_MARGIN_M = 3.0
"""Width of the floor beyond the outermost object."""
HUSKY_SCALE = 1.7
"""Scale of all lengths at which a Husky fits where a Jackal does."""
SCALES = {"jackal": 1.0, "husky": HUSKY_SCALE}
FIRST_DYNAMIC_LENGTH_M = 20.0
"""Distance from start to goal in every DynaBARN world; the published script uses a wrong one."""
Point = Sequence[float]
ToMap = Callable[[Point], tuple[float, float]]
"""Function from a published point to the scaled map frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BarnWorld:
    """One world and the rules by which a run through it is judged."""

    id: int
    """Published number of the world."""
    scenario: Scenario
    """World with the start and the goal."""
    reference_m: float
    """Length of the published reference path, scaled."""
    tolerance_m: float
    """Distance from the goal that counts as arrival."""
    limit_s: float
    """Duration after which the run is a time-out."""

    @property
    def optimal_s(self) -> float:
        """The optimal time OT of the challenge."""
        return self.reference_m / OPTIMAL_MPS

    def score(self, *, success: bool, seconds: float) -> float:
        """Return the score success · OT / clip(AT, 2·OT, 8·OT), at most 0.5."""
        best = self.optimal_s
        return best / min(max(seconds, 2 * best), 8 * best) if success else 0.0


def load_worlds(path: Path, *, scale: float) -> tuple[BarnWorld, ...]:
    """Return all worlds of a file in its order, with every length multiplied by `scale`; raises
    `BadConfiguration`.

    The times of moving obstacles are scaled as well, so that their speeds stay as published.
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
    centre = [(a + b) / 2 for a, b in zip(meta["start"][:2], meta["goal"], strict=True)]

    def at(point: Point) -> tuple[float, float]:
        return scale * (point[0] - centre[0]), scale * (point[1] - centre[1])

    start, goal = at(meta["start"]), at(meta["goal"])
    parts = _dynamic(world, at, scale) if "obstacles" in world else _static(world, meta, at, scale)
    points = [start, goal, *(piece.at for piece in parts.get("furniture", ()))]
    points += [point for wall in parts.get("walls", ()) for point in wall.points]
    half = [max(abs(point[axis]) for point in points) + FLOOR_MARGIN_M for axis in (0, 1)]
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


def _static(world: dict[str, Any], meta: dict[str, Any], at: ToMap, scale: float) -> dict[str, Any]:
    diameter = 2 * scale * float(meta["cylinder_radius"])
    size_m = (diameter, diameter, HEIGHT_M)
    cylinders = [*world["walls"], *world["cylinders"]]
    return {
        "furniture": tuple(
            Furniture(kind="cylinder", at=at(point), size_m=size_m, colour=GREY)
            for point in cylinders
        )
    }


def _dynamic(world: dict[str, Any], at: ToMap, scale: float) -> dict[str, Any]:
    movers = tuple(
        Mover(
            keys=tuple((scale * t_s, *at((x, y))) for t_s, x, y in obstacle["keys"]),
            period_s=scale * obstacle["period"],
            radius_m=scale * obstacle["radius"],
            height_m=HEIGHT_M,
        )
        for obstacle in world["obstacles"]
    )
    return {"walls": tuple(_wall(wall, at, scale) for wall in world["walls"]), "movers": movers}


def _wall(wall: dict[str, Any], at: ToMap, scale: float) -> Wall:
    """Return a box as a straight wall along its longer side."""
    (x, y), (long, wide) = wall["centre"], wall["size"]
    ends = (
        [(x - long / 2, y), (x + long / 2, y)]
        if long > wide
        else [(x, y - wide / 2), (x, y + wide / 2)]
    )
    return Wall(
        points=(at(ends[0]), at(ends[1])), thickness_m=scale * min(long, wide), height_m=HEIGHT_M
    )
