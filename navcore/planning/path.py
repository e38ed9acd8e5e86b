"""A planned grid path, or the reason why none exists."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from navcore.planning.search.jump_point_search import (
    GOAL_BLOCKED,
    OUTSIDE,
    START_BLOCKED,
    TIMEOUT,
    UNREACHABLE,
)


class Reason(StrEnum):
    """Reason why no path exists."""

    START_BLOCKED = "start blocked"
    """The robot's own cell is blocked."""
    GOAL_BLOCKED = "goal blocked"
    """The goal's cell lies in an obstacle or a zone, or closer to one than the robot's body allows.
    """
    OUTSIDE = "outside the map"
    """Start or goal is no cell of the grid."""
    UNREACHABLE = "unreachable"
    """Start and goal are not connected."""
    TIMEOUT = "time budget exceeded"
    """The search was given up."""


REASONS = {
    UNREACHABLE: Reason.UNREACHABLE,
    TIMEOUT: Reason.TIMEOUT,
    OUTSIDE: Reason.OUTSIDE,
    START_BLOCKED: Reason.START_BLOCKED,
    GOAL_BLOCKED: Reason.GOAL_BLOCKED,
}
"""Reasons by the status of a search that ended without a path."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Path:
    """A shortest path on the grid."""

    cells: npt.NDArray[np.int64]
    """(N, 2) all cells (row, col) from start to goal."""
    length: float
    """Length in cells: straight steps + √2 · diagonal steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoPath:
    """The outcome without a path."""

    reason: Reason
    """Reason why no path exists."""
