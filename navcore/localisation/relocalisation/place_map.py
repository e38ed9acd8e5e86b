"""Place map: the surfaces of a kept map, prepared for relocalisation."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from navcore.config.localisation.relocalisation import PlaceSearchConfig
from navcore.geometry.arrays import Bools, Points
from navcore.localisation.relocalisation.clear_floor import clear_floor, count_lines
from navcore.localisation.relocalisation.search_tables import (
    LIKELY_SIGMAS,
    Lattice,
    SearchTables,
    tables_of,
)
from navcore.localisation.relocalisation.walls import (
    Walls,
    count_crossings,
    remove_seen_through,
    walls_of,
)
from navcore.localisation.scans.scan import Keyframe

LINE_NEIGHBOURS = 8
"""Nearest surfaces that decide whether a surface is part of a line."""
LINE_M = 0.35
"""Distance in metres of the farthest of them."""
LEAST_LINE = 4
"""Smallest number of surfaces, itself included, that form a line."""


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
    tables: SearchTables
    """How likely a point is in the blocks of cells."""
    walls: Walls
    """Up to two surfaces with a normal in each cell, without those that are seen through."""
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
    walls, tree = walls_of(surfaces, normals, lattice, (rows, cols)), cKDTree(surfaces)
    crossings = np.zeros(len(surfaces), dtype=np.int64)
    lines = np.zeros((rows, cols), dtype=np.uint16)
    for keyframe in keyframes:
        pose, scan = keyframe.T_map_base, keyframe.scan
        origin, ends = pose.to_parent(scan.origin), pose.to_parent(scan.points_base)
        count_crossings(walls, lattice, origin, ends, crossings)
        count_lines(lines, lattice, origin, ends, config.clear_m, config.seen_lines)
    remove_seen_through(walls, crossings, config.wall_crossings)
    clear = clear_floor(lines, lattice, tree, config)
    tables = tables_of(surfaces, normals, lattice, clear, config)
    for array in (*walls, clear):
        array.flags.writeable = False
    return PlaceMap(
        surfaces=surfaces,
        normals=normals,
        lines=_lines_of(surfaces, normals, tree),
        lattice=lattice,
        tables=tables,
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
