"""Edges of drops: the last ground in view before it falls away, as from the top of a stair.

What lies below a deep drop is hidden from afar, or farther away than the map takes measurements;
its rim is in view before. Upwards in a column of the image the ground ends at a rim where the next
surface lies deeper than a drop and lower than the largest slope from the rim leads. So the rim is
seen from where the line of sight over it is steeper than this slope; from farther away the ground
that it hides may be a slope which the robot can drive, as behind the crest of a hill.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.arrays import FloatImage
from navcore.mapping.views.voxels import DepthView, Pixels

COARSE_STEP = 4
"""Every so many rows and columns are looked through first, the others only if these show a rim."""


def drop_edges(view: DepthView, resolution_m: float, rules: ObservationConfig) -> Pixels:
    """Return the pixels of the rims, one of each grid cell in which `rules.min_support` columns of
    the image show one."""
    rows, cols = view.shape
    if not rows * cols:
        return np.empty(0, dtype=np.int32)
    limits = np.array(
        [rules.obstacle_height_m, rules.drop_m, rules.max_slope * resolution_m, view.max_range_m],
        dtype=np.float32,
    )
    rays = (view.depth_m, view.ground_m, view.across, view.down, view.affine)
    if not len(_rims(*rays, rows, cols, limits, COARSE_STEP)[0]):
        return np.empty(0, dtype=np.int32)
    pixels, cells = _rims(*rays, rows, cols, limits, 1)
    _, first, counts = np.unique(cells, return_index=True, return_counts=True)
    return pixels[first[counts >= rules.min_support]]


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
) -> tuple[Pixels, Pixels]:
    """Pixels of the rims and their cells in the box, row · columns + column, among every `step`-th
    row and column of the image; `t` leads to columns and rows of the box and height. `limits` are
    the height of an obstacle, the depth of a drop, the largest fall a cell of distance, and the
    range."""
    height, width = depth_m.shape
    obstacle, drop, fall, far = limits
    rim, at = np.full(width, -1, dtype=np.int32), np.empty((width, 3), dtype=np.float32)
    pixels, cells, count = np.empty(width, dtype=np.int32), np.empty(width, dtype=np.int32), 0
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
            elif above > obstacle:  # whatever stands there hides the ground behind it
                rim[j] = -1
            elif rim[j] >= 0:
                away = math.hypot(x - at[j, 0], y - at[j, 1])
                if z < at[j, 2] - max(drop, fall * away):
                    col, row = math.floor(at[j, 0]), math.floor(at[j, 1])
                    if count < width and 0 <= row < rows and 0 <= col < cols:
                        pixels[count], cells[count] = rim[j] * width + j, row * cols + col
                        count += 1
                    rim[j] = -1
    return pixels[:count], cells[:count]
