"""Place map: the surfaces of a kept map, prepared for relocalisation.

A likelihood for each cell and direction of the surface, its maxima over ever larger blocks (the
bounds of branch and bound, as in Hess, Kohler, Rapp, Andor 2016), and the surface in each cell.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from navcore.compiled import compiled
from navcore.config.localisation.relocalisation import PlaceSearchConfig
from navcore.geometry.arrays import Bools, Floats, Indices, Points
from navcore.localisation.relocalisation.clear_floor import clear_floor
from navcore.localisation.scans.scan import Keyframe

DIRECTIONS = 8
"""Directions of surface normals that are told apart; the last channel, beyond them, is for points
without a normal."""
FULL = 255
"""Likelihood of a point on its surface."""
CLEAR, UNKNOWN = 0, 1
"""Values of the tables where the map has seen that nothing stands, and where it knows nothing."""
LIKELY_SIGMAS = 3.0
"""Distance in standard deviations beyond which the likelihood is zero."""

SIGHT_MARGIN_M = 0.35
"""Length in metres at both ends of the map's own lines of sight within which they cross nothing."""
LINE_NEIGHBOURS = 8
"""Nearest surfaces that decide whether a surface is part of a line."""
LINE_M = 0.35
"""Distance in metres of the farthest of them."""
LEAST_LINE = 4
"""Smallest number of surfaces, itself included, that form a line."""

Bytes = npt.NDArray[np.uint8]


class Lattice(NamedTuple):
    """Cells of a place map, as compiled kernels take them."""

    x_m: float
    """x of the corner of cell (0, 0) in metres of the map."""
    y_m: float
    """y of the corner of cell (0, 0) in metres of the map."""
    cell_m: float
    """Edge of a cell in metres."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceMap:
    """Surfaces of a map and their search tables; make it with `place_map_of`, once for a map."""

    surfaces: Points
    """(N, 2) positions of the surfaces in metres of the map."""
    normals: Points
    """(N, 2) unit normals to the side they were seen from; (0, 0) where unknown."""
    lines: Points
    """(N, 2) unit normals of the line that a surface forms with its neighbours, of either sign;
    (0, 0) for legs, posts and corners."""
    lattice: Lattice
    """Cells of the tables."""
    bounds: Bytes
    """(levels + 1, directions + 1, rows, cols) largest value of the block of 2^level cells on each
    side that begins at the cell: `CLEAR`, `UNKNOWN`, or a likelihood up to `FULL`."""
    walls: Floats
    """(rows, cols, 2, 4) up to two surfaces with a normal in each cell: x, y and normal; zeros for
    none."""
    clear: Bools
    """(rows, cols) cells where the map has seen that nothing stands; none without its keyframes."""
    tree: cKDTree
    """Nearest surfaces."""

    def is_clear(self, points: Points) -> Bools:
        """Return which of (N, 2) points in metres of the map lie where it is clear."""
        corner = np.array(self.lattice[:2])
        cols, rows = np.floor((points - corner) / self.lattice.cell_m).astype(np.int64).T
        inside = (rows >= 0) & (rows < self.clear.shape[0])
        inside &= (cols >= 0) & (cols < self.clear.shape[1])
        return np.asarray(inside & self.clear[np.where(inside, rows, 0), np.where(inside, cols, 0)])

    @property
    def memory_mb(self) -> float:
        """Memory of the tables in megabytes."""
        return (self.bounds.nbytes + self.walls.nbytes + self.clear.nbytes) / 2**20


def place_map_of(
    surfaces: Points,
    normals: Points,
    config: PlaceSearchConfig,
    keyframes: Iterable[Keyframe] = (),
) -> PlaceMap:
    """Return the tables of a map's surfaces: (N, 2) positions in metres, and (N, 2) unit normals,
    (0, 0) where unknown. Takes about a second for 100 × 100 m.

    `keyframes`: those of the map. What their own lines of sight cross is a table or a gap and no
    wall, and floor that they cross is clear; without them every surface counts as a wall, and no
    floor as clear.
    """
    cell = config.cell_m
    # In one layout, whatever a file holds: another one would be compiled for while the robot waits.
    surfaces, normals = (
        np.array(given, dtype=np.float64, order="C") for given in (surfaces, normals)
    )
    margin = (2**config.levels + math.ceil(LIKELY_SIGMAS * config.sigma_m / cell)) * cell
    corners = surfaces if len(surfaces) else np.zeros((1, 2))
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    cols, rows = (math.ceil(span / cell) + 1 for span in high - low)
    lattice = Lattice(x_m=float(low[0]), y_m=float(low[1]), cell_m=cell)
    walls = np.zeros((rows, cols, 2, 4))
    origins: list[Points] = []
    ends: list[Points] = []
    _draw_walls(surfaces, normals, lattice, walls)
    for keyframe in keyframes:
        pose, scan = keyframe.T_map_base, keyframe.scan
        origins.append(np.broadcast_to(pose.to_parent(scan.origin), scan.points_base.shape))
        ends.append(pose.to_parent(scan.points_base))
    tree, clear = cKDTree(surfaces), np.zeros((rows, cols), dtype=np.bool_)
    if ends:
        sights = np.vstack(origins), np.vstack(ends)
        _remove_seen_through(walls, lattice, *sights, config.wall_crossings)
        clear = clear_floor(*sights, tree, lattice[:2], (rows, cols), config)
    bounds = np.empty((config.levels + 1, DIRECTIONS + 1, rows, cols), dtype=np.uint8)
    bounds[0] = np.where(clear, CLEAR, UNKNOWN)
    _draw(surfaces, normals, lattice, config.sigma_m, math.radians(config.facing_deg), bounds[0])
    for level in range(1, config.levels + 1):
        _double(bounds[level - 1], 2 ** (level - 1), bounds[level])
    for array in (bounds, walls, clear):
        array.flags.writeable = False
    return PlaceMap(
        surfaces=surfaces,
        normals=normals,
        lines=_lines_of(surfaces, normals, tree),
        lattice=lattice,
        bounds=bounds,
        walls=walls,
        clear=clear,
        tree=tree,
    )


def _lines_of(surfaces: Points, normals: Points, tree: cKDTree) -> Points:
    """Return the normals, completed by those of lines through neighbours: what is seen at a flat
    angle has no normal, and matched as a post it would hold the robot along a corridor."""
    lines = normals.copy()
    missing = np.flatnonzero(~(normals != 0.0).any(axis=1))
    if not len(missing):
        return lines
    away, index = tree.query(surfaces[missing], k=LINE_NEIGHBOURS, distance_upper_bound=LINE_M)
    near = np.isfinite(away)
    count = near.sum(axis=1)
    positions = surfaces[np.where(near, index, 0)]
    positions -= surfaces[missing][:, None]
    positions[~near] = 0.0
    positions -= (positions.sum(axis=1) / count[:, None])[:, None] * near[..., None]
    spread = np.einsum("nki,nkj->nij", positions, positions) / count[:, None, None]
    values, vectors = np.linalg.eigh(spread)
    is_line = (count >= LEAST_LINE) & (9.0 * values[:, 0] < values[:, 1])
    lines[missing[is_line]] = vectors[is_line, :, 0]
    return lines


@compiled
def _draw(
    surfaces: Points,
    normals: Points,
    lattice: Lattice,
    sigma_m: float,
    facing_rad: float,
    likelihood: Bytes,
) -> None:
    """Raise the likelihood of the cells around each surface, in the channels of the directions that
    may match it."""
    channels, rows, cols = likelihood.shape
    reach = math.ceil(LIKELY_SIGMAS * sigma_m / lattice.cell_m)
    bin_rad = 2.0 * math.pi / DIRECTIONS
    for i in range(len(surfaces)):
        x = (surfaces[i, 0] - lattice.x_m) / lattice.cell_m
        y = (surfaces[i, 1] - lattice.y_m) / lattice.cell_m
        has_normal = normals[i, 0] != 0.0 or normals[i, 1] != 0.0
        angle = math.atan2(normals[i, 1], normals[i, 0])
        for channel in range(channels):
            if has_normal and channel < DIRECTIONS:
                turn = abs(angle - channel * bin_rad + math.pi) % (2.0 * math.pi) - math.pi
                if abs(turn) > facing_rad + 0.5 * bin_rad:
                    continue
            for row in range(max(int(y) - reach, 0), min(int(y) + reach + 1, rows)):
                for col in range(max(int(x) - reach, 0), min(int(x) + reach + 1, cols)):
                    away = math.hypot(col + 0.5 - x, row + 0.5 - y) * lattice.cell_m / sigma_m
                    if away < LIKELY_SIGMAS:
                        value = np.uint8(FULL * math.exp(-0.5 * away * away))
                        if value > likelihood[channel, row, col]:
                            likelihood[channel, row, col] = value


@compiled
def _double(finer: Bytes, side: int, coarser: Bytes) -> None:
    """Fill the maxima of blocks of twice the side."""
    channels, rows, cols = finer.shape
    for channel in range(channels):
        for row in range(rows):
            below = min(row + side, rows - 1)
            for col in range(cols):
                right = min(col + side, cols - 1)
                coarser[channel, row, col] = max(
                    max(finer[channel, row, col], finer[channel, row, right]),
                    max(finer[channel, below, col], finer[channel, below, right]),
                )


@compiled
def _draw_walls(surfaces: Points, normals: Points, lattice: Lattice, walls: Floats) -> None:
    for i in range(len(surfaces)):
        if normals[i, 0] == 0.0 and normals[i, 1] == 0.0:
            continue
        row = int((surfaces[i, 1] - lattice.y_m) / lattice.cell_m)
        col = int((surfaces[i, 0] - lattice.x_m) / lattice.cell_m)
        for k in range(walls.shape[2]):
            held = walls[row, col, k]
            if held[2] == 0.0 and held[3] == 0.0:
                held[0], held[1] = surfaces[i, 0], surfaces[i, 1]
                held[2], held[3] = normals[i, 0], normals[i, 1]
                break


@compiled
def seen_through_walls(
    walls: Floats,
    lattice: Lattice,
    origins: Points,
    points: Points,
    start_m: float,
    end_m: float,
) -> int:
    """Return how many lines of sight from (N, 2) origins to (N, 2) points of the map cross a
    surface of the map, but for their beginning and their end."""
    crossings = np.zeros((1, 1, walls.shape[2]), dtype=np.int64)
    crossing = 0
    for i in range(len(points)):
        if _cross(walls, lattice, origins[i], points[i], start_m, end_m, crossings):
            crossing += 1
    return crossing


@compiled
def _remove_seen_through(
    walls: Floats, lattice: Lattice, origins: Points, points: Points, most: int
) -> None:
    """Remove the surfaces that more than `most` lines of sight of the map itself cross."""
    crossings = np.zeros(walls.shape[:3], dtype=np.int64)
    for i in range(len(points)):
        _cross(walls, lattice, origins[i], points[i], SIGHT_MARGIN_M, SIGHT_MARGIN_M, crossings)
    for row in range(walls.shape[0]):
        for col in range(walls.shape[1]):
            for k in range(walls.shape[2]):
                if crossings[row, col, k] > most:
                    walls[row, col, k] = 0.0


@compiled
def _cross(
    walls: Floats,
    lattice: Lattice,
    origin: Floats,
    point: Floats,
    start_m: float,
    end_m: float,
    crossings: Indices,
) -> bool:
    """Return whether a line of sight crosses a surface, and count it at every surface it crosses if
    `crossings` has all cells."""
    rows, cols = walls.shape[:2]
    counts = crossings.shape[0] == rows and crossings.shape[1] == cols
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
        for j in range(walls.shape[2]):
            wall = walls[row, col, j]
            across = wall[2] * dx + wall[3] * dy
            if abs(across) < 0.35:  # no surface, or one that the line only brushes
                continue
            x, y = wall[0] - origin[0], wall[1] - origin[1]
            at = (wall[2] * x + wall[3] * y) / across
            if start_m < at < length - end_m and abs(dx * y - dy * x) < step:
                crossed = True
                if not counts:
                    return True
                crossings[row, col, j] += 1
    return crossed
