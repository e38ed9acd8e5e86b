"""The shortest path out of a forbidden area, for a robot that stands in it."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from navcore.compiled import compiled, nested
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EscapePath:
    """An escape path, or the reason why none exists, in the part of the map that was searched."""

    outcome: Path | NoPath
    """The path in cells of the part."""
    spec: GridSpec
    """Position and size of the part."""
    corner: Cell
    """First cell of the part, in cells of the map."""
    free: BitPlane
    """Plane of the part's free cells."""
    start: Cell | None = None
    """Cell of the part at which the search began; None where it could not begin."""

    @property
    def on_the_map(self) -> Path | NoPath:
        """The path in cells of the map."""
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
    """Find the shortest path to where no part of the robot is in a forbidden area, however it
    turns; it crosses no area but the one it starts in.

    `zones` are those that the costmap was made with. The surroundings are searched first; their
    path is returned if nothing farther away can be nearer or change it.
    """
    spec, zones = occupancy.spec, tuple(zones)
    within_m = config.planning.escape.first_range_m
    row, col = spec.cell(pose.x_m, pose.y_m)
    if not (0 <= row < spec.rows and 0 <= col < spec.cols):
        return EscapePath(
            outcome=NoPath(reason=Reason.OUTSIDE),
            spec=spec,
            corner=(0, 0),
            free=occupancy.free.plane,
        )
    # What lies beyond the part affects its border: as far as margins reach, and then the body.
    body_m = (
        max(profile.width_m / 2 + config.safety_margin_m, profile.circumscribed_radius_m)
        + 2 * spec.resolution_m
    )
    rim_m = occupancy.widest_margin_m + body_m
    while True:
        box = box_around(spec, pose, within_m + rim_m)
        found, own = _exit_within(occupancy, box, pose, zones, profile, config)
        # The nearest cells decide where the path begins, and whether it can.
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
    """The escape path within a part of the map, and the areas that the robot stands in there; zones
    are known beyond it."""
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
        else nearest_exit(closed=closed, inside=inside, start=start)
    )
    found = EscapePath(outcome=outcome, spec=spec, corner=box[:2], free=free.plane, start=start)
    return found, own


def _goes_on(areas: Iterable[BoolGrid], box: tuple[int, int, int, int], spec: GridSpec) -> bool:
    """Whether an area reaches the border of a part of the map: what is another area here may be
    connected with it farther off."""
    top, left, bottom, right = box
    sides = (
        (top > 0, np.s_[0]),
        (left > 0, np.s_[:, 0]),
        (bottom < spec.rows, np.s_[-1]),
        (right < spec.cols, np.s_[:, -1]),
    )
    return any(area[side].any() for area in areas for open_, side in sides if open_)


def nearest_exit(*, closed: BoolGrid, inside: BoolGrid, start: Cell) -> Path | NoPath:
    """Find the shortest 8-connected path from start to the nearest cell that is neither closed nor
    inside.

    `closed` is bool (rows, cols), True where the robot's centre may not even pass; `inside` is True
    where it may pass but not stay. Corners are not cut. The path is exactly optimal (Dijkstra):
    there are many goals, and they are near.
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
def _search(
    closed: BoolGrid, inside: BoolGrid, start_row: int, start_col: int
) -> tuple[Indices, int]:
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


@nested
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
