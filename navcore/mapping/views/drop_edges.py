"""Edges of drops: the last ground in view before it falls away, as from the top of a stair.

What lies below a deep drop is hidden from afar, or farther away than the map takes measurements;
its rim is in view before. Upwards in a column of the image the ground ends at a rim where the next
surface lies deeper than a drop and lower than the largest slope from the rim leads. So the rim is
seen from where the line of sight over it is steeper than this slope; from farther away the ground
that it hides may be a slope which the robot can drive, as behind the crest of a hill.

A pit has ground at the height of its rim on its other side. Where none is in view, the ground below
is another level, as at the foot of a platform, which may be reached by a ramp. There the rim alone
keeps the robot from it, or, where the rim is not in view, a strip of what is seen of it first. So
it is with a pit whose other side is hidden, out of range, or a wall.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.arrays import Bools, FloatImage
from navcore.mapping.views.voxels import DepthView, Pixels

STRIP_M = 0.5
"""Width in metres of the strip."""
COARSE_STEP = 4
"""Every so many rows and columns are looked through first, the others only if these show a drop."""


class DropEdges(NamedTuple):
    """Rims of drops in an image."""

    pixels: Pixels
    """(N,) pixels of the rims, one of each grid cell."""
    lower_level: npt.NDArray[np.int32]
    """(W,) row in each column of the image above which all ground belongs to a lower level; −1 for
    none."""


def drop_edges(view: DepthView, resolution_m: float, rules: ObservationConfig) -> DropEdges:
    """Return the rims in the cells of the grid that show one, themselves and with the cells beside
    them, in at least `rules.min_support` columns of the image."""
    rows, cols = view.shape
    width = view.depth_m.shape[1]
    if not rows * cols:
        return _no_edges(width)
    strip = STRIP_M / resolution_m
    fall = rules.max_slope * resolution_m
    limits = np.array(
        [rules.obstacle_height_m, rules.drop_m, fall, view.max_range_m, strip], dtype=np.float32
    )
    rays = (view.depth_m, view.ground_m, view.across, view.down, view.affine)
    pixels, _, lower_level, _ = _rims(*rays, rows, cols, limits, COARSE_STEP)
    if len(pixels) == 0 and (lower_level < 0).all():
        return _no_edges(width)
    pixels, cells, lower_level, is_rim = _rims(*rays, rows, cols, limits, 1)
    distinct, first, which, counts = np.unique(
        cells, return_index=True, return_inverse=True, return_counts=True
    )
    support = np.zeros(len(distinct), dtype=np.int64)
    for beside in (a * cols + b for a in (-1, 0, 1) for b in (-1, 0, 1)):
        at = np.minimum(np.searchsorted(distinct, distinct + beside), len(distinct) - 1)
        support += np.where(distinct[at] == distinct + beside, counts[at], 0)
    supported = support >= rules.min_support
    row, col = np.divmod(pixels[~supported[which]], width)
    alone = col[is_rim[col] & (lower_level[col] == row)]
    lower_level[alone] = -1
    return DropEdges(pixels[first[supported]], lower_level)


@lru_cache(maxsize=4)
def _no_edges(width: int) -> DropEdges:
    return DropEdges(np.empty(0, dtype=np.int32), np.full(width, -1, dtype=np.int32))


@compiled
def _rims(
    depth_m: FloatImage,
    ground_m: FloatImage,
    across: npt.NDArray[np.float32],
    down: npt.NDArray[np.float32],
    t: npt.NDArray[np.float32],
    rows: int,
    cols: int,
    limits: npt.NDArray[np.float32],
    step: int,
) -> tuple[Pixels, Pixels, Pixels, Bools]:
    """Pixels of the rims and their cells in the box, row · columns + column, among every `step`-th
    row and column of the image; for each column the row from which on upwards all ground belongs to
    a lower level, or −1, and whether it is that of a rim.

    `t` leads to columns and rows of the box and height. `limits` are the height of an obstacle, the
    depth of a drop, the largest fall a cell of distance, the range, and the width of the strip in
    cells.
    """
    height, width = depth_m.shape
    obstacle, drop, fall, far, strip = limits
    rim, at = np.full(width, -1, dtype=np.int32), np.empty((width, 3), dtype=np.float32)
    lower, level_m = np.full(width, -1, dtype=np.int32), np.zeros(width, dtype=np.float32)
    is_rim = np.zeros(width, dtype=np.bool_)
    first = np.full((width, 2), np.nan, dtype=np.float32)  # deep ground before which there is none
    behind = np.full((width, 2), np.nan, dtype=np.float32)  # ground that may be behind a pit
    pixels, cells, count = np.empty(width, dtype=np.int32), np.empty(width, dtype=np.int32), 0
    is_lost = np.zeros(width, dtype=np.bool_)  # whether a rim is not among the pixels
    for i in range(height - 1, -1, -step):
        b, ground = down[i], ground_m[i if len(ground_m) > 1 else 0]
        for j in range(0, width, step):
            depth, a = depth_m[i, j], across[j]
            falling = t[2, 0] * a + t[2, 1] * b + t[2, 2]
            if depth <= 0 or falling >= 0:
                continue
            z = falling * depth + t[2, 3]
            x = (t[0, 0] * a + t[0, 1] * b + t[0, 2]) * depth + t[0, 3]
            y = (t[1, 0] * a + t[1, 1] * b + t[1, 2]) * depth + t[1, 3]
            above = z - ground[j]
            if abs(above) <= obstacle and depth <= far:
                rim[j], at[j, 0], at[j, 1], at[j, 2] = i, x, y, z
                if z < level_m[j] - drop:
                    continue
                if np.isnan(behind[j, 0]):
                    behind[j, 0], behind[j, 1] = x, y
                elif math.hypot(x - behind[j, 0], y - behind[j, 1]) > strip:
                    lower[j], first[j, 0] = -1, np.nan
                continue
            behind[j, 0] = np.nan  # it may be a wall that has a part of its height in common
            if above > obstacle:  # whatever stands there hides the ground behind it
                rim[j], first[j, 0] = -1, np.nan
            elif rim[j] >= 0:
                away = math.hypot(x - at[j, 0], y - at[j, 1])
                if z < at[j, 2] - max(drop, fall * away):
                    col, row = math.floor(at[j, 0]), math.floor(at[j, 1])
                    if count < width and 0 <= row < rows and 0 <= col < cols:
                        pixels[count], cells[count] = rim[j] * width + j, row * cols + col
                        count += 1
                        if lower[j] < 0:
                            lower[j], level_m[j], is_rim[j] = rim[j], at[j, 2], True
                    else:
                        is_lost[j] = True
                    rim[j] = -1
            elif above < -drop and lower[j] < 0:
                if np.isnan(first[j, 0]):
                    first[j, 0], first[j, 1], level_m[j] = x, y, ground[j]
                elif math.hypot(x - first[j, 0], y - first[j, 1]) > strip:
                    lower[j], is_rim[j] = i, False
    lower[is_lost] = -1
    return pixels[:count], cells[:count], lower, is_rim
