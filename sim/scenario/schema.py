"""A world and the mission in it, read from a TOML file. The world is centred on the origin of the
map frame, z up.

Files are refused by key: unknown or missing keys and numbers out of range here, impossible places
in `sim.scenario_checks`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.toml_config import ranged
from sim.models.furniture import FURNITURE_COLOURS, FURNITURE_SIZES, furniture_solids
from sim.models.ground import Relief
from sim.models.items import ITEM_COLOURS, ITEM_SIZES, item_extent, item_shapes, item_solids
from sim.models.solids import Colour, Pattern, Solid, facing, quaternion
from sim.scenario.scenery import FARTHEST_M, Room, Scatter
from sim.sensors.faults import Fault

Indoors = Literal[
    "desk",
    "table",
    "chair",
    "armchair",
    "sofa",
    "shelf",
    "cabinet",
    "plant",
    "bin",
    "box",
    "cylinder",
]
Outdoors = Literal["house", "tree", "conifer", "bush", "rock"]
FurnitureKind = Literal[Indoors, Outdoors]
ItemKind = Literal[
    "cup", "book", "bag", "shoe", "bottle", "cable", "box", "keyboard", "landmine", "wet-floor sign"
]
Surface = Literal["paint", "water", "mud", "chemical"]
SURFACE_COLOURS: dict[str, Colour] = {
    "paint": (200, 20, 20),
    "water": (120, 140, 165),
    "mud": (86, 62, 40),
    "chemical": (150, 190, 40),
}
"""What a marking looks like when the file does not say."""
SHEEN_SHARE = {"paint": 0.0, "water": 0.55, "mud": 0.1, "chemical": 0.3}
"""How much of the floor's colour is seen through it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapExtent:
    """The grid that navigation maps this world on, centred on the origin."""

    size_m: tuple[float, float] = ranged(1.0, 2 * FARTHEST_M)
    """Sides along x and y."""
    resolution_m: float = ranged(0.01, 1.0, default=0.05)
    """Side of a cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wall:
    """A run of straight walls; a door is a gap between two runs."""

    points: tuple[tuple[float, float], ...] = ranged(-FARTHEST_M, FARTHEST_M)
    """Corners along the middle of the wall, two or more; equal ends close it."""
    thickness_m: float = ranged(0.02, 2.0, default=0.12)
    """Half of it on either side of the line."""
    height_m: float = ranged(0.1, 5.0, default=2.6)
    """From the floor."""
    colour: tuple[int, int, int] = ranged(0, 255, default=(226, 223, 214))
    """Red, green, blue."""
    doors_m: tuple[float, ...] = ranged(0.0, 4 * FARTHEST_M, default=())
    """How far along the run the middle of each door is: a gap in it."""
    door_m: float = ranged(0.1, 10.0, default=1.4)
    """How wide they are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Furniture:
    """Something that stands in the way."""

    kind: FurnitureKind
    """What it is."""
    at: tuple[float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Its middle, x and y in metres."""
    yaw_deg: float = ranged(-360.0, 360.0, default=0.0)
    """Where its front points, counter-clockwise from the map's x."""
    size_m: tuple[float, float, float] | None = ranged(0.02, 20.0, default=None)
    """Depth, width and height; usual for its kind when left out."""
    colour: tuple[int, int, int] | None = ranged(0, 255, default=None)
    """Red, green, blue; usual for its kind when left out."""

    def solids(self) -> tuple[Solid, ...]:
        """What it is made of, in its own frame."""
        size, colour = (
            self.size_m or FURNITURE_SIZES[self.kind],
            self.colour or FURNITURE_COLOURS[self.kind],
        )
        return furniture_solids(self.kind, size, colour)


@dataclass(frozen=True, slots=True, kw_only=True)
class Marking:
    """A painted area of the floor, or something spilt on it, without height."""

    name: str
    """For reports."""
    polygon: tuple[tuple[float, float], ...] = ranged(-FARTHEST_M, FARTHEST_M)
    """Its corners in metres, three or more, in either sense."""
    surface: Surface = "paint"
    """What it is of; all but paint shine, and the floor shows through."""
    colour: tuple[int, int, int] | None = ranged(0, 255, default=None)
    """Red, green, blue; usual for its surface when left out."""
    beware: bool = True
    """Whether the robot must stay off it."""

    def paint(self) -> Colour:
        """Its own colour."""
        return self.colour or SURFACE_COLOURS[self.surface]

    def seen_on(self, floor: Colour) -> Colour:
        """Its colour on a floor."""
        share = SHEEN_SHARE[self.surface]
        red, green, blue = (
            round((1 - share) * own + share * below)
            for own, below in zip(self.paint(), floor, strict=True)
        )
        return red, green, blue


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """A small thing on the floor; the robot must touch none of them."""

    kind: ItemKind
    """What it is."""
    at: tuple[float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Its middle, x and y in metres."""
    yaw_deg: float = ranged(-360.0, 360.0, default=0.0)
    """Its turn, counter-clockwise."""
    shape: str = ""
    """One of the shapes of its kind; the usual one when left out."""
    size_m: tuple[float, float, float] | None = ranged(0.004, 3.0, default=None)
    """Length, width and height of the upright thing; usual for its kind when left out."""
    colour: tuple[int, int, int] | None = ranged(0, 255, default=None)
    """Red, green, blue; usual for its kind when left out."""

    def solids(self) -> tuple[Solid, ...]:
        """What it is made of, in its own frame."""
        shape = self.shape or item_shapes(self.kind)[0]
        return item_solids(self.kind, self._size(), self.colour or ITEM_COLOURS[self.kind], shape)

    def extent_m(self) -> tuple[float, float, float]:
        """Sides of the box that it takes up as it lies, along x, y and z."""
        return item_extent(self.kind, self._size(), self.shape)

    def _size(self) -> tuple[float, float, float]:
        return self.size_m or ITEM_SIZES[self.kind]


@dataclass(frozen=True, slots=True, kw_only=True)
class Print:
    """A picture of an item, flat on the floor or on a wall: nothing to run into and nothing to
    beware of."""

    shows: ItemKind
    """What is drawn on it."""
    at: tuple[float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Its middle, x and y in metres; on a wall half the wall's thickness and a centimetre off its
    line."""
    yaw_deg: float = ranged(-360.0, 360.0, default=0.0)
    """On the floor its turn, counter-clockwise; on a wall where it faces."""
    size_m: tuple[float, float] = ranged(0.05, 5.0, default=(0.3, 0.3))
    """Width and height."""
    on: Literal["floor", "wall"] = "floor"
    """What carries it."""
    height_m: float = ranged(0.0, 5.0, default=1.2)
    """Of its middle, on a wall."""

    def turn(self) -> list[float]:
        """Quaternion x, y, z, w in the map frame of its own x to the right, y upwards, z towards
        who looks."""
        yaw_rad = math.radians(self.yaw_deg)
        return quaternion(yaw_rad) if self.on == "floor" else facing(yaw_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """Somebody who stands, or walks to and fro along a line of points."""

    points: tuple[tuple[float, float], ...] = ranged(-FARTHEST_M, FARTHEST_M)
    """One point to stand on, or two and more to walk along and back."""
    yaw_deg: float = ranged(-360.0, 360.0, default=0.0)
    """Where somebody who stands looks."""
    speed_mps: float = ranged(0.0, 3.0, default=0.8)
    """Of walking."""
    yields: bool = True
    """Whether a walker waits, or turns back, when the robot is right before him."""
    begins_at: float | None = ranged(0.0, 1.0, default=None)
    """Share of his line at which a walker begins, towards its end; anywhere and either way, by the
    seed, when left out."""
    pauses_s: tuple[float, ...] = ranged(0.0, 3600.0, default=())
    """How long a walker stands at each of his points before he walks on; nowhere when left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mover:
    """A cylinder that moves by a timetable and yields to nobody."""

    keys: tuple[tuple[float, float, float], ...] = ranged(-86_400.0, 86_400.0)
    """Seconds, x and y in metres: where it is when; in between it goes straight. In order of time,
    one or more."""
    period_s: float = ranged(0.1, 86_400.0)
    """After so long it is where it began, and does the same again."""
    radius_m: float = ranged(0.02, 5.0, default=0.5)
    """Of the cylinder."""
    height_m: float = ranged(0.1, 5.0, default=1.5)
    """From the floor."""
    colour: tuple[int, int, int] = ranged(0, 255, default=(120, 120, 125))
    """Red, green, blue."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A world, the robot's place in it, and the mission S → G1 → G2 → …"""

    name: str
    """For reports."""
    size_m: tuple[float, float] = ranged(1.0, 2 * FARTHEST_M)
    """Sides of the floor along x and y; centred on the origin."""
    map: MapExtent
    """What navigation maps of it."""
    start: tuple[float, float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Where the robot starts: x and y in metres, yaw in radians."""
    goals: tuple[tuple[float, float], ...] = ranged(-FARTHEST_M, FARTHEST_M, default=())
    """Where the mission leads, in this order, x and y in metres."""
    floor_colour: tuple[int, int, int] = ranged(0, 255, default=(196, 196, 194))
    """Red, green, blue."""
    floor_pattern: Pattern = "plain"
    """What its colour is multiplied with."""
    relief: Relief | None = None
    """How the ground rolls; flat when left out."""
    walls: tuple[Wall, ...] = field(default=())
    """All walls."""
    furniture: tuple[Furniture, ...] = field(default=())
    """Everything else that stands."""
    markings: tuple[Marking, ...] = field(default=())
    """Everything painted on the floor."""
    items: tuple[Item, ...] = field(default=())
    """Everything small on the floor."""
    prints: tuple[Print, ...] = field(default=())
    """All pictures on floor and walls."""
    people: tuple[Person, ...] = field(default=())
    """Everybody."""
    movers: tuple[Mover, ...] = field(default=())
    """Everything that moves by a timetable."""
    faults: tuple[Fault, ...] = field(default=())
    """Everything that goes wrong, and when."""
    rooms: tuple[Room, ...] = field(default=())
    """Where each seed furnishes: its furniture comes to that of the file."""
    scatter: tuple[Scatter, ...] = field(default=())
    """What each seed strews, one after the other: it comes to the furniture and the items of the
    file."""

    @property
    def start_pose(self) -> Pose2:
        """T_map_base at the start."""
        x, y, yaw = self.start
        return Pose2(x_m=x, y_m=y, yaw_rad=yaw)


def map_grid(scenario: Scenario) -> GridSpec:
    """The map's grid for a world."""
    return GridSpec.centred(size_m=scenario.map.size_m, resolution_m=scenario.map.resolution_m)
