"""Height of the ground from one depth image: the height of an object is measured from the ground
below it, not from a plane.

The robot stands on the ground, so there it is known: height 0, level. From there the ground is
grown outward, cell by cell. A measurement at a height to which a slope that the robot can drive may
lead is ground; a higher or lower one is something else, and the ground is taken to continue there
as before. So a slope is ground, while a step up or down, a wall, a table or a pit is not, however
much of the image it fills. Heights are relative to the plane on which the robot stands, and that
tilts with it. Where the camera does not look, as just before the robot, the ground continues with
the slope that was seen there earlier. Errors are on the safe side: on a slope, ground beyond the
shadow of a wide object may be taken for an obstacle until it is seen from nearer.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from navcore.compiled import compiled, inlined
from navcore.config.perception.perception import DEFAULT_PERCEPTION, GroundConfig
from navcore.geometry.arrays import Bools, FloatImage, Floats, Indices, Points
from navcore.geometry.camera import Pinhole, column_slope, point_on_ray, row_slope
from navcore.robot.frame import Frame

KNOWN_M = 0.05
"""Difference in metres from a known height up to which a measurement is that ground."""
_DEFAULT = DEFAULT_PERCEPTION.ground


class _Grid(NamedTuple):
    """Cells of the height map, as compiled kernels take them."""

    cell_m: float
    ahead: int
    aside: int
    max_range_m: float


class GroundCells(NamedTuple):
    """Ground around the robot in cells of the base frame: x forward from one row behind the origin,
    then y from right to left."""

    heights_m: Floats
    """(cells_ahead, 2 · cells_aside) heights in metres above the plane on which the robot
    stands."""
    seen_m: Floats
    """(cells_ahead, 2 · cells_aside) way in metres that the robot had driven when it saw what a
    measurement is ground by, which for most is now; NaN for a cell without a measurement, in which
    the ground before it continues."""
    is_refuted: Bools
    """(cells_ahead, 2 · cells_aside) whether something else than the known ground was measured."""


class KnownGround(NamedTuple):
    """Ground as it was seen earlier, in cells of `GroundCells`."""

    heights_m: Floats
    """(cells_ahead, 2 · cells_aside) heights in metres above the plane on which the robot stands
    now; NaN for none."""
    seen_m: Floats
    """(cells_ahead, 2 · cells_aside) way in metres that the robot had driven then."""
    driven_m: float
    """Way in metres that it has driven by now."""


def ground_heights(
    frame: Frame,
    max_slope: float,
    config: GroundConfig = _DEFAULT,
    slopes: Floats | None = None,
) -> FloatImage:
    """Return the (H, W) height in metres, above the plane on which the robot stands, of the ground
    below each measured pixel; (1, W) where that plane is all of it; read-only.

    `max_slope` is the rise per metre up to which the ground continues; a steeper one is a step.
    With 0 the ground is that plane. `slopes`: those seen earlier, as in `ground_cells`.
    """
    return heights_per_pixel(frame, ground_cells(frame, max_slope, config, slopes), config)


def heights_per_pixel(frame: Frame, ground: GroundCells | None, config: GroundConfig) -> FloatImage:
    """Return the heights of `ground_heights` by the ground of a frame; None for the plane on which
    the robot stands.

    They are exactly 0 where the ground differs from this plane by less than `tolerance_m`, and
    nearer to it by as much everywhere else.
    """
    if ground is not None:
        raised = np.maximum(np.abs(ground.heights_m) - config.tolerance_m, 0.0)
        if raised.any():
            cells = np.asarray(np.sign(ground.heights_m) * raised)
            heights = _per_pixel(
                frame.depth_m, frame.T_base_camera, frame.intrinsics.pinhole, _grid(config), cells
            )
            # As those of flat ground: for compiled code a read-only array is a type of its own.
            heights.flags.writeable = False
            return np.asarray(heights)
    return flat_ground(frame.intrinsics.width)


@lru_cache(maxsize=4)
def flat_ground(width: int) -> FloatImage:
    """Return (1, W) zeros for all rows of an image, read-only: the ground is the plane on which the
    robot stands."""
    level = np.zeros((1, width), dtype=np.float32)
    level.flags.writeable = False
    return level


def ground_cells(
    frame: Frame,
    max_slope: float,
    config: GroundConfig,
    slopes: Floats | None = None,
    known: KnownGround | None = None,
) -> GroundCells | None:
    """Return the ground around the robot; None where all that is measured counts as the plane on
    which it stands, or `max_slope` is 0.

    Of the ground as it was seen earlier: `slopes`: (cells_ahead · 2 · cells_aside, 2) rise per
    metre along x and y of the base frame, relative to the robot's plane, NaN where it was not seen;
    `known`: heights near which a measurement is ground.
    """
    if max_slope <= 0:
        return None
    measured = _lowest_heights(
        frame.depth_m,
        frame.T_base_camera,
        frame.intrinsics.pinhole,
        _grid(config),
        (config.sampled_rows, config.sampled_columns, config.min_pixels),
        (config.band_m, config.object_height_m),
    )
    if not (np.abs(measured) > config.tolerance_m).any():  # of NaN, too
        return None  # nor is then any median of them, or mean
    order, distance_m = _cells_outward(config.cell_m, config.cells_ahead, config.cells_aside)
    if known is None:
        nowhere = np.full(measured.shape, np.nan)
        known = KnownGround(nowhere, nowhere, 0.0)
    heights_m, seen_m, is_refuted = _grow_ground(
        _median_filter(measured),
        order,
        distance_m,
        np.full((*measured.shape, 2), np.nan)
        if slopes is None
        else slopes.reshape(*measured.shape, 2),
        known,
        (config.cell_m, max_slope, config.max_step_m, config.tolerance_m),
    )
    return GroundCells(heights_m, seen_m, is_refuted)


@lru_cache(maxsize=4)
def cell_centres(config: GroundConfig = _DEFAULT) -> Points:
    """Return the (cells_ahead · 2 · cells_aside, 2) middles in metres of the base frame of the
    cells of `ground_cells`, row by row; read-only."""
    x, y = _along_and_across(config.cell_m, config.cells_ahead, config.cells_aside)
    centres = np.column_stack([np.repeat(x, len(y)), np.tile(y, len(x))])
    centres.flags.writeable = False
    return centres


def _along_and_across(cell_m: float, ahead: int, aside: int) -> tuple[Floats, Floats]:
    x = np.arange(ahead, dtype=np.float64) - 0.5
    y = np.arange(2 * aside, dtype=np.float64) + 0.5 - aside
    return x * cell_m, y * cell_m


def _grid(config: GroundConfig) -> _Grid:
    return _Grid(config.cell_m, config.cells_ahead, config.cells_aside, config.max_range_m)


@lru_cache(maxsize=4)
def _cells_outward(cell_m: float, ahead: int, aside: int) -> tuple[Indices, Floats]:
    """Return all (N, 2) cells, the nearest to the robot first, and the (ahead, 2 · aside) distances
    of the cells from it in metres."""
    x, y = _along_and_across(cell_m, ahead, aside)
    distance_m = np.hypot(x[:, None], y[None, :])
    order = np.argsort(distance_m, axis=None, kind="stable")
    cells = np.column_stack(np.unravel_index(order, distance_m.shape)).astype(np.int64)
    return cells, distance_m


@compiled
def _lowest_heights(
    depth_m: FloatImage,
    t: Floats,
    lens: Pinhole,
    grid: _Grid,
    counts: tuple[int, int, int],
    heights: tuple[float, float],
) -> Floats:
    """Return the (ahead, 2 · aside) mean height of the lowest points of each cell; NaN where there
    are too few, or an object.

    `counts` are the sampled rows and columns and the fewest pixels of a measurement, `heights` the
    band of the ground and the least height of an object in metres.
    """
    height, width = depth_m.shape
    sampled_rows, sampled_columns, min_pixels = counts
    band_m, object_height_m = heights
    shape = (grid.ahead, 2 * grid.aside)
    least, most = np.full(shape, np.inf), np.full(shape, -np.inf)
    rows, columns = max(height // sampled_rows, 1), max(width // sampled_columns, 1)
    total, count = np.zeros(shape), np.zeros(shape)
    samples = (height // rows + 1) * (width // columns + 1)
    cells, levels, sampled = np.empty((samples, 2), dtype=np.int32), np.empty(samples), 0
    for i in range(0, height, rows):
        b = row_slope(i, lens)
        for j in range(0, width, columns):
            depth = depth_m[i, j]
            if not 0 < depth <= grid.max_range_m:
                continue
            x, y, z = point_on_ray(t, column_slope(j, lens), b, depth)
            row = math.floor(x / grid.cell_m) + 1
            col = math.floor(y / grid.cell_m) + grid.aside
            if not (0 <= row < grid.ahead and 0 <= col < 2 * grid.aside):
                continue
            least[row, col] = min(least[row, col], z)
            most[row, col] = max(most[row, col], z)
            cells[sampled, 0], cells[sampled, 1], levels[sampled] = row, col, z
            sampled += 1
    for sample in range(sampled):
        row, col, z = cells[sample, 0], cells[sample, 1], levels[sample]
        if z < least[row, col] + band_m:
            total[row, col] += z
            count[row, col] += 1
    means = np.full(shape, np.nan)
    for row in range(shape[0]):
        for col in range(shape[1]):
            is_low = most[row, col] - least[row, col] < object_height_m
            if is_low and count[row, col] >= min_pixels:
                means[row, col] = total[row, col] / max(count[row, col], 1)
    return means


@compiled
def _median_filter(heights: Floats) -> Floats:
    """Return the median of each measured cell and its measured neighbours: small objects that lie
    about are no ground."""
    rows, cols = heights.shape
    smooth, window = np.full((rows, cols), np.nan), np.empty(9)
    for row in range(rows):
        for col in range(cols):
            if np.isnan(heights[row, col]):
                continue
            count = 0
            for r in range(max(row - 1, 0), min(row + 2, rows)):
                for c in range(max(col - 1, 0), min(col + 2, cols)):
                    if not np.isnan(heights[r, c]):
                        # Into its place among the lower ones.
                        place = count
                        while place > 0 and window[place - 1] > heights[r, c]:
                            window[place] = window[place - 1]
                            place -= 1
                        window[place] = heights[r, c]
                        count += 1
            smooth[row, col] = (window[(count - 1) // 2] + window[count // 2]) / 2
    return smooth


@compiled
def _grow_ground(
    measured: Floats,
    order: Indices,
    distance_m: Floats,
    slopes: Floats,
    known: KnownGround,
    limits: tuple[float, float, float, float],
) -> tuple[Floats, Floats, Bools]:
    """Return the ground, grown from the robot outward: the measurement where that can be ground,
    the continuation of the ground before it elsewhere, with the slope that is known of it; and
    `seen_m` and `is_refuted` of `GroundCells`.

    `slopes` are those of `ground_cells`; `limits` are the side of a cell, the largest slope, the
    largest step and the tolerance.
    """
    cell_m, max_slope, max_step_m, tolerance_m = limits
    rows, cols = measured.shape
    ground, gap = np.zeros((rows, cols)), np.zeros((rows, cols))
    seen, is_refuted = np.full((rows, cols), np.nan), np.zeros((rows, cols), dtype=np.bool_)
    for index in range(len(order)):
        row, col = order[index, 0], order[index, 1]
        total, weights, least, since_m = 0.0, 0.0, np.inf, known.driven_m
        is_known = not np.isnan(slopes[row, col, 0])
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(col - 1, 0), min(col + 2, cols)):
                if distance_m[r, c] < distance_m[row, col]:
                    apart = cell_m * math.hypot(r - row, c - col)
                    weight = 1.0 / (apart + gap[r, c]) ** 2
                    height = ground[r, c]
                    if is_known:
                        height += cell_m * (
                            slopes[row, col, 0] * (row - r) + slopes[row, col, 1] * (col - c)
                        )
                    total, weights = total + weight * height, weights + weight
                    if seen[r, c] < since_m:  # never true of NaN
                        since_m = seen[r, c]
                    least = min(least, gap[r, c] + apart)
        before = total / weights if weights > 0 else 0.0
        reach = least if weights > 0 else distance_m[row, col]
        height = measured[row, col]
        # Never true of a cell without a measurement, or that is not known, which is NaN.
        continues = abs(height - before) <= min(max_slope * reach, max_step_m) + tolerance_m
        if continues:
            ground[row, col], seen[row, col] = height, since_m
        elif abs(height - known.heights_m[row, col]) <= KNOWN_M:
            ground[row, col], seen[row, col] = height, known.seen_m[row, col]
        else:
            # What was seen earlier adds nothing to the gap.
            ground[row, col], gap[row, col] = before, reach - cell_m if is_known else reach
        is_refuted[row, col] = abs(height - known.heights_m[row, col]) > KNOWN_M
    return ground, seen, is_refuted


@inlined
def _clipped(at: float, count: int) -> float:
    """Return a grid coordinate clipped to the centres of the first and the last of `count` cells;
    that of the first for NaN."""
    at = at if at > 0.0 else 0.0
    return at if at < count - 1.001 else count - 1.001


@compiled
def _per_pixel(
    depth_m: FloatImage, t: Floats, lens: Pinhole, grid: _Grid, cells: Floats
) -> FloatImage:
    """Return the (H, W) heights interpolated between the centres of the cells; 0 where nothing is
    measured."""
    height, width = depth_m.shape
    rows, cols = cells.shape
    ground = np.zeros((height, width), dtype=np.float32)
    across, x, y = np.empty(width), np.empty(width), np.empty(width)
    for j in range(width):
        across[j] = column_slope(j, lens)
    for i in range(height):
        b = row_slope(i, lens)
        for j in range(width):  # free of branches, so that the compiler vectorises it
            x_m, y_m, _ = point_on_ray(t, across[j], b, depth_m[i, j])
            x[j] = _clipped(x_m / grid.cell_m + 0.5, rows)
            y[j] = _clipped(y_m / grid.cell_m + grid.aside - 0.5, cols)
        for j in range(width):
            if not 0 < depth_m[i, j] <= grid.max_range_m:
                continue
            row, col = int(x[j]), int(y[j])
            u, v = x[j] - row, y[j] - col
            near = (1 - v) * cells[row, col] + v * cells[row, col + 1]
            far = (1 - v) * cells[row + 1, col] + v * cells[row + 1, col + 1]
            ground[i, j] = (1 - u) * near + u * far
    return ground
