"""Solids that objects are made of: boxes, cylinders, cones and balls with a colour, placed in the
frame of their object."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Pose2

Pattern = Literal["plain", "tiles", "carpet", "grass", "bark", "leaves", "brick", "thatch"]
"""Pattern that multiplies the colour of a surface, see `sim.models.surface_patterns`."""
Colour = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""
Size = tuple[float, float, float]
"""Depth along x, width along y and height, in metres; round solids have their diameter as depth."""
Polygon = npt.NDArray[np.float64]
"""(N, 2) corners x, y, counter-clockwise."""

FARTHEST_M = 100.0
"""Largest coordinate of a world along x and y."""
ROUND_CORNERS = 12
"""Number of corners of the outline of a cylinder on the floor."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solid:
    """A box, or a solid of revolution about its own z axis: cylinder, truncated cone or ball."""

    kind: Literal["box", "cylinder", "cone", "ball"]
    """Form of the solid; a cone narrows upwards to 40 % of its diameter."""
    size_m: tuple[float, float, float]
    """Size along x, y and z before rotation; round solids have their diameter along x and y."""
    centre_m: tuple[float, float, float]
    """Centre in the frame of its object: origin on the floor, z up."""
    colour: Colour
    """Colour of all sides."""
    yaw_rad: float = 0.0
    """Rotation about z in the frame of its object."""
    pitch_rad: float = 0.0
    """Rotation about its own y before the yaw; a quarter turn lays the solid along x."""
    pattern: Pattern = "plain"
    """Pattern of all sides, shown only on static objects."""

    @property
    def extent_m(self) -> tuple[float, float, float]:
        """Size of the upright bounding box, along x, y and z before the yaw."""
        (x, y, z), cos, sin = (
            self.size_m,
            abs(math.cos(self.pitch_rad)),
            abs(math.sin(self.pitch_rad)),
        )
        return x * cos + z * sin, y, x * sin + z * cos

    @property
    def bottom_m(self) -> float:
        """Height of the underside."""
        return self.centre_m[2] - self.extent_m[2] / 2

    def outline(self) -> Polygon:
        """Return the (N, 2) convex outline on the floor, in the frame of its object."""
        upright_and_round = self.kind != "box" and self.pitch_rad == 0.0
        corners = (
            _round_outline(self.size_m[0] / 2)
            if upright_and_round
            else rectangle(*self.extent_m[:2])
        )
        pose = Pose2(x_m=self.centre_m[0], y_m=self.centre_m[1], yaw_rad=self.yaw_rad)
        return pose.to_parent(corners)


def box(
    size_m: tuple[float, float, float],
    at_m: tuple[float, float],
    colour: Colour,
    *,
    bottom_m: float = 0.0,
) -> Solid:
    """Return a box that stands on `bottom_m`."""
    return Solid(
        kind="box", size_m=size_m, centre_m=(*at_m, bottom_m + size_m[2] / 2), colour=colour
    )


def cylinder(
    diameter_m: float,
    height_m: float,
    at_m: tuple[float, float],
    colour: Colour,
    *,
    bottom_m: float = 0.0,
) -> Solid:
    """Return an upright cylinder that stands on `bottom_m`."""
    size_m = (diameter_m, diameter_m, height_m)
    return Solid(
        kind="cylinder", size_m=size_m, centre_m=(*at_m, bottom_m + height_m / 2), colour=colour
    )


def lay_down(solids: tuple[Solid, ...], height_m: float, diameter_m: float) -> tuple[Solid, ...]:
    """Return an upright object of this height and diameter laid down along x; its solids must have
    no rotation."""
    return tuple(
        replace(
            solid,
            centre_m=(
                solid.centre_m[2] - height_m / 2,
                solid.centre_m[1],
                diameter_m / 2 - solid.centre_m[0],
            ),
            pitch_rad=math.pi / 2,
        )
        for solid in solids
    )


def rectangle(length_m: float, width_m: float) -> Polygon:
    """Return the (4, 2) corners of a rectangle about the origin, counter-clockwise."""
    x, y = length_m / 2, width_m / 2
    return np.array([[x, y], [-x, y], [-x, -y], [x, -y]])


def quaternion(yaw_rad: float, pitch_rad: float = 0.0) -> list[float]:
    """Return the quaternion x, y, z, w of a rotation about y and then about z."""
    (sin, cos), (sin_pitch, cos_pitch) = (
        (math.sin(angle / 2), math.cos(angle / 2)) for angle in (yaw_rad, pitch_rad)
    )
    return [-sin * sin_pitch, cos * sin_pitch, sin * cos_pitch, cos * cos_pitch]


def facing_quaternion(yaw_rad: float) -> list[float]:
    """Return the quaternion x, y, z, w of a poster that hangs upright and faces `yaw_rad`: its x to
    the right, y upwards, z towards the observer."""
    sin, cos = math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)
    return [(cos - sin) / 2, (cos + sin) / 2, (cos + sin) / 2, (cos - sin) / 2]


def _round_outline(radius_m: float) -> Polygon:
    """Return a polygon around the circle, never inside it: a clearance from the outline is one from
    the cylinder."""
    angles = np.arange(ROUND_CORNERS) * 2 * math.pi / ROUND_CORNERS
    reach = radius_m / math.cos(math.pi / ROUND_CORNERS)
    return reach * np.column_stack([np.cos(angles), np.sin(angles)])
