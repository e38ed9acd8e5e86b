"""What makes a cell unfit to stand on, in words."""

from __future__ import annotations

import numpy as np

from navcore.errors import BlockedGoal
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, Cell, OccupancyGrid
from navcore.grid.nearest import nearest_of, nearest_reachable


def describe_cell(grid: OccupancyGrid, cell: Cell) -> str:
    """Of a cell that is blocked."""
    if grid.zones[cell] or any(mask[cell] for _, mask in grid.wide_zones):
        return "inside a beware zone"
    if any(layer[cell] for layer in grid.beware.values()):
        return "on something of the beware list"
    return "inside an obstacle" if grid.geometric[cell] else "too close to an obstacle or a zone"


def check_goal_free(
    grid: OccupancyGrid, blocked: BoolGrid, place: tuple[float, float], *, robot: Pose2
) -> None:
    """Raise `BlockedGoal` where the robot's centre may not be: what is there, and the nearest place
    where it may.

    `blocked` is (rows, cols). Offered is the nearest place that the robot can get to or, where it
    can get nowhere, any other.
    """
    spec = grid.spec
    if not spec.contains(*place) or not blocked[spec.cell(*place)]:
        return
    cell = spec.cell(*place)
    found = nearest_reachable(blocked, spec.cell(robot.x_m, robot.y_m), cell) or nearest_of(
        np.argwhere(~blocked), cell
    )
    nearest = None if found is None else spec.centre(*found)
    instead = (
        ""
        if nearest is None
        else f"; the nearest place where it can is ({nearest[0]:.2f}, {nearest[1]:.2f})"
    )
    where = describe_cell(grid, cell)
    raise BlockedGoal(
        f"goal ({place[0]:.2f}, {place[1]:.2f}) lies {where}; the robot cannot stand there{instead}",
        nearest,
    )
