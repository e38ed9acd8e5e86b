"""Descriptions of blocked cells, for goals that are refused."""

from __future__ import annotations

import cv2
import numpy as np

from navcore.errors import BlockedGoal
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, Cell, OccupancyGrid
from navcore.grid.nearest import nearest_marked, nearest_reachable

IN_ZONE = "inside a beware zone"
"""Where a goal lies that a zone forbids, in words."""


def describe_cell(grid: OccupancyGrid, cell: Cell) -> str:
    """Return in words why a blocked cell is blocked."""
    if grid.zones[cell] or any(mask[cell] for _, mask in grid.wide_zones):
        return IN_ZONE
    if any(layer[cell] for layer in grid.beware.values()):
        return "on something of the beware list"
    return "inside an obstacle" if grid.geometric[cell] else "too close to an obstacle or a zone"


def check_goal_free(
    grid: OccupancyGrid,
    blocked: BoolGrid,
    goal: tuple[float, float],
    *,
    robot: Pose2,
    seen: BoolGrid | None = None,
) -> None:
    """Raise `BlockedGoal` for a goal (x, y) in a blocked cell, with the reason and the nearest free
    position.

    `blocked` and `seen` are (rows, cols). The position offered is the nearest one that the robot
    can reach over floor that was seen, else over any floor, and the nearest free one if the robot
    is blocked itself: an unseen cell behind a wall is often near and counts as free.
    """
    spec = grid.spec
    if not spec.contains(*goal) or not blocked[spec.cell(*goal)]:
        return
    cell = spec.cell(*goal)
    start = spec.cell(robot.x_m, robot.y_m)
    found = (
        (nearest_reachable(blocked | ~_closed(seen), start, cell) if seen is not None else None)
        or nearest_reachable(blocked, start, cell)
        or nearest_marked(~blocked, cell)
    )
    nearest = None if found is None else _to_millimetres(spec.centre(*found))
    raise blocked_goal(goal, describe_cell(grid, cell), nearest=nearest)


def blocked_goal(
    goal: tuple[float, float], where: str, *, nearest: tuple[float, float] | None
) -> BlockedGoal:
    """Return the refusal of a goal (x, y) that lies `where` in words, with the nearest free
    position (x, y); all in metres of the map frame."""
    instead = (
        ""
        if nearest is None
        else f"; the nearest position where it can is ({nearest[0]:.2f}, {nearest[1]:.2f})"
    )
    return BlockedGoal(
        f"goal ({goal[0]:.2f}, {goal[1]:.2f}) lies {where}; the robot cannot stand there{instead}",
        nearest,
    )


def _closed(seen: BoolGrid) -> BoolGrid:
    """Return the seen cells and the single cells between them, which no row of pixels fell on."""
    closed = cv2.morphologyEx(seen.view(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return closed.view(np.bool_)


def _to_millimetres(position: tuple[float, float]) -> tuple[float, float]:
    """Round a position as it is sent, so that its text and its numbers round to the same
    centimetres."""
    return round(position[0], 3), round(position[1], 3)
