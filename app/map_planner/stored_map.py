"""A stored map to plan on, of any format: cells, and the conversion from its coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadConfiguration
from navcore.formats import moving_ai, nav2_map
from navcore.grid.grid import BoolGrid, Cell, GridSpec, inflate, inflation_radius
from navcore.robot.profile import HUSKY

MAX_RADIUS_CELLS = 200
"""Largest inflation radius; a larger one is a wrong unit."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanMap:
    """Occupied and blocked cells in the coordinates of the map's own format."""

    name: str
    """Name of the file."""
    unit: str
    """Unit of points: `m` (Nav2) or `cells` (MovingAI: x = column, y = row, whole numbers)."""
    spec: GridSpec
    """Geometry of the grid in that unit; a MovingAI cell has its centre at (column, row)."""
    occupied: BoolGrid
    """(rows, cols) occupied cells."""
    unknown: BoolGrid
    """(rows, cols) unknown cells; free to plan through unless they are closed."""
    closed: BoolGrid
    """(rows, cols) occupied cells, and unknown ones if those count as blocked."""
    blocked: BoolGrid
    """(rows, cols) inflated closed cells: where the robot's centre may not be."""
    width: float
    """Width of the robot, in `unit`."""
    margin: float
    """Safety margin beyond half the width, in `unit`."""
    radius: int
    """Inflation radius, cells."""

    def cell(self, point: tuple[float, float]) -> Cell:
        """Return the cell (row, col) of a point; may lie outside the map."""
        return self.spec.cell(*point)

    def refusal(self, what: str, point: tuple[float, float]) -> str | None:
        """Return why the robot's centre may not be at a point; None if it may."""
        cell, position = self.cell(point), f"the {what} ({point[0]:g}, {point[1]:g})"
        if not self.spec.contains(*point):
            return f"{position} is outside the map, {self._extent()}"
        if self.occupied[cell]:
            return f"{position} lies in an obstacle"
        if self.closed[cell]:
            return f"{position} lies where the map is unknown, and unknown cells are blocked"
        if self.blocked[cell]:
            size = f"width {self.width:g} {self.unit} and margin {self.margin:g} {self.unit}"
            return f"{position} is too close to an obstacle for {size}"
        return None

    def _extent(self) -> str:
        if self.unit == "cells":
            return f"x 0 to {self.spec.cols - 1}, y 0 to {self.spec.rows - 1}"
        return self.spec.extent()


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the files that a map is read from."""
    return (path,) if path.suffix == ".map" else (path, nav2_map.image_of(path))


def open_map(
    path: Path, *, width: float | None, margin: float | None, unknown_blocked: bool
) -> PlanMap:
    """Read a Nav2 YAML or a MovingAI map and inflate it; raises `BadConfiguration`.

    Width and margin default to the Husky's width and the navigator's margin on a Nav2 map, and to
    0 on a MovingAI map.
    """
    if path.suffix in (".yaml", ".yml"):
        source = nav2_map.load(path)
        states = source.states()
        spec, unit = source.spec, "m"
        occupied, unknown = (
            np.equal(states, nav2_map.State.OCCUPIED),
            np.equal(states, nav2_map.State.UNKNOWN),
        )
        width = HUSKY.width_m if width is None else width
        margin = NavigatorConfig().safety_margin_m if margin is None else margin
    elif path.suffix == ".map":
        occupied = moving_ai.load_map(path)
        unknown, unit = np.zeros_like(occupied), "cells"
        spec = GridSpec(
            resolution_m=1.0,
            rows=occupied.shape[0],
            cols=occupied.shape[1],
            origin_x_m=-0.5,
            origin_y_m=-0.5,
        )
        width, margin = width or 0.0, margin or 0.0
    else:
        raise BadConfiguration(
            f"--map {path}: expected a Nav2 map (.yaml) or a MovingAI map (.map)"
        )
    closed = occupied | unknown if unknown_blocked else occupied
    radius = _radius(width, margin, spec)
    return PlanMap(
        name=str(path),
        unit=unit,
        spec=spec,
        occupied=occupied,
        unknown=unknown,
        closed=closed,
        blocked=inflate(closed, radius) if radius > 0 else closed,
        width=width,
        margin=margin,
        radius=radius,
    )


def _radius(width: float, margin: float, spec: GridSpec) -> int:
    for name, value in (("--width", width), ("--margin", margin)):
        if not 0 <= value <= 1e6:
            raise BadConfiguration(f"{name} {value:g}: out of range, allowed 0 to 1000000")
    radius = inflation_radius(
        vehicle_width_m=width, safety_margin_m=margin, resolution_m=spec.resolution_m
    )
    if radius > MAX_RADIUS_CELLS:
        raise BadConfiguration(
            f"--width {width:g} and --margin {margin:g} inflate by {radius} cells, "
            f"at most {MAX_RADIUS_CELLS} are allowed; is the unit right?"
        )
    return radius
