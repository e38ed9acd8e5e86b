"""Solids that things are made of: boxes, cylinders, cones and balls with a colour, placed in the
frame of their thing."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Pose2

Pattern = Literal["plain", "tiles", "carpet", "grass", "bark", "leaves", "brick", "thatch"]
"""What the colour of a surface is multiplied with, see `sim.textures`."""
Colour = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""
Polygon = npt.NDArray[np.float64]
"""(N, 2) corners x, y, counter-clockwise."""

ROUND_CORNERS = 12
"""A cylinder's outline on the floor is a polygon of so many corners."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solid:
    """A box, or something round about its own z axis: a cylinder, a cone without its tip, a ball."""

    kind: Literal["box", "cylinder", "cone", "ball"]
    """Its form; a cone narrows upwards to 40 % of its diameter."""
    size_m: tuple[float, float, float]
    """Along x, y and z, before it is turned; what is round has its diameter along x and along y."""
    centre_m: tuple[float, float, float]
    """In the frame of its thing: origin on the floor, z up."""
    colour: Colour
    """Of all its sides."""
    yaw_rad: float = 0.0
    """Turn about z in the frame of its thing."""
    pitch_rad: float = 0.0
    """Turn about its own y before that; by a quarter turn it lies along x."""
    pattern: Pattern = "plain"
    """Of all its sides, where it is part of what stands fixed."""

    @property
    def extent_m(self) -> tuple[float, float, float]:
        """Sides of the upright box around it, along x, y and z before its yaw."""
        (x, y, z), cos, sin = (
            self.size_m,
            abs(math.cos(self.pitch_rad)),
            abs(math.sin(self.pitch_rad)),
        )
        return x * cos + z * sin, y, x * sin + z * cos

    @property
    def bottom_m(self) -> float:
        """Height of its underside."""
        return self.centre_m[2] - self.extent_m[2] / 2

    def outline(self) -> Polygon:
        """(N, 2) convex outline on the floor, in the frame of its thing."""
        upright_and_round = self.kind != "box" and self.pitch_rad == 0.0
        corners = (
            _round_outline(self.size_m[0] / 2)
            if upright_and_round
            else rectangle(*self.extent_m[:2])
        )
        return placed(
            corners, Pose2(x_m=self.centre_m[0], y_m=self.centre_m[1], yaw_rad=self.yaw_rad)
        )


def box(
    size_m: tuple[float, float, float],
    at_m: tuple[float, float],
    colour: Colour,
    *,
    bottom_m: float = 0.0,
) -> Solid:
    """A box that stands on `bottom_m`."""
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
    """An upright cylinder that stands on `bottom_m`."""
    size_m = (diameter_m, diameter_m, height_m)
    return Solid(
        kind="cylinder", size_m=size_m, centre_m=(*at_m, bottom_m + height_m / 2), colour=colour
    )


def laid(solids: tuple[Solid, ...], height_m: float, diameter_m: float) -> tuple[Solid, ...]:
    """An upright thing of this height and diameter, laid down along x; its solids must be without
    turns."""
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
    """(4, 2) corners of a rectangle about the origin, counter-clockwise."""
    x, y = length_m / 2, width_m / 2
    return np.array([[x, y], [-x, y], [-x, -y], [x, -y]])


def quaternion(yaw_rad: float, pitch_rad: float = 0.0) -> list[float]:
    """x, y, z, w of a turn about y and then about z."""
    (sin, cos), (sin_pitch, cos_pitch) = (
        (math.sin(angle / 2), math.cos(angle / 2)) for angle in (yaw_rad, pitch_rad)
    )
    return [-sin * sin_pitch, cos * sin_pitch, sin * cos_pitch, cos * cos_pitch]


def facing(yaw_rad: float) -> list[float]:
    """x, y, z, w of a picture that hangs upright and faces `yaw_rad`: its x to the right, y
    upwards, z towards who looks."""
    sin, cos = math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)
    return [(cos - sin) / 2, (cos + sin) / 2, (cos + sin) / 2, (cos - sin) / 2]


def placed(polygon: Polygon, pose: Pose2) -> Polygon:
    """The polygon of a body's frame in the frame that its pose is given in."""
    return pose.to_parent(polygon)


def _round_outline(radius_m: float) -> Polygon:
    """Around the circle, never inside it: what is clear of the outline is clear of the cylinder."""
    angles = np.arange(ROUND_CORNERS) * 2 * math.pi / ROUND_CORNERS
    reach = radius_m / math.cos(math.pi / ROUND_CORNERS)
    return reach * np.column_stack([np.cos(angles), np.sin(angles)])
