"""Kernels of the terrain map: the sums of the looks at a cell, and what they say of its ground."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined
from navcore.geometry.arrays import Bools, Floats, Indices
from navcore.mapping.terrain.looks import VALUES

TILE = 64
"""Side of a tile in cells."""
NO_RECORD = -1
RECORD = np.dtype(
    [
        ("pose_id", np.int32),
        ("yaw_rad", np.float32),
        ("base", np.float32, (2,)),
        ("sums", np.float32, (VALUES,)),
    ]
)
"""Pose that first saw a cell, its heading in the map as corrected last, the middle of the cell in
its base frame in metres, and the sums of all looks with the slope in that frame."""
Records = npt.NDArray[np.void]
Sums = npt.NDArray[np.float32]
"""(..., 6) sums of the `VALUES` of looks."""


class GroundLimits(NamedTuple):
    """What the ground of a cell is judged by: `TerrainConfig` and the robot's profile."""

    min_looks: int
    smooth_m: float
    uneven_slope: float
    max_slope: float
    max_step_m: float


@inlined
def _is_known(sums: Sums, limits: GroundLimits) -> bool:
    """Whether it is smooth ground with enough looks."""
    looks = sums[0]
    return bool((looks >= limits.min_looks) & (sums[3] <= limits.smooth_m**2 * looks))


@inlined
def _is_beyond(sums: Sums, limits: GroundLimits) -> bool:
    """Whether the ground is beyond what the robot can drive on."""
    looks, steps = sums[0], sums[4]
    is_steep = math.hypot(sums[1], sums[2]) > limits.max_slope * looks
    is_high = (sums[5] > limits.max_step_m * steps) & (steps >= limits.min_looks)
    return bool((looks >= limits.min_looks) & (is_steep | is_high))


@inlined
def _is_uneven(sums: Sums, limits: GroundLimits) -> bool:
    """Whether it is smooth ground with a slope."""
    is_steep = math.hypot(sums[1], sums[2]) > limits.uneven_slope * sums[0]
    return bool(is_steep & _is_known(sums, limits))


@compiled
def judged(sums: Sums, limits: GroundLimits) -> tuple[Bools, Bools, Bools]:
    """Return of (N, 6) sums which are those of known ground, of ground beyond the limits, and of
    uneven ground; (N,) each."""
    count = len(sums)
    known, beyond = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.bool_)
    uneven = np.empty(count, dtype=np.bool_)
    for n in range(count):
        known[n] = _is_known(sums[n], limits)
        beyond[n] = _is_beyond(sums[n], limits)
        uneven[n] = _is_uneven(sums[n], limits)
    return known, beyond, uneven


@compiled
def add_looks(
    cells: Indices,
    values: Floats,
    pose_id: int,
    pose: tuple[float, float, float],
    cell_m: float,
    tile: tuple[int, int],
    sums: Sums,
    record: npt.NDArray[np.int32],
    records: Records,
    count: int,
    limits: GroundLimits,
) -> tuple[int, bool, Indices, Bools]:
    """Add those of (N, 2) cells and their (N, 6) values from a pose, x, y and yaw, that lie in a
    tile to its sums and to the records of its cells.

    Return the number of records, which must have room for N more, whether any of these cells is
    uneven, and the (K, 2) cells that are beyond the limits since, or no longer, with which it is.
    """
    changed, is_beyond = np.empty((len(cells), 2), dtype=np.int64), np.empty(len(cells), np.bool_)
    found, any_uneven = 0, False
    x, y, yaw = pose
    for n in range(len(cells)):
        row, col = cells[n, 0] - tile[0] * TILE, cells[n, 1] - tile[1] * TILE
        if not (0 <= row < TILE and 0 <= col < TILE):
            continue
        if record[row, col] == NO_RECORD:
            away_x, away_y = (cells[n, 1] + 0.5) * cell_m - x, (cells[n, 0] + 0.5) * cell_m - y
            own = records[count]
            own.pose_id, own.yaw_rad = pose_id, yaw
            own.base[0] = math.cos(yaw) * away_x + math.sin(yaw) * away_y
            own.base[1] = math.cos(yaw) * away_y - math.sin(yaw) * away_x
            own.sums[:] = 0
            record[row, col], count = count, count + 1
        own = records[record[row, col]]
        cos, sin = math.cos(own.yaw_rad), math.sin(own.yaw_rad)
        own.sums[1] += cos * values[n, 1] + sin * values[n, 2]
        own.sums[2] += cos * values[n, 2] - sin * values[n, 1]
        was_beyond = _is_beyond(sums[row, col], limits)
        for k in range(VALUES):
            sums[row, col, k] += values[n, k]
            if k != 1 and k != 2:
                own.sums[k] += values[n, k]
        any_uneven |= _is_uneven(sums[row, col], limits)
        if _is_beyond(sums[row, col], limits) != was_beyond:
            changed[found], is_beyond[found] = cells[n], not was_beyond
            found += 1
    return count, any_uneven, changed[:found].copy(), is_beyond[:found].copy()
