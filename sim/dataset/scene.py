"""What a random world holds: pieces, patches and prints, each with the class that its pixels get."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from navcore.geometry.transform import Pose2
from sim.models.solids import Colour, Solid
from sim.sensors.camera import DAYLIGHT, Light

BACKGROUND = "background"


@dataclass(frozen=True, slots=True, kw_only=True)
class SolidObject:
    """Something of solids that stands or lies on the floor."""

    label: str
    """Its class."""
    solids: tuple[Solid, ...]
    """In its own frame."""
    pose: Pose2
    """T_map_piece."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decal:
    """Something flat on the floor."""

    label: str
    """Its class."""
    polygon: tuple[tuple[float, float], ...]
    """Corners in metres of the map frame."""
    colour: Colour
    """Its paint, or what its texture is multiplied with."""
    texture: int | None = None
    """Number of a pattern of the studio."""
    texture_side_m: float = 1.0
    """A texture repeats after so many metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Poster:
    """A picture on the floor or on a wall, which is background whatever it shows."""

    texture: int
    """Number of a print of the studio."""
    at_m: tuple[float, float, float]
    """Its middle."""
    turn: tuple[float, ...]
    """Quaternion x, y, z, w of its own x to the right, y upwards, z towards who looks."""
    size_m: tuple[float, float]
    """Width and height."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """A round place on the floor that something takes up."""

    x_m: float
    y_m: float
    radius_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One random world."""

    pieces: tuple[SolidObject, ...]
    """Walls, furniture, items, people."""
    patches: tuple[Decal, ...]
    """The ground first, then all that lies on it; the later lies higher."""
    sheets: tuple[Poster, ...]
    """Prints."""
    targets: tuple[Spot, ...]
    """What is worth looking at."""
    blocked: tuple[Spot, ...]
    """Where no robot stands."""
    reach_m: tuple[float, float]
    """A robot stands within ± this, along x and y."""
    light: Light = DAYLIGHT
    """What lights it."""
    sky: Colour | None = None
    """What is seen where nothing is; None for the renderer's own."""
    like_simulator: bool = False
    """Whether it is coloured, lit and taken exactly as scenarios are."""


@dataclass(slots=True, kw_only=True)
class Plan:
    """What is put together, step by step."""

    rng: Rng
    half_m: tuple[float, float]
    walled: bool
    outdoor: bool
    plain: bool
    pieces: list[SolidObject] = field(default_factory=list)
    patches: list[Decal] = field(default_factory=list)
    sheets: list[Poster] = field(default_factory=list)
    targets: list[Spot] = field(default_factory=list)
    blocked: list[Spot] = field(default_factory=list)

    def free(self, x_m: float, y_m: float, radius_m: float) -> bool:
        """Whether a round thing fits in there, inside the room and off all others."""
        inside = abs(x_m) + radius_m < self.half_m[0] and abs(y_m) + radius_m < self.half_m[1]
        return inside and all(
            math.hypot(x_m - s.x_m, y_m - s.y_m) > radius_m + s.radius_m for s in self.blocked
        )


Rng = np.random.Generator
