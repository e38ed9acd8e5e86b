"""Schema of scenario files: a world and the mission in it. The world is centred on the origin of
the map frame, z up.

Files are refused by key: unknown or missing keys and numbers out of range here, impossible layouts
in `sim.scenario.validation`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from navcore.geometry.transform import Pose2
from navcore.grid.grid import DEFAULT_RESOLUTION_M, GridSpec
from navcore.toml_config import ranged
from sim.models.floor_paint import PATTERN_COLOURS, PaintPattern
from sim.models.furniture import FURNITURE_COLOURS, FURNITURE_SIZES, furniture_solids
from sim.models.ground import Relief
from sim.models.items import ITEM_COLOURS, ITEM_SIZES, item_extent, item_shapes, item_solids
from sim.models.raised_ground import RaisedGround
from sim.models.solids import (
    FARTHEST_M,
    Colour,
    Pattern,
    Size,
    Solid,
    facing_quaternion,
    quaternion,
)
from sim.rendering.lighting import PLAIN, Lighting
from sim.scenario.scenery import Room, Scatter
from sim.scenario.tags import Tag
from sim.sensors.faults import Fault
from sim.sensors.gnss_settings import Gnss

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
FLOOR_COLOUR: Colour = (196, 196, 194)
"""Default colour of the floor."""
WALL_COLOUR: Colour = (226, 223, 214)
"""Default colour of a wall."""
WALL_HEIGHT_M = 2.6
"""Default height of a wall."""
SURFACE_COLOURS: dict[str, Colour] = {
    "paint": (200, 20, 20),
    "water": (120, 140, 165),
    "mud": (86, 62, 40),
    "chemical": (150, 190, 40),
}
"""Default colour of a marking by its surface."""
PATTERN_CLASSES: dict[PaintPattern, str] = {
    "tape": "yellow-black tape",
    "red-white-tape": "red-white tape",
    "hatched": "hatched area",
    "bay": "reserved bay",
    "white-bay": "white-lined bay",
    "high-voltage": "high-voltage symbol",
    "radiation": "radiation symbol",
    "yellow": "yellow floor",
    "blue": "blue floor",
    "green": "green floor",
    "white-line": "white line",
}
"""Class in the beware list of a marking by its pattern."""
SHEEN_SHARE = {"paint": 0.0, "water": 0.55, "mud": 0.1, "chemical": 0.3}
"""Share of the floor colour that shows through each surface."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapExtent:
    """The grid on which navigation maps this world, centred on the origin."""

    size_m: tuple[float, float] = ranged(1.0, 2 * FARTHEST_M)
    """Sides along x and y."""
    resolution_m: float = ranged(0.01, 1.0, default=DEFAULT_RESOLUTION_M)
    """Side of a cell of the grid."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wall:
    """A run of straight walls; a door is a gap between two runs."""

    points: tuple[tuple[float, float], ...] = ranged(-FARTHEST_M, FARTHEST_M)
    """Corners along the middle of the wall, two or more; equal ends close it."""
    thickness_m: float = ranged(0.02, 2.0, default=0.12)
    """Thickness of the wall, half of it on either side of the line."""
    height_m: float = ranged(0.1, 5.0, default=WALL_HEIGHT_M)
    """Height above the floor."""
    colour: tuple[int, int, int] = ranged(0, 255, default=WALL_COLOUR)
    """Colour: red, green, blue."""
    doors_m: tuple[float, ...] = ranged(0.0, 4 * FARTHEST_M, default=())
    """Distance of the middle of each door along the run; each door is a gap in the wall."""
    door_m: float = ranged(0.1, 10.0, default=1.4)
    """Width of the doors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Furniture:
    """A piece of furniture."""

    kind: FurnitureKind
    """Kind of furniture."""
    at: tuple[float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Position of the middle, x and y in metres."""
    yaw_deg: float = ranged(-360.0, 360.0, default=0.0)
    """Direction of the front, counter-clockwise from x of the map."""
    size_m: tuple[float, float, float] | None = ranged(0.02, 20.0, default=None)
    """Depth, width and height; the default of the kind when left out."""
    colour: tuple[int, int, int] | None = ranged(0, 255, default=None)
    """Colour: red, green, blue; the default of the kind when left out."""

    def solids(self) -> tuple[Solid, ...]:
        """Return the solids in the frame of the piece."""
        size, colour = (
            self.size_m or FURNITURE_SIZES[self.kind],
            self.colour or FURNITURE_COLOURS[self.kind],
        )
        return furniture_solids(self.kind, size, colour)


@dataclass(frozen=True, slots=True, kw_only=True)
class Marking:
    """A painted area of the floor, or a spill on it, without height."""

    name: str
    """Name in reports."""
    polygon: tuple[tuple[float, float], ...] = ranged(-FARTHEST_M, FARTHEST_M)
    """Corners in metres, three or more, in either sense."""
    surface: Surface = "paint"
    """Surface; all but paint are glossy and let the floor colour show through."""
    pattern: PaintPattern | None = None
    """Pattern of paint; a plain area when left out."""
    colour: tuple[int, int, int] | None = ranged(0, 255, default=None)
    """Colour: red, green, blue; the default of the pattern or surface when left out."""
    beware: bool = True
    """Whether the robot must stay off the marking."""

    @property
    def beware_class(self) -> str:
        """Class in the beware list: that of the pattern; plain paint is a red floor, whatever its
        colour, and all else a spill."""
        if self.pattern is not None:
            return PATTERN_CLASSES[self.pattern]
        return "red floor" if self.surface == "paint" else "spill"

    def paint(self) -> Colour:
        """Return the colour of the paint or liquid itself, the main one of a pattern."""
        default = SURFACE_COLOURS[self.surface]
        return self.colour or PATTERN_COLOURS.get(self.pattern or "", default)

    def seen_on(self, floor: Colour) -> Colour:
        """Return the colour seen on a floor."""
        share = SHEEN_SHARE[self.surface]
        red, green, blue = (
            round((1 - share) * own + share * below)
            for own, below in zip(self.paint(), floor, strict=True)
        )
        return red, green, blue


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """An item on the floor; the robot must not touch it."""

    kind: ItemKind
    """Kind of item."""
    at: tuple[float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Position of the middle, x and y in metres."""
    yaw_deg: float = ranged(-360.0, 360.0, default=0.0)
    """Rotation, counter-clockwise."""
    shape: str = ""
    """Shape of its kind; the default one when left out."""
    size_m: tuple[float, float, float] | None = ranged(0.004, 3.0, default=None)
    """Length, width and height of the upright item; the default of the kind when left out."""
    colour: tuple[int, int, int] | None = ranged(0, 255, default=None)
    """Colour: red, green, blue; the default of the kind when left out."""

    def solids(self) -> tuple[Solid, ...]:
        """Return the solids in the frame of the item."""
        shape = self.shape or item_shapes(self.kind)[0]
        return item_solids(self.kind, self._size(), self.colour or ITEM_COLOURS[self.kind], shape)

    def extent_m(self) -> Size:
        """Return the bounding box of the item as it lies, along x, y and z."""
        return item_extent(self.kind, self._size(), self.shape)

    def _size(self) -> Size:
        return self.size_m or ITEM_SIZES[self.kind]


@dataclass(frozen=True, slots=True, kw_only=True)
class Print:
    """A printed image of an item, flat on the floor or on a wall: neither an obstacle nor a beware
    object."""

    shows: ItemKind
    """Kind of item that is drawn on it."""
    at: tuple[float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Position of the middle, x and y in metres; on a wall half the thickness of the wall and a
    centimetre off its line."""
    yaw_deg: float = ranged(-360.0, 360.0, default=0.0)
    """Rotation on the floor, counter-clockwise; on a wall the direction that it faces."""
    size_m: tuple[float, float] = ranged(0.05, 5.0, default=(0.3, 0.3))
    """Width and height."""
    on: Literal["floor", "wall"] = "floor"
    """Surface that carries the print."""
    height_m: float = ranged(0.0, 5.0, default=1.2)
    """Height of the middle on a wall."""

    def turn(self) -> list[float]:
        """Return the quaternion x, y, z, w of the print in the map frame: its x to the right, y
        upwards, z towards the observer."""
        yaw_rad = math.radians(self.yaw_deg)
        return quaternion(yaw_rad) if self.on == "floor" else facing_quaternion(yaw_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """A person who stands, or walks back and forth along a polyline."""

    points: tuple[tuple[float, float], ...] = ranged(-FARTHEST_M, FARTHEST_M)
    """One point to stand on, or two and more to walk along and back."""
    yaw_deg: float = ranged(-360.0, 360.0, default=0.0)
    """Direction that a standing person faces."""
    speed_mps: float = ranged(0.0, 3.0, default=0.8)
    """Walking speed of the person."""
    yields: bool = True
    """Whether a walker waits, or turns back, when the robot is right in front."""
    begins_at: float | None = ranged(0.0, 1.0, default=None)
    """Share of the line at which a walker begins, towards its end; position and direction come from
    the seed when left out."""
    pauses_s: tuple[float, ...] = ranged(0.0, 3600.0, default=())
    """Pause of a walker at each point before walking on; no pauses when left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mover:
    """A cylinder that moves by a timetable and never yields."""

    keys: tuple[tuple[float, float, float], ...] = ranged(-86_400.0, 86_400.0)
    """Timetable: seconds, x and y in metres, with straight motion in between. In order of time, one
    or more."""
    period_s: float = ranged(0.1, 86_400.0)
    """Period after which the motion repeats from its beginning."""
    radius_m: float = ranged(0.02, 5.0, default=0.5)
    """Radius of the cylinder."""
    height_m: float = ranged(0.1, 5.0, default=1.5)
    """Height above the floor."""
    colour: tuple[int, int, int] = ranged(0, 255, default=(120, 120, 125))
    """Colour: red, green, blue."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A world, the start pose of the robot, and the mission S → G1 → G2 → …"""

    name: str
    """Name in reports."""
    size_m: tuple[float, float] = ranged(1.0, 2 * FARTHEST_M)
    """Sides of the floor along x and y; centred on the origin."""
    map: MapExtent
    """Extent of the map of navigation."""
    start: tuple[float, float, float] = ranged(-FARTHEST_M, FARTHEST_M)
    """Start of the robot: x and y in metres, yaw in radians."""
    goals: tuple[tuple[float, float], ...] = ranged(-FARTHEST_M, FARTHEST_M, default=())
    """Goals of the mission in order, x and y in metres."""
    floor_colour: tuple[int, int, int] = ranged(0, 255, default=FLOOR_COLOUR)
    """Colour of the floor: red, green, blue."""
    floor_pattern: Pattern = "plain"
    """Pattern that multiplies the colour of the floor."""
    relief: Relief | None = None
    """Relief of the ground; flat when left out."""
    raised: tuple[RaisedGround, ...] = field(default=())
    """Raised parts of a floor without relief: ramps, platforms, kerbs, stairs, gravel."""
    lighting: Lighting = PLAIN
    """Light beyond daylight, and settings of the colour camera; nothing when left out."""
    walls: tuple[Wall, ...] = field(default=())
    """Walls of the world."""
    furniture: tuple[Furniture, ...] = field(default=())
    """Furniture and all other standing objects."""
    markings: tuple[Marking, ...] = field(default=())
    """Markings and spills on the floor."""
    items: tuple[Item, ...] = field(default=())
    """Items on the floor."""
    prints: tuple[Print, ...] = field(default=())
    """Prints on floor and walls."""
    tags: tuple[Tag, ...] = field(default=())
    """AprilTags."""
    people: tuple[Person, ...] = field(default=())
    """People who stand or walk."""
    movers: tuple[Mover, ...] = field(default=())
    """Cylinders that move by a timetable."""
    gnss: Gnss | None = None
    """GNSS receiver of the robot; none when left out."""
    faults: tuple[Fault, ...] = field(default=())
    """Faults of sensors, wheels and software."""
    rooms: tuple[Room, ...] = field(default=())
    """Rooms that each seed furnishes, in addition to the furniture of the file."""
    scatter: tuple[Scatter, ...] = field(default=())
    """Groups of objects that each seed scatters, one after the other, in addition to the furniture
    and items of the file."""
    beware_off: tuple[str, ...] = ()
    """Classes of the shipped beware list that are off when the robot first comes to this world,
    because there are none in it."""

    @property
    def start_pose(self) -> Pose2:
        """T_map_base at the start."""
        x, y, yaw = self.start
        return Pose2(x_m=x, y_m=y, yaw_rad=yaw)


def map_grid(scenario: Scenario) -> GridSpec:
    """Return the map grid of a world."""
    return GridSpec.centred(size_m=scenario.map.size_m, resolution_m=scenario.map.resolution_m)
