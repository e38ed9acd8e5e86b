"""The shortest way out of an area that the robot must not be in, for one that stands in it already."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from navcore.compiled import compiled
from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import Costmap, box_around
from navcore.costmap.local_costmap import obstacle_masks, split_areas
from navcore.geometry.arrays import Indices
from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import BitPlane
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, Cell, GridSpec, inflate
from navcore.grid.nearest import nearest_free
from navcore.mission.zone import Zone
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import SQRT2
from navcore.robot.profile import RobotProfile

NEAR_M = 4.0
"""So far about the robot it is looked for first; then twice as far, and so on."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EscapePath:
    """A way out, or why there is none, in the part of the map that had to be looked at for it."""

    outcome: Path | NoPath
    """In cells of the part."""
    spec: GridSpec
    """The part."""
    corner: Cell
    """Its first cell, in those of the map."""
    free: BitPlane
    """The cells of the part that the way may use."""

    @property
    def on_the_map(self) -> Path | NoPath:
        """The outcome in cells of the map."""
        if isinstance(self.outcome, NoPath):
            return self.outcome
        return Path(cells=self.outcome.cells + np.array(self.corner), length=self.outcome.length)


def escape_path(
    occupancy: Costmap,
    pose: Pose2,
    zones: Iterable[Zone],
    profile: RobotProfile,
    config: NavigatorConfig,
) -> EscapePath:
    """The shortest way to where no part of the robot is in a beware area, however it turns; over no
    area but its own.

    `zones`: those that the occupancy was made with. What is near is looked at first, and taken if
    nothing farther away can be nearer or change it.
    """
    spec, zones, within_m = occupancy.spec, tuple(zones), NEAR_M
    row, col = spec.cell(pose.x_m, pose.y_m)
    if not (0 <= row < spec.rows and 0 <= col < spec.cols):
        return EscapePath(
            outcome=NoPath(reason=Reason.OUTSIDE),
            spec=spec,
            corner=(0, 0),
            free=occupancy.free.plane,
        )
    # What lies beyond the part tells upon its rim: as far as margins reach, and then the body.
    body_m = (
        max(profile.width_m / 2 + config.safety_margin_m, profile.circumscribed_radius_m)
        + 2 * spec.resolution_m
    )
    rim_m = max(margin_m for _, margin_m, _ in occupancy.layers) + body_m
    while True:
        box = box_around(spec, pose, within_m + rim_m)
        found, own = _exit_within(occupancy, box, pose, zones, profile, config)
        # Where the way begins is told by what is nearest, and so is that it cannot.
        length_m = (
            found.outcome.length * spec.resolution_m if isinstance(found.outcome, Path) else 0.0
        )
        is_near = length_m < within_m - config.start_relief_m and found.outcome != NoPath(
            reason=Reason.UNREACHABLE
        )
        if box == (0, 0, spec.rows, spec.cols) or (is_near and not _goes_on(own, box, spec)):
            return found
        within_m *= 2


def _exit_within(
    occupancy: Costmap,
    box: tuple[int, int, int, int],
    pose: Pose2,
    zones: tuple[Zone, ...],
    profile: RobotProfile,
    config: NavigatorConfig,
) -> tuple[EscapePath, list[BoolGrid]]:
    """The way out in a part of the map, and the things that the robot stands on there; zones are
    known beyond it."""
    grid = occupancy.part(*box)
    spec, (geometric, ruled) = grid.spec, obstacle_masks(grid)
    own, _ = split_areas(grid, (), profile, pose)
    _, others = split_areas(grid, zones, profile, pose)
    half_width_m, beyond_m = (
        profile.width_m / 2 + config.safety_margin_m,
        profile.circumscribed_radius_m,
    )
    closed = inflate(geometric | others, math.ceil(half_width_m / spec.resolution_m))
    blocked = ~occupancy.free.window(*box)
    inside = blocked | inflate(ruled & ~others, math.ceil(beyond_m / spec.resolution_m) + 1)
    free = CellMask.of(~closed)
    start = nearest_free(
        free, spec.cell(pose.x_m, pose.y_m), config.start_relief_m / spec.resolution_m
    )
    outcome = (
        NoPath(reason=Reason.START_BLOCKED)
        if start is None
        else way_out(closed=closed, inside=inside, start=start)
    )
    return EscapePath(outcome=outcome, spec=spec, corner=box[:2], free=free.plane), own


def _goes_on(areas: Iterable[BoolGrid], box: tuple[int, int, int, int], spec: GridSpec) -> bool:
    """Whether a thing reaches the border of a part of the map: what is another thing here may be a
    part of it farther off."""
    top, left, bottom, right = box
    sides = (
        (top > 0, np.s_[0]),
        (left > 0, np.s_[:, 0]),
        (bottom < spec.rows, np.s_[-1]),
        (right < spec.cols, np.s_[:, -1]),
    )
    return any(area[side].any() for area in areas for open_, side in sides if open_)


def way_out(*, closed: BoolGrid, inside: BoolGrid, start: Cell) -> Path | NoPath:
    """The shortest 8-connected path from start to the nearest cell that is neither closed nor
    inside.

    `closed`: bool (rows, cols), True where the robot's centre may not even pass; `inside`: True
    where it may pass but not stay. Corners are not cut. Exactly optimal (Dijkstra): there are many
    goals, and they are near.
    """
    rows, cols = closed.shape
    if not (0 <= start[0] < rows and 0 <= start[1] < cols):
        return NoPath(reason=Reason.OUTSIDE)
    if closed[start]:
        return NoPath(reason=Reason.START_BLOCKED)
    cells, diagonal = _search(
        np.ascontiguousarray(closed), np.ascontiguousarray(inside), start[0], start[1]
    )
    if len(cells) == 0:
        return NoPath(reason=Reason.UNREACHABLE)
    return Path(cells=cells, length=len(cells) - 1 - diagonal + diagonal * SQRT2)


@compiled
def _search(closed: BoolGrid, inside: BoolGrid, start_row: int, start_col: int) -> tuple[Indices, int]:
    rows, cols = closed.shape
    came_from = np.full(rows * cols, -1, dtype=np.int64)
    best = np.full(rows * cols, np.inf)
    done = np.zeros(rows * cols, dtype=np.bool_)
    start = start_row * cols + start_col
    best[start] = 0.0
    heap = [(0.0, start)]
    while len(heap) > 0:
        cost, node = heapq.heappop(heap)
        if done[node]:
            continue
        done[node] = True
        row, col = node // cols, node % cols
        if not inside[row, col]:
            return _trace(came_from, node, cols)
        for down in range(-1, 2):
            for right in range(-1, 2):
                r, c = row + down, col + right
                if (
                    r < 0
                    or r >= rows
                    or c < 0
                    or c >= cols
                    or closed[r, c]
                    or closed[row, c]
                    or closed[r, col]
                ):
                    continue
                there = cost + (SQRT2 if down != 0 and right != 0 else 1.0)
                if there < best[r * cols + c]:
                    best[r * cols + c], came_from[r * cols + c] = there, node
                    heapq.heappush(heap, (there, r * cols + c))
    return np.empty((0, 2), dtype=np.int64), 0


@compiled
def _trace(came_from: Indices, node: int, cols: int) -> tuple[Indices, int]:
    count, at = 1, node
    while came_from[at] >= 0:
        at = came_from[at]
        count += 1
    cells, diagonal = np.empty((count, 2), dtype=np.int64), 0
    for index in range(count - 1, -1, -1):
        cells[index, 0], cells[index, 1] = node // cols, node % cols
        if index < count - 1:
            diagonal += (
                cells[index, 0] != cells[index + 1, 0] and cells[index, 1] != cells[index + 1, 1]
            )
        node = came_from[node]
    return cells, diagonal
