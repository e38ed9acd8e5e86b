"""How high the ground lies, from one depth picture: a thing's height is measured from the ground
below it, not from a plane.

The robot stands on the ground, so that is where it is known: height 0, level. From there it is
followed outward, cell by cell. What is measured at a height to which a slope can lead that the
robot can drive is ground; what is higher or lower is something else, and there the ground is taken
to go on as it was. So a slope is ground, while a step up or down, a wall, a table or a pit is not,
however much of the picture it fills. Nothing is remembered: heights are relative to the plane on
which the robot stands, and that tilts with it. It errs on the safe side: on a slope, ground beyond
the shadow of something wide may be taken for an obstacle until it is seen from nearer.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined
from navcore.robot.frame import Frame

CELL_M = 0.2
"""Side of a cell."""
AHEAD, ASIDE = 30, 25
"""So many cells ahead of the robot's middle, and to either side, beginning one row behind it."""
ROWS, COLUMNS = 240, 106
"""About so many rows and columns of the picture are looked at: far away there are few rows to a
cell, but columns enough."""
BAND_M = 0.04
"""What is measured so little above the lowest of a cell is its ground, too."""
PIXELS = 2
"""So many of them make a measurement."""
TALL_M = 0.1
"""Where more than this is measured one above the other something stands, and its foot need not be
the ground."""
STEP_M = 0.06
"""Where the ground was out of sight for a while it has risen or fallen by no more than this, or it
is an obstacle."""
SLACK_M = 0.02
"""Depth is not better than this; flat ground comes out as exactly flat."""
FARTHEST_M = 6.0
"""Depth beyond this is too coarse."""

Image = npt.NDArray[np.float32]
Heights = npt.NDArray[np.float64]


def ground_heights(frame: Frame, max_slope: float) -> Image:
    """(H, W) height in metres, above the plane on which the robot stands, of the ground below what
    each pixel measured.

    `max_slope` is the rise per metre up to which it is ground that goes on, not a step; with 0 the
    ground is that plane. The heights are read-only.
    """
    if max_slope > 0:
        cells = cell_heights(frame, max_slope)
        if cells.any():
            lens = frame.intrinsics
            heights = _per_pixel(
                frame.depth_m, frame.T_base_camera, lens.fx, lens.fy, lens.cx, lens.cy, cells
            )
            heights.flags.writeable = (
                False  # as those of flat ground: to compiled code that is a type of its own
            )
            return np.asarray(heights)
    return flat(frame.depth_m.shape)


@lru_cache(maxsize=4)
def flat(shape: tuple[int, ...]) -> Image:
    """(H, W) zeros, read-only: the ground is the plane on which the robot stands."""
    level = np.zeros(shape, dtype=np.float32)
    level.flags.writeable = False
    return level


def cell_heights(frame: Frame, max_slope: float) -> Heights:
    """(AHEAD, 2 · ASIDE) the ground's height cell by cell in the base frame, x forward, then y from
    right to left.

    Exactly 0 where it is nearer to the robot's plane than `SLACK_M`, and as much nearer everywhere
    else.
    """
    lens = frame.intrinsics
    measured = _lowest(frame.depth_m, frame.T_base_camera, lens.fx, lens.fy, lens.cx, lens.cy)
    heights = _followed(_without_specks(measured), *_outward(), max_slope)
    return np.asarray(np.sign(heights) * np.maximum(np.abs(heights) - SLACK_M, 0.0))


@lru_cache(maxsize=1)
def _outward() -> tuple[npt.NDArray[np.int64], Heights]:
    """(N, 2) all cells, the nearest to the robot first, and (AHEAD, 2 · ASIDE) how far each is from
    it."""
    x, y = (np.arange(AHEAD) - 0.5) * CELL_M, (np.arange(2 * ASIDE) + 0.5 - ASIDE) * CELL_M
    away = np.hypot(x[:, None], y[None, :])
    order = np.argsort(away, axis=None, kind="stable")
    return np.column_stack(np.unravel_index(order, away.shape)).astype(np.int64), away


@compiled
def _lowest(
    depth_m: Image, t: npt.NDArray[np.float64], fx: float, fy: float, cx: float, cy: float
) -> Heights:
    """(AHEAD, 2 · ASIDE) mean height of the lowest that each cell shows; NaN where that is too
    little, or something stands."""
    height, width = depth_m.shape
    least, most = np.full((AHEAD, 2 * ASIDE), np.inf), np.full((AHEAD, 2 * ASIDE), -np.inf)
    rows, columns = max(height // ROWS, 1), max(width // COLUMNS, 1)
    total, count = np.zeros((AHEAD, 2 * ASIDE)), np.zeros((AHEAD, 2 * ASIDE))
    for turn in range(2):
        for i in range(0, height, rows):
            b = (i - cy) / fy
            for j in range(0, width, columns):
                depth = depth_m[i, j]
                if not 0 < depth <= FARTHEST_M:
                    continue
                a = (j - cx) / fx
                row = (
                    math.floor(((t[0, 0] * a + t[0, 1] * b + t[0, 2]) * depth + t[0, 3]) / CELL_M)
                    + 1
                )
                col = (
                    math.floor(((t[1, 0] * a + t[1, 1] * b + t[1, 2]) * depth + t[1, 3]) / CELL_M)
                    + ASIDE
                )
                if not (0 <= row < AHEAD and 0 <= col < 2 * ASIDE):
                    continue
                z = (t[2, 0] * a + t[2, 1] * b + t[2, 2]) * depth + t[2, 3]
                if turn == 0:
                    least[row, col], most[row, col] = (
                        min(least[row, col], z),
                        max(most[row, col], z),
                    )
                elif z < least[row, col] + BAND_M:
                    total[row, col] += z
                    count[row, col] += 1
    return np.where(
        (count >= PIXELS) & (most - least < TALL_M), total / np.maximum(count, 1), np.nan
    )


@compiled
def _without_specks(heights: Heights) -> Heights:
    """The median of each cell and those beside it that are measured: small things that lie about
    are no ground."""
    rows, cols = heights.shape
    smooth, beside = np.full((rows, cols), np.nan), np.empty(9)
    for row in range(rows):
        for col in range(cols):
            if np.isnan(heights[row, col]):
                continue
            count = 0
            for r in range(max(row - 1, 0), min(row + 2, rows)):
                for c in range(max(col - 1, 0), min(col + 2, cols)):
                    if not np.isnan(heights[r, c]):
                        beside[count] = heights[r, c]
                        count += 1
            smooth[row, col] = np.median(beside[:count])
    return smooth


@compiled
def _followed(
    measured: Heights, order: npt.NDArray[np.int64], away: Heights, max_slope: float
) -> Heights:
    """The ground, from the robot outward: measured where that can be ground, going on as it was
    where it cannot."""
    rows, cols = measured.shape
    ground, gap = np.zeros((rows, cols)), np.zeros((rows, cols))
    for index in range(len(order)):
        row, col = order[index, 0], order[index, 1]
        total, weights, least = 0.0, 0.0, np.inf
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(col - 1, 0), min(col + 2, cols)):
                if away[r, c] < away[row, col]:
                    apart = CELL_M * math.hypot(r - row, c - col)
                    weight = 1.0 / (apart + gap[r, c]) ** 2
                    total, weights = total + weight * ground[r, c], weights + weight
                    least = min(least, gap[r, c] + apart)
        before = total / weights if weights > 0 else 0.0
        reach = least if weights > 0 else away[row, col]
        height = measured[row, col]
        if (
            abs(height - before) <= min(max_slope * reach, STEP_M) + SLACK_M
        ):  # never true of what is not measured
            ground[row, col] = height
        else:
            ground[row, col], gap[row, col] = before, reach
    return ground


@inlined
def _within(at: float, count: int) -> float:
    """The same, or the nearest place between the middles of the first and the last cell; the first
    for what is no number."""
    at = at if at > 0.0 else 0.0
    return at if at < count - 1.001 else count - 1.001


@compiled
def _per_pixel(
    depth_m: Image,
    t: npt.NDArray[np.float64],
    fx: float,
    fy: float,
    cx: float,
    cy: float,
    cells: Heights,
) -> Image:
    """(H, W) the heights between the middles of the cells; 0 where nothing is measured."""
    height, width = depth_m.shape
    rows, cols = cells.shape
    ground = np.zeros((height, width), dtype=np.float32)
    for i in range(height):
        b = (i - cy) / fy
        for j in range(width):
            depth = depth_m[i, j]
            if not 0 < depth <= FARTHEST_M:
                continue
            a = (j - cx) / fx
            x = ((t[0, 0] * a + t[0, 1] * b + t[0, 2]) * depth + t[0, 3]) / CELL_M + 0.5
            y = ((t[1, 0] * a + t[1, 1] * b + t[1, 2]) * depth + t[1, 3]) / CELL_M + ASIDE - 0.5
            row, col = int(_within(x, rows)), int(_within(y, cols))
            u, v = _within(x, rows) - row, _within(y, cols) - col
            near = (1 - v) * cells[row, col] + v * cells[row, col + 1]
            far = (1 - v) * cells[row + 1, col] + v * cells[row + 1, col + 1]
            ground[i, j] = (1 - u) * near + u * far
    return ground
