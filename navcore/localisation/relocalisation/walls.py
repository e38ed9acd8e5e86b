"""Walls of a map: surfaces that lines of sight do not cross."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, nested
from navcore.geometry.arrays import Floats, Indices, Points
from navcore.localisation.relocalisation.search_tables import TILE, TILE_BITS, Lattice, TileNumbers

SIGHT_MARGIN_M = 0.35
"""Length in metres at both ends of the map's own lines of sight within which they cross nothing."""
PER_CELL = 2
"""Largest number of walls in a cell."""


class Walls(NamedTuple):
    """Surfaces with a normal by the cell of the lattice in which they lie, as compiled kernels take
    them."""

    numbers: TileNumbers
    """(tile rows, tile columns) number of the tile of each part; 0 for one without a wall."""
    tiles: npt.NDArray[np.int32]
    """(K, `TILE`, `TILE`, `PER_CELL`) surfaces in each cell by number, from 1 on; 0 for none."""
    surfaces: Points
    """(N, 2) positions of all surfaces in metres of the map."""
    normals: Points
    """(N, 2) unit normals of all surfaces; (0, 0) where unknown."""


def walls_of(surfaces: Points, normals: Points, lattice: Lattice, shape: tuple[int, int]) -> Walls:
    """Return the walls among (N, 2) surfaces in metres with (N, 2) normals, (0, 0) where unknown,
    which lie on (rows, cols) cells of a lattice."""
    numbers = np.zeros((-(-shape[0] // TILE), -(-shape[1] // TILE)), dtype=np.int32)
    faces = surfaces[(normals != 0.0).any(axis=1)]
    col, row = ((faces - lattice[:2]) / lattice.cell_m).astype(np.int64).T >> TILE_BITS
    numbers[row, col] = 1
    held = np.flatnonzero(numbers)
    numbers.reshape(-1)[held] = np.arange(1, len(held) + 1)
    tiles = np.zeros((len(held) + 1, TILE, TILE, PER_CELL), dtype=np.int32)
    walls = Walls(numbers=numbers, tiles=tiles, surfaces=surfaces, normals=normals)
    _draw(walls, lattice)
    return walls


@compiled
def _draw(walls: Walls, lattice: Lattice) -> None:
    for i in range(len(walls.surfaces)):
        if walls.normals[i, 0] == 0.0 and walls.normals[i, 1] == 0.0:
            continue
        row = int((walls.surfaces[i, 1] - lattice.y_m) / lattice.cell_m)
        col = int((walls.surfaces[i, 0] - lattice.x_m) / lattice.cell_m)
        tile = walls.numbers[row >> TILE_BITS, col >> TILE_BITS]
        for k in range(PER_CELL):
            if walls.tiles[tile, row & (TILE - 1), col & (TILE - 1), k] == 0:
                walls.tiles[tile, row & (TILE - 1), col & (TILE - 1), k] = i + 1
                break


def remove_seen_through(walls: Walls, crossings: Indices, most: int) -> None:
    """Remove the walls that more than `most` lines of sight of the map itself cross; `crossings`:
    (N,) number of these lines for each surface."""
    seen_through = np.concatenate([[False], crossings > most])
    walls.tiles[seen_through[walls.tiles]] = 0


@compiled
def seen_through_walls(
    walls: Walls,
    lattice: Lattice,
    origins: Points,
    points: Points,
    start_m: float,
    end_m: float,
) -> int:
    """Return how many lines of sight from (N, 2) origins to (N, 2) points of the map cross a wall
    of the map, but for their beginning and their end."""
    uncounted = np.zeros(0, dtype=np.int64)
    crossing = 0
    for i in range(len(points)):
        if _cross(walls, lattice, origins[i], points[i], start_m, end_m, uncounted):
            crossing += 1
    return crossing


@compiled
def count_crossings(
    walls: Walls, lattice: Lattice, origin: Floats, points: Points, crossings: Indices
) -> None:
    """Count for each of (N,) surfaces the lines of sight of the map itself that cross it, which go
    from (x, y) to (M, 2) points in metres."""
    for i in range(len(points)):
        _cross(walls, lattice, origin, points[i], SIGHT_MARGIN_M, SIGHT_MARGIN_M, crossings)


@nested
def _cross(
    walls: Walls,
    lattice: Lattice,
    origin: Floats,
    point: Floats,
    start_m: float,
    end_m: float,
    crossings: Indices,
) -> bool:
    """Return whether a line of sight crosses a wall, and count it at every one that it crosses if
    `crossings` has all surfaces."""
    rows, cols = walls.numbers.shape[0] * TILE, walls.numbers.shape[1] * TILE
    dx, dy = point[0] - origin[0], point[1] - origin[1]
    length = math.hypot(dx, dy)
    if length <= start_m + end_m:
        return False
    dx, dy = dx / length, dy / length
    step = 0.5 * lattice.cell_m
    crossed = False
    last_row, last_col = -1, -1
    for k in range(int((length - start_m - end_m) / step) + 1):
        along = start_m + k * step
        row = int((origin[1] + along * dy - lattice.y_m) / lattice.cell_m)
        col = int((origin[0] + along * dx - lattice.x_m) / lattice.cell_m)
        if (row == last_row and col == last_col) or not (0 <= row < rows and 0 <= col < cols):
            continue
        last_row, last_col = row, col
        tile = walls.numbers[row >> TILE_BITS, col >> TILE_BITS]
        if tile == 0:
            continue
        for j in range(PER_CELL):
            number = walls.tiles[tile, row & (TILE - 1), col & (TILE - 1), j]
            if number == 0:
                continue
            wall, normal = walls.surfaces[number - 1], walls.normals[number - 1]
            across = normal[0] * dx + normal[1] * dy
            if abs(across) < 0.35:  # the line only brushes it
                continue
            x, y = wall[0] - origin[0], wall[1] - origin[1]
            at = (normal[0] * x + normal[1] * y) / across
            if start_m < at < length - end_m and abs(dx * y - dy * x) < step:
                crossed = True
                if len(crossings) == 0:
                    return True
                crossings[number - 1] += 1
    return crossed
