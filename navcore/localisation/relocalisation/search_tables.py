"""Search tables: how likely a map makes a point, for each cell and direction of its surface, and
the maxima over ever larger blocks (the bounds of branch and bound, as in Hess, Kohler, Rapp, Andor
2016).

They are kept in tiles, and tiles of one value are shared: what the map does not know, clear floor,
and walls that do not face in a direction take no memory but the number of their tile. A bound of a
large block may be a little larger than it has to be, so it is kept once for several cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.config.localisation.relocalisation import PlaceSearchConfig
from navcore.geometry.arrays import Bools, Points

DIRECTIONS = 8
"""Directions of surface normals that are told apart; the last channel, beyond them, is for points
without a normal."""
FULL = 255
"""Likelihood of a point on its surface."""
KEPT_BLOCK = 2
"""Level of the smallest blocks that have a bound; of each, only the best position is kept."""
CLEAR, UNKNOWN = 0, 1
"""Values of the tables where the map has seen that nothing stands, and where it knows nothing."""
LIKELY_SIGMAS = 3.0
"""Distance in standard deviations beyond which the likelihood is zero."""
TILE_BITS = 4
TILE = 1 << TILE_BITS
"""Side of a tile in cells."""
UNIFORM = 256
"""Number of tiles of one value, which are the first ones, in the order of the values."""

Bytes = npt.NDArray[np.uint8]
TileNumbers = npt.NDArray[np.int32]


class Lattice(NamedTuple):
    """Cells of a place map, as compiled kernels take them."""

    x_m: float
    """x of the corner of cell (0, 0) in metres of the map."""
    y_m: float
    """y of the corner of cell (0, 0) in metres of the map."""
    cell_m: float
    """Edge of a cell in metres."""


class SearchTables(NamedTuple):
    """Largest value of a block of 2^level cells on each side: `CLEAR`, `UNKNOWN`, or a likelihood
    up to `FULL`.

    Table 0 is that of the cells, table k that of the level `KEPT_BLOCK` + k − 1. There one value
    bounds the blocks that begin at any of 2^(k − 1) × 2^(k − 1) cells.
    """

    numbers: TileNumbers
    """(tables, directions + 1, tile rows, tile columns) number of the tile of each part."""
    tiles: Bytes
    """(K, `TILE`, `TILE`) values of each tile."""


def tables_of(
    surfaces: Points, normals: Points, lattice: Lattice, clear: Bools, config: PlaceSearchConfig
) -> SearchTables:
    """Return the tables of (N, 2) surfaces in metres with (N, 2) normals, (0, 0) where unknown.

    `clear`: (rows, cols) cells of the lattice where the map has seen that nothing stands.
    """
    last = config.levels - KEPT_BLOCK + 1
    # Beyond the map nothing is known, so that is in the blocks that reach there.
    across, block = TILE << (last - 1), 1 << config.levels
    height, width = (-(-(side + block) // across) * across for side in clear.shape)
    shape = (last + 1, DIRECTIONS + 1, height // TILE, width // TILE)
    numbers = np.zeros(shape, dtype=np.int32)
    # As many as there can be: pages that are never written to cost no memory.
    tiles = np.empty((UNIFORM + numbers.size, TILE, TILE), dtype=np.uint8)
    tiles[:UNIFORM] = np.arange(UNIFORM, dtype=np.uint8)[:, None, None]
    empty = np.full((height, width), UNKNOWN, dtype=np.uint8)
    empty[: len(clear), : clear.shape[1]][clear] = CLEAR
    count, facing_rad = UNIFORM, math.radians(config.facing_deg)
    for channel in range(DIRECTIONS + 1):
        values = empty.copy()
        _draw(surfaces, normals, lattice, config.sigma_m, facing_rad, channel, values)
        count = _store(values, numbers[0, channel], tiles, count)
        for level in range(KEPT_BLOCK):
            values = _doubled(values, 1 << level)
        count = _store(values, numbers[1, channel], tiles, count)
        for table in range(2, last + 1):
            values = _halved(values)
            count = _store(values, numbers[table, channel], tiles, count)
    tables = SearchTables(numbers=numbers, tiles=tiles[:count])
    for array in tables:
        array.flags.writeable = False
    return tables


@compiled
def _draw(
    surfaces: Points,
    normals: Points,
    lattice: Lattice,
    sigma_m: float,
    facing_rad: float,
    channel: int,
    likelihood: Bytes,
) -> None:
    """Raise the likelihood of the cells around each surface that a point of a channel may match."""
    rows, cols = likelihood.shape
    reach = math.ceil(LIKELY_SIGMAS * sigma_m / lattice.cell_m)
    bin_rad = 2.0 * math.pi / DIRECTIONS
    for i in range(len(surfaces)):
        if channel < DIRECTIONS and (normals[i, 0] != 0.0 or normals[i, 1] != 0.0):
            angle = math.atan2(normals[i, 1], normals[i, 0])
            turn = abs(angle - channel * bin_rad + math.pi) % (2.0 * math.pi) - math.pi
            if abs(turn) > facing_rad + 0.5 * bin_rad:
                continue
        x = (surfaces[i, 0] - lattice.x_m) / lattice.cell_m
        y = (surfaces[i, 1] - lattice.y_m) / lattice.cell_m
        for row in range(max(int(y) - reach, 0), min(int(y) + reach + 1, rows)):
            for col in range(max(int(x) - reach, 0), min(int(x) + reach + 1, cols)):
                away = math.hypot(col + 0.5 - x, row + 0.5 - y) * lattice.cell_m / sigma_m
                if away < LIKELY_SIGMAS:
                    value = np.uint8(FULL * math.exp(-0.5 * away * away))
                    if value > likelihood[row, col]:
                        likelihood[row, col] = value


def _doubled(finer: Bytes, side: int) -> Bytes:
    """Return the largest values of blocks of twice the side, from those of all blocks."""
    for _ in range(2):  # along the rows, then along the columns
        longer = finer.copy()
        np.maximum(finer[:-side], finer[side:], out=longer[:-side])
        finer = longer.T
    return np.ascontiguousarray(finer)


def _halved(finer: Bytes) -> Bytes:
    """Return a table at half the resolution for blocks of twice the side."""
    # A value is for blocks that begin at either of two, and so does their further half.
    ahead = 1 << (KEPT_BLOCK - 1)
    for _ in range(2):  # along the rows, then along the columns
        pairs = np.maximum(finer[::2], finer[1::2])
        pairs[:-ahead] = np.maximum(pairs[:-ahead], pairs[ahead:])
        finer = pairs.T
    return np.ascontiguousarray(finer)


@compiled
def _store(plane: Bytes, numbers: TileNumbers, tiles: Bytes, count: int) -> int:
    """Write the numbers of the tiles of a plane, and from `count` on the tiles that are not of one
    value; return their number with those before."""
    for i in range(plane.shape[0] // TILE):
        for j in range(plane.shape[1] // TILE):
            top, left = i * TILE, j * TILE
            first, differing = plane[top, left], 0
            for row in range(TILE):
                for col in range(TILE):
                    value = plane[top + row, left + col]
                    tiles[count, row, col] = value
                    differing += value != first
            numbers[i, j] = count if differing else first
            count += differing > 0
    return count
