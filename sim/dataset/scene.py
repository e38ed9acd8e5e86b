"""Contents of a random world: solid objects, decals and posters, each with its class."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from navcore.geometry.transform import Pose2
from sim.models.solids import Colour, Solid
from sim.rendering.light import DAYLIGHT, Light

Rng = np.random.Generator
BACKGROUND = "background"
"""Class of everything that is no beware object."""
UNSEEN = "unseen"
"""Class of an object of a kind that no network was trained on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """What the solids of one colour are made of."""

    texture: int
    """Number of a material of the renderer."""
    side_m: float
    """Length after which the texture repeats."""
    covers: Colour
    """Colour of the solids that are of this material; the others keep their own."""
    tint: Colour
    """Colour that multiplies that of the texture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolidObject:
    """An object made of solids on the floor."""

    label: str
    """Class of its pixels."""
    solids: tuple[Solid, ...]
    """Solids in the frame of the object."""
    pose: Pose2
    """T_map_object."""
    material: Material | None = None
    """Material of some of its solids; None for plain colours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decal:
    """A flat polygon on the floor."""

    label: str
    """Class of its pixels."""
    polygon: tuple[tuple[float, float], ...]
    """Corners in metres of the map frame."""
    colour: Colour
    """Colour of the paint, or factor of the texture."""
    texture: int | None = None
    """Number of a pattern of the renderer; None for plain paint."""
    texture_side_m: float = 1.0
    """Length after which the texture repeats."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Poster:
    """A print on the floor or on a wall, which is background whatever it shows."""

    texture: int
    """Number of a print of the renderer."""
    at_m: tuple[float, float, float]
    """Position of the middle, x, y and z in metres."""
    turn: tuple[float, ...]
    """Quaternion x, y, z, w of the poster: its x to the right, y upwards, z towards the observer.
    """
    size_m: tuple[float, float]
    """Width and height."""
    cut_out: bool = False
    """Whether it is cut out along the outline of the thing that it shows, as a sticker is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """An occupied disc on the floor."""

    x_m: float
    """Centre along x of the map."""
    y_m: float
    """Centre along y of the map."""
    radius_m: float
    """Radius of the disc."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Top:
    """The top of a table, on which things stand."""

    x_m: float
    """Centre along x of the map."""
    y_m: float
    """Centre along y of the map."""
    radius_m: float
    """Radius of a disc within the top."""
    height_m: float
    """Height above the floor."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One random world."""

    objects: tuple[SolidObject, ...]
    """Walls, furniture, items and people."""
    decals: tuple[Decal, ...]
    """Decals in order of height, the ground first."""
    posters: tuple[Poster, ...]
    """Posters on floor and walls."""
    targets: tuple[Spot, ...]
    """Targets for the camera."""
    blocked: tuple[Spot, ...]
    """Discs in which no robot stands."""
    reach_m: tuple[float, float]
    """Bound of the positions of a robot: ± this along x and y."""
    light: Light = DAYLIGHT
    """Light of the world."""
    sky: Colour | None = None
    """Colour of the sky; None for that of the renderer."""
    like_simulator: bool = False
    """Whether the world is coloured, lit and rendered exactly like scenarios."""
    tops: tuple[Top, ...] = ()
    """Tables that a camera in a hand looks at."""


@dataclass(slots=True, kw_only=True)
class ScenePlan:
    """A scene under construction."""

    rng: Rng
    """Random generator of the world."""
    half_m: tuple[float, float]
    """Half the sides of the floor along x and y."""
    walled: bool
    """Whether walls enclose the floor."""
    outdoor: bool
    """Whether the ground has an outdoor pattern."""
    plain: bool
    """Whether the world is coloured, lit and rendered exactly like scenarios."""
    objects: list[SolidObject] = field(default_factory=list)
    """Walls, furniture, items and people."""
    decals: list[Decal] = field(default_factory=list)
    """Decals in order of height, the ground first."""
    posters: list[Poster] = field(default_factory=list)
    """Posters on floor and walls."""
    targets: list[Spot] = field(default_factory=list)
    """Targets for the camera."""
    blocked: list[Spot] = field(default_factory=list)
    """Occupied discs."""

    def free(self, x_m: float, y_m: float, radius_m: float) -> bool:
        """Return whether a disc lies inside the room and clear of all others."""
        inside = abs(x_m) + radius_m < self.half_m[0] and abs(y_m) + radius_m < self.half_m[1]
        return inside and all(
            math.hypot(x_m - s.x_m, y_m - s.y_m) > radius_m + s.radius_m for s in self.blocked
        )
