"""Viewpoints before detours: where only safety margins or people close a much shorter way, the
robot looks at the place from near before it takes the way round.

From afar depth scatters, and a door appears narrower than it is; a person who stood in it may have
walked on. The way round may lead through rooms that were not seen yet, whose walls only lengthen
it. So when the path to a goal is first planned, or has become much longer, the shortest way is
searched for in which a metre of cells that nothing else closes costs as much as some metres of free
ones (a path that cut every corner through the margins would be hardly shorter). If it saves more
than the way to the first such place and back, the robot drives up to it. From there the place is
believed.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from navcore.config.planning import GapViewpointConfig
from navcore.costmap.costmap import Costmap
from navcore.geometry.arrays import Points
from navcore.geometry.polyline import metres_along
from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import BitPlane, contains, unpack
from navcore.grid.grid import Cell
from navcore.planning.gap_viewpoint import closed_by_margins
from navcore.planning.path import Path
from navcore.planning.weighted_planner import plan_weighted


@dataclass(frozen=True, slots=True, kw_only=True)
class _Gap:
    """The first place at which a shorter way is closed."""

    viewpoint: Cell
    """The last free cell before it, (row, col)."""
    viewpoint_m: float
    """Length of the way up to there in metres."""
    saved_m: float
    """Length in metres by which the way is shorter than the path."""
    is_open_otherwise: bool
    """Whether only margins or people close the way, here and farther on."""


class DetourViewpoint:
    """Compares each path to a goal with the one before; remembers where the robot has looked."""

    def __init__(self, rules: GapViewpointConfig, *, vehicle_width_m: float, body_m: float) -> None:
        """`body_m` is that of the map: geometric cells this near to a person are the person's."""
        self._rules, self._width_m, self._body_m = rules, vehicle_width_m, body_m
        self._goal: tuple[float, float] | None = None
        self._expected_m = 0.0
        self._way: Points | None = None
        self._viewpoint: tuple[float, float] | None = None
        self._looked = list[tuple[float, float]]()

    def before(
        self,
        path: Path,
        costmap: Costmap,
        pose: Pose2,
        goal: tuple[float, float],
        people: Collection[int],
    ) -> Cell | None:
        """Return the cell (row, col) to look from before the robot takes the path, which is the
        shortest to the goal, (x, y) in the map frame; None to take it.

        `people` are the class ids of the beware list that are people, who walk on.
        """
        if goal != self._goal:
            self._goal, self._expected_m = goal, pose.distance_to(*goal)
            self._way, self._viewpoint, self._looked = None, None, []
        length_m = path.length * costmap.spec.resolution_m
        viewpoint = None
        if self._way is not None or length_m > self._expected_m + self._rules.detour_m:
            margins = closed_by_margins(
                costmap, people, vehicle_width_m=self._width_m, body_m=self._body_m
            )
            if self._way is None:
                self._way = self._shortest_way(path, costmap, margins)
            viewpoint = self._worth_a_look(length_m, costmap, pose, margins)
        if viewpoint is None:
            self._way = None
        self._expected_m = length_m
        return viewpoint

    def _shortest_way(self, path: Path, costmap: Costmap, margins: BitPlane) -> Points | None:
        """Return (N, 2) the centres of the cells of the cheapest way, metres of the map frame."""
        spec = costmap.spec
        closed = unpack(margins, spec.rows, spec.cols)
        start, goal = ((int(row), int(col)) for row, col in path.cells[[0, -1]])
        found = plan_weighted(
            ~costmap.blocked | closed,
            closed,
            self._rules.gap_price,
            start,
            goal,
            max_expansions=self._rules.gap_search_cells,
        )
        return spec.centres(found.cells) if isinstance(found, Path) else None

    def _worth_a_look(
        self, length_m: float, costmap: Costmap, pose: Pose2, margins: BitPlane
    ) -> Cell | None:
        """Return the viewpoint before the first place that closes the way, if it is still worth a
        look."""
        rules = self._rules
        gap = None if self._way is None else _first_gap(self._way, length_m, costmap, pose, margins)
        if gap is None or not gap.is_open_otherwise:
            return None
        if gap.saved_m <= max(rules.detour_m, 2 * gap.viewpoint_m):
            return None
        x, y = costmap.spec.centre(*gap.viewpoint)
        if any(np.hypot(x - a, y - b) <= rules.gap_m for a, b in self._looked):
            return None
        self._viewpoint = x, y
        if pose.distance_to(x, y) <= rules.gap_reached_m:
            self.end_look()
            return None
        return gap.viewpoint

    def end_look(self) -> None:
        """Believe what was seen of the gap so far: it is not looked at again."""
        if self._viewpoint is not None:
            self._looked.append(self._viewpoint)
        self._viewpoint, self._way = None, None


def _first_gap(
    way: Points, length_m: float, costmap: Costmap, pose: Pose2, margins: BitPlane
) -> _Gap | None:
    """Return where a way, (N, 2) in the map frame, is closed first from beside the robot on; None
    where it is free."""
    here = int(np.hypot(way[:, 0] - pose.x_m, way[:, 1] - pose.y_m).argmin())
    way, free = way[here:], costmap.free.plane
    cells = [costmap.spec.cell(x, y) for x, y in way.tolist()]
    closed = [index for index, cell in enumerate(cells) if not contains(free, cell)]
    if not closed or closed[0] == 0:
        return None
    metres, before = metres_along(way), closed[0] - 1
    return _Gap(
        viewpoint=cells[before],
        viewpoint_m=float(metres[before]),
        saved_m=length_m - float(metres[-1]),
        is_open_otherwise=all(contains(margins, cells[index]) for index in closed),
    )
