"""Answers of the routes of the map and of the path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pydantic import BaseModel, ConfigDict

from navcore.grid.grid import GridSpec
from web.interface.wire import DOCUMENTED, Position, served
from web.schemas.zones import ZoneOut


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class MapOut(GridSpec):
    """Position and size of the map, and size of the robot."""

    frame: Literal["map"] = "map"
    """Frame of the coordinates."""
    version: int
    """Version of the cells."""
    robot_length_m: float
    """Length of the robot in metres."""
    robot_width_m: float
    """Width of the robot in metres."""


class CameraLabelOut(BaseModel):
    """Object of the beware list in the camera image."""

    model_config = DOCUMENTED

    name: str
    """Name of its class."""
    class_id: int
    """Id of its class in the beware list."""
    confidence: float
    """Mean confidence of its pixels, 0 to 1."""
    box: tuple[float, float, float, float]
    """Left, top, right and bottom edge as shares of the image's width and height."""


class CameraLabelsOut(BaseModel):
    """Objects of the beware list in the camera image of a tick."""

    model_config = DOCUMENTED

    serial: int
    """Serial number of the tick."""
    labels: list[CameraLabelOut]
    """Objects, by class."""


class PersonOut(BaseModel):
    """Tracked person."""

    model_config = DOCUMENTED | ConfigDict(from_attributes=True)

    id: int
    """Number of the person, constant while the person is tracked."""
    x_m: float
    """x in metres of the map frame."""
    y_m: float
    """y in metres of the map frame."""
    vx_mps: float
    """Velocity along x in metres per second."""
    vy_mps: float
    """Velocity along y in metres per second."""
    radius_m: float
    """Radius of the disc that the person covers, metres."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class TilesOut(MapOut):
    """Changed tiles of the map, with its position and size in the same tick."""

    version: int
    """Version of this answer; the next `since`."""
    tile_cells: int
    """Side of a tile in cells; tiles at the upper and right border may be smaller."""
    changed: list[tuple[int, int, int]]
    """Row and column of each changed tile, and the version of its change."""


class PathOut(BaseModel):
    """Planned path, driven path and moving objects, in metres of the map frame."""

    model_config = DOCUMENTED

    serial: int
    """Serial number of the tick."""
    path: list[Position]
    """Points (x, y) of the planned path."""
    unseen: list[list[Position]]
    """Points (x, y) of each part of the planned path over floor that was not seen yet."""
    waypoints: list[Position]
    """Corners and end of the planned path."""
    driven: list[Position]
    """Past positions of the robot."""
    people: list[PersonOut]
    """Tracked people."""
    closed: list[ZoneOut]
    """Areas that the robot keeps out of for a while by its own decision; the names say why."""
    view: list[Position]
    """Corners of the floor in view of the camera."""
