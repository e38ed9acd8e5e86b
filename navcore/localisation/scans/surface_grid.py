"""Surfaces of a scan map in cells: kernels that add, remove and find them.

A cell has one surface for each quarter of the directions that a surface may face: the two faces of
a thin wall are two surfaces. A surface is a sum of scan points, so that a scan can be removed
again, and its position is their weighted mean, far more exact than the cell is wide.

Cells are in tiles that are made where a scan shows something; a directory over the bounding box of
all tiles, which grows with it, gives the number of a tile.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined, nested
from navcore.geometry.arrays import Floats, Indices

TILE = 16
"""Edge of a tile in cells."""
SECTORS = 4
"""Number of directions that surfaces of a cell are told apart by."""
WEIGHT, X, Y, FACING_X, FACING_Y, HITS, LINES = range(7)
"""Columns of the sums: weight in 1/m², weighted position in map metres, facing directions, number
of points, number of them with a normal."""
SUMS = 7
"""Number of columns."""
ERRORS = 6
"""Number of different elements of a covariance of x, y and yaw: xx, xy, yy, x yaw, y yaw, yaw."""
Tiles = npt.NDArray[np.int32]
"""Numbers of tiles, or of surfaces within them; −1 for none."""


class SurfaceGrid(NamedTuple):
    """Surfaces as compiled kernels take them."""

    cell_m: float
    """Edge of a cell in metres."""
    row0: int
    """Row of the first tile of the directory, in tiles from the map's origin."""
    col0: int
    """Column of the first tile of the directory."""
    directory: Tiles
    """(R, C) number of each tile, −1 where there is none."""
    heads: Tiles
    """(T, TILE, TILE, SECTORS) number of each surface, −1 for none."""
    sums: Floats
    """(S, SUMS) sums of the surfaces."""
    errors: Floats
    """(S, ERRORS) sums of how uncertain the keyframes are whose points they are, by the weight of
    each point: the covariance of an error that moves a whole keyframe, about the map's origin."""


@inlined
def sector_of(fx: float, fy: float) -> int:
    """Return the number of the quarter that a direction lies in; the axes are in their middles."""
    if abs(fx) >= abs(fy):
        return 0 if fx > 0 else 2
    return 1 if fy > 0 else 3


@inlined
def forms_line(sums: Floats) -> bool:
    """Return whether a surface is matched across a line: a wall, whose far points are too noisy to
    show one, and not a leg or a post."""
    return bool(4.0 * sums[LINES] >= sums[HITS])


@inlined
def tile_at(grid: SurfaceGrid, row: int, col: int) -> int:
    """Return the number of the tile of a cell, −1 if there is none."""
    i, j = row // TILE - grid.row0, col // TILE - grid.col0
    if i < 0 or j < 0 or i >= grid.directory.shape[0] or j >= grid.directory.shape[1]:
        return -1
    return int(grid.directory[i, j])


@compiled
def add_points(
    grid: SurfaceGrid, points: Floats, facings: Floats, lines: Indices, weights: Floats,
    error: Floats, used: Indices, sign: float,
) -> None:  # fmt: skip
    """Add (sign 1) or remove (−1) points of the map frame, of a keyframe with (ERRORS,) `error`.

    `used` is (2,) the number of tiles and of surfaces in use; directory and arrays must have the
    capacity for what may come.
    """
    for k in range(len(points)):
        row = math.floor(points[k, 1] / grid.cell_m)
        col = math.floor(points[k, 0] / grid.cell_m)
        i, j = row // TILE - grid.row0, col // TILE - grid.col0
        tile = grid.directory[i, j]
        if tile < 0:
            tile = used[0]
            grid.directory[i, j] = tile
            used[0] += 1
        sector = sector_of(facings[k, 0], facings[k, 1])
        surface = grid.heads[tile, row % TILE, col % TILE, sector]
        if surface < 0:
            surface = used[1]
            grid.heads[tile, row % TILE, col % TILE, sector] = surface
            used[1] += 1
        sums = grid.sums[surface]
        weight = sign * weights[k]
        sums[WEIGHT] += weight
        sums[X] += weight * points[k, 0]
        sums[Y] += weight * points[k, 1]
        sums[FACING_X] += sign * facings[k, 0]
        sums[FACING_Y] += sign * facings[k, 1]
        sums[HITS] += sign
        sums[LINES] += sign * lines[k]
        for i in range(ERRORS):
            grid.errors[surface, i] += weight * error[i]
        if sums[HITS] < 0.5:  # no rounding errors remain of what was removed
            sums[:] = 0.0
            grid.errors[surface] = 0.0


@nested
def nearest_surface(
    grid: SurfaceGrid,
    x: float,
    y: float,
    view: tuple[float, float],
    normal: tuple[float, float],
    radius_m: float,
    min_hits: int,
) -> int:
    """Return the number of the nearest surface that faces the viewer, −1 if there is none.

    `view` is the unit vector from the point to the camera, `normal` that of the scan's line or
    (0, 0): a surface with a line must then face alike, and any other have been seen from the same
    side of that line, or the far end of the other side of a wall would count as near.
    """
    row, col = math.floor(y / grid.cell_m), math.floor(x / grid.cell_m)
    best, best_d2 = -1, radius_m * radius_m
    reach = math.ceil(radius_m / grid.cell_m)
    for ring in range(reach + 1):
        if best >= 0:
            clear = (ring - 1) * grid.cell_m
            if clear > 0 and clear * clear > best_d2:
                break
        for dr in range(-ring, ring + 1):
            step = 1 if abs(dr) == ring else 2 * ring
            for dc in range(-ring, ring + 1, max(step, 1)):
                tile = tile_at(grid, row + dr, col + dc)
                if tile < 0:
                    continue
                heads = grid.heads[tile, (row + dr) % TILE, (col + dc) % TILE]
                for sector in range(SECTORS):
                    surface = heads[sector]
                    if surface < 0:
                        continue
                    sums = grid.sums[surface]
                    if sums[HITS] < min_hits:
                        continue
                    length = math.hypot(sums[FACING_X], sums[FACING_Y])
                    facing = sums[FACING_X] * view[0] + sums[FACING_Y] * view[1]
                    if facing < 0.05 * length:
                        continue
                    alike = sums[FACING_X] * normal[0] + sums[FACING_Y] * normal[1]
                    least = 0.5 * length if forms_line(sums) else 0.0
                    if (normal[0] != 0.0 or normal[1] != 0.0) and alike < least:
                        continue
                    dx, dy = sums[X] / sums[WEIGHT] - x, sums[Y] / sums[WEIGHT] - y
                    d2 = dx * dx + dy * dy
                    if d2 < best_d2:
                        best, best_d2 = surface, d2
    return best


@compiled
def mean_error(
    grid: SurfaceGrid, pose: tuple[float, float, float], points: Floats, normals: Floats,
    variance: Floats, origin: Floats, radius_m: float, min_hits: int,
) -> tuple[Floats, float]:  # fmt: skip
    """Return the (ERRORS,) mean error of the surfaces that a scan shows at a pose, by the weight of
    its points, and the sum of these weights, 0 where it shows none.

    The pose that a match gives errs by a mean of the errors of its surfaces, whose covariance is at
    most the mean of theirs, however they depend on each other.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    found, total = np.zeros(ERRORS), 0.0
    for k in range(len(points)):
        rx = cos * points[k, 0] - sin * points[k, 1]
        ry = sin * points[k, 0] + cos * points[k, 1]
        vx = cos * (origin[0] - points[k, 0]) - sin * (origin[1] - points[k, 1])
        vy = sin * (origin[0] - points[k, 0]) + cos * (origin[1] - points[k, 1])
        distance = max(math.hypot(vx, vy), 1e-6)
        nx = cos * normals[k, 0] - sin * normals[k, 1]
        ny = sin * normals[k, 0] + cos * normals[k, 1]
        surface = nearest_surface(
            grid,
            pose[0] + rx,
            pose[1] + ry,
            (vx / distance, vy / distance),
            (nx, ny),
            radius_m,
            min_hits,
        )
        if surface >= 0:
            weight = 1.0 / variance[k]
            found += weight * grid.errors[surface] / grid.sums[surface, WEIGHT]
            total += weight
    return found / max(total, 1e-12), total


@compiled
def blocked_share(
    grid: SurfaceGrid, pose: tuple[float, float, float], points: Floats, origin: Floats,
    free_m: float, min_hits: int,
) -> float:  # fmt: skip
    """Return the share of lines of sight that a surface of the map would have ended more than
    `free_m` before the point that was seen."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    ox = pose[0] + cos * origin[0] - sin * origin[1]
    oy = pose[1] + sin * origin[0] + cos * origin[1]
    blocked = 0
    for k in range(len(points)):
        px = pose[0] + cos * points[k, 0] - sin * points[k, 1]
        py = pose[1] + sin * points[k, 0] + cos * points[k, 1]
        length = math.hypot(px - ox, py - oy)
        if length < 1e-6:
            continue
        ux, uy = (px - ox) / length, (py - oy) / length
        along = 0.3
        hit = False
        while along < length - free_m and not hit:
            x, y = ox + along * ux, oy + along * uy
            row, col = math.floor(y / grid.cell_m), math.floor(x / grid.cell_m)
            tile = tile_at(grid, row, col)
            if tile >= 0:
                for sector in range(SECTORS):
                    surface = grid.heads[tile, row % TILE, col % TILE, sector]
                    if surface < 0:
                        continue
                    sums = grid.sums[surface]
                    if sums[HITS] < min_hits or not forms_line(sums):
                        continue
                    length_f = math.hypot(sums[FACING_X], sums[FACING_Y])
                    if -(sums[FACING_X] * ux + sums[FACING_Y] * uy) > 0.5 * length_f:
                        hit = True
            along += grid.cell_m
        if hit:
            blocked += 1
    return blocked / max(len(points), 1)
