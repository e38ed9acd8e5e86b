"""Descriptions of blocked cells, for goals that are refused."""

from __future__ import annotations

import numpy as np

from navcore.errors import BlockedGoal
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, Cell, OccupancyGrid
from navcore.grid.nearest import nearest_of, nearest_reachable


def describe_cell(grid: OccupancyGrid, cell: Cell) -> str:
    """Return in words why a blocked cell is blocked."""
    if grid.zones[cell] or any(mask[cell] for _, mask in grid.wide_zones):
        return "inside a beware zone"
    if any(layer[cell] for layer in grid.beware.values()):
        return "on something of the beware list"
    return "inside an obstacle" if grid.geometric[cell] else "too close to an obstacle or a zone"


def check_goal_free(
    grid: OccupancyGrid, blocked: BoolGrid, goal: tuple[float, float], *, robot: Pose2
) -> None:
    """Raise `BlockedGoal` for a goal (x, y) in a blocked cell, with the reason and the nearest free
    position.

    `blocked` is (rows, cols). The position offered is the nearest one that the robot can reach or,
    if the robot is blocked itself, the nearest free one.
    """
    spec = grid.spec
    if not spec.contains(*goal) or not blocked[spec.cell(*goal)]:
        return
    cell = spec.cell(*goal)
    found = nearest_reachable(blocked, spec.cell(robot.x_m, robot.y_m), cell) or nearest_of(
        np.argwhere(~blocked), cell
    )
    nearest = None if found is None else spec.centre(*found)
    instead = (
        ""
        if nearest is None
        else f"; the nearest position where it can is ({nearest[0]:.2f}, {nearest[1]:.2f})"
    )
    where = describe_cell(grid, cell)
    raise BlockedGoal(
        f"goal ({goal[0]:.2f}, {goal[1]:.2f}) lies {where}; the robot cannot stand there{instead}",
        nearest,
    )
