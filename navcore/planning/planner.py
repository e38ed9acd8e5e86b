"""The shortest path on the grid, in full, from scratch (the paper's Algorithm 1), found by jump-point search.

Lengths are octile: a straight step costs 1, a diagonal one √2, and a diagonal step needs both orthogonal neighbours free, so
that the robot never cuts a corner. The search itself is in `navcore.search`; over a map that changes use its `Replanner`, whose
paths are as long as those of `plan` and cost a fraction of the time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import BoolGrid, Cell
from navcore.planning.search.jump_point_search import FOUND, GOAL_BLOCKED, OUTSIDE, START_BLOCKED, TIMEOUT, UNREACHABLE, find
from navcore.planning.search.open_list import Arena

SQRT2 = math.sqrt(2.0)


class Reason(StrEnum):
    """Why there is no path."""

    START_BLOCKED = "start blocked"
    """The robot's own cell is blocked."""
    GOAL_BLOCKED = "goal blocked"
    """The goal's cell lies in an obstacle or a zone, or closer to one than the robot's body allows."""
    OUTSIDE = "outside the map"
    """Start or goal is no cell of the grid."""
    UNREACHABLE = "unreachable"
    """Every way to the goal is closed."""
    TIMEOUT = "time budget exceeded"
    """The search was given up."""


REASONS = {
    UNREACHABLE: Reason.UNREACHABLE,
    TIMEOUT: Reason.TIMEOUT,
    OUTSIDE: Reason.OUTSIDE,
    START_BLOCKED: Reason.START_BLOCKED,
    GOAL_BLOCKED: Reason.GOAL_BLOCKED,
}
"""By how a search ended without a path."""
ENDLESS = 1 << 62
"""The budget of a search that must not be given up."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Path:
    """A shortest path."""

    cells: npt.NDArray[np.int64]
    """(N, 2) every cell (row, col) from start to goal."""
    length: float
    """In cells: straight steps + √2 · diagonal steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoPath:
    """There is no path, and why."""

    reason: Reason
    """What stands in the way."""


def plan(blocked: BoolGrid, start: Cell, goal: Cell, *, max_expansions: int | None = None) -> Path | NoPath:
    """The shortest 8-connected path from start to goal without cutting corners.

    `blocked` is bool (rows, cols), True where the robot's centre may not be; `start` and `goal` are (row, col). The result is
    exactly optimal and deterministic. `max_expansions` bounds the search (`Reason.TIMEOUT`) by work, not by a clock: by the
    number of straight walks and diagonal steps, of which a query has some ten (free view) to some ten thousand (a maze).
    """
    space = FreeSpace.of(blocked)
    return plan_in(space, Arena(space), start, goal, max_expansions=max_expansions)


def plan_in(space: FreeSpace, arena: Arena, start: Cell, goal: Cell, *, max_expansions: int | None = None) -> Path | NoPath:
    """The same over a grid that is packed already, in memory that is kept from one search to the next."""
    budget = ENDLESS if max_expansions is None else max_expansions
    status, cells, diagonal = find(space, arena, start, goal, budget)
    if status == FOUND:
        return Path(cells=cells, length=len(cells) - 1 - diagonal + diagonal * SQRT2)
    return NoPath(reason=REASONS[status])
