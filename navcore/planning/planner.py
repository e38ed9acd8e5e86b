"""The shortest path on the grid, planned from scratch (the paper's Algorithm 1) by jump-point
search.

Lengths are octile: a straight step costs 1, a diagonal one √2, and a diagonal step needs both
orthogonal neighbours free, so that the robot never cuts a corner. The search itself is in
`navcore.planning.search`; over a map that changes use `Replanner`, whose paths are as long as those
of `plan` and cost a fraction of the time.
"""

from __future__ import annotations

import math

from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import BoolGrid, Cell
from navcore.planning.path import REASONS, NoPath, Path
from navcore.planning.search.jump_point_search import ENDLESS, FOUND, find
from navcore.planning.search.open_list import SearchWorkspace

SQRT2 = math.sqrt(2.0)


def plan(
    blocked: BoolGrid, start: Cell, goal: Cell, *, max_expansions: int | None = None
) -> Path | NoPath:
    """Find the shortest 8-connected path from start to goal that cuts no corners.

    `blocked` is bool (rows, cols), True where the robot's centre may not be; `start` and `goal` are
    (row, col). The result is exactly optimal and deterministic. `max_expansions` bounds the search
    (`Reason.TIMEOUT`) by work, not by a clock: by the number of straight walks and diagonal steps,
    of which a query has some ten (open space) to some ten thousand (a maze), or that of cells on
    the open list where a search goes on from cell to cell.
    """
    space = FreeSpace.of(blocked)
    return plan_in(space, SearchWorkspace(space), start, goal, max_expansions=max_expansions)


def plan_in(
    space: FreeSpace,
    workspace: SearchWorkspace,
    start: Cell,
    goal: Cell,
    *,
    max_expansions: int | None = None,
) -> Path | NoPath:
    """Find the shortest path on a packed grid, in memory that is kept from one search to the next;
    see `plan`."""
    budget = ENDLESS if max_expansions is None else max_expansions
    status, cells, diagonal = find(space, workspace, start, goal, budget)
    if status == FOUND:
        return Path(cells=cells, length=len(cells) - 1 - diagonal + diagonal * SQRT2)
    return NoPath(reason=REASONS[status])
