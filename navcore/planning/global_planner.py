"""The global planner: the route from the robot to the goal, planned in full at every change."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import Costmap
from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import BitPlane, plane_of
from navcore.grid.free_space import FREE, FreeSpace
from navcore.grid.grid import Box, Cell, GridSpec
from navcore.grid.growth import Growth
from navcore.grid.inflation import inflated
from navcore.grid.nearest import nearest_free
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.planning.border import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    lacking_cells,
    sides_reached,
)
from navcore.planning.detour_viewpoint import DetourViewpoint
from navcore.planning.escape import EscapePath, escape_path
from navcore.planning.gap_viewpoint import viewpoint_before_gap
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan_in
from navcore.planning.replanner import Replanner
from navcore.planning.route import Route, build_route, no_route
from navcore.planning.search.open_list import SearchWorkspace
from navcore.planning.weighted_planner import WeightedPlanner, path_cost, plan_weighted
from navcore.robot.profile import RobotProfile

ESCAPE_WITHIN_M = 50.0
"""Distance in metres of a border of the grid beyond which no grid is searched that is larger for
the way out of an area: a search takes seconds there."""
ESCAPE_WAITS = 20
"""Number of changes of the map after which a way out of an area is searched for again, if it was
found nowhere on the grid."""


class GlobalPlanner:
    """Plans on the live free space of a costmap; keeps the newest route until something changes."""

    def __init__(
        self,
        space: FreeSpace,
        explored: VisibilityMap,
        profile: RobotProfile,
        config: NavigatorConfig,
    ) -> None:
        self._space, self._explored = space, explored
        self._profile, self._config = profile, config
        self._price = config.planning.unknown_price
        self._replanner, self._weighted = Replanner(space), WeightedPlanner()
        self._escape_waits = 0
        self._too_large: tuple[Cell, float] | None = None
        """Goal and price of unseen floor for which the search would take too long: the shortest
        path is followed."""
        self.lacking: Box | None = None
        """Part of the map that the grid has to contain before the newest route can be believed: a
        shorter one may lead through cells outside the grid. None where it is the shortest."""
        self._newest: tuple[tuple[object, ...], Route] | None = None
        self._reachable_goal: tuple[float, float] | None = None
        self._gap: tuple[tuple[float, float], tuple[float, float]] | None = None
        """Goal, and viewpoint before the gap that the robot drives to, both in the map frame."""
        self._detour = DetourViewpoint(
            config.planning.viewpoint,
            vehicle_width_m=profile.width_m,
            body_m=config.map.body_m,
        )

    def route(
        self,
        costmap: Costmap,
        pose: Pose2,
        request: NavigationRequest,
        keep_outs: tuple[Zone, ...],
        replan: Replan,
    ) -> Route | None:
        """Return the shortest route, or None without a goal.

        `replan` runs only when the costmap, the goal, the price of unseen floor or the robot's cell
        has changed since the last call. `keep_outs` are the zones of the navigator's own that the
        costmap contains beside the operator's.
        """
        self.lacking = None
        if request.goal is None and not request.leave:
            self._escape_waits = 0
            return None
        self._price = self._price_of(request.unknown_price)
        cell = costmap.spec.cell(pose.x_m, pose.y_m)
        seen_m2 = self._explored.area_m2 if self._price > 1 else None  # else unseen floor is free
        key = (costmap.version, request.goal, cell, self._price, seen_m2)
        if self._newest is None or self._newest[0] != key:
            if request.goal is not None:
                self._escape_waits = 0
                route = replan(self, costmap, pose, request.goal, request.beware)
            elif self._newest is not None and self._escape_waits > 0:
                self._escape_waits -= 1
                return self._newest[1]
            else:
                route = self.escape(costmap, pose, (*request.zones, *keep_outs))
            self._newest = (key, route)
            if isinstance(route.outcome, Path):
                self._reachable_goal = request.goal
        return self._newest[1]

    def grow(self, space: FreeSpace, growth: Growth) -> None:
        """Continue on the space of a larger grid; the present path stays in its place, unless the
        grid was too small to know whether it is the shortest."""
        self._space = space
        self._replanner.grow(space, growth)
        if self.lacking is not None:
            self._replanner.search_again()
        self._weighted, self._too_large = WeightedPlanner(), None

    def plan(
        self, costmap: Costmap, pose: Pose2, goal: tuple[float, float], beware: BewareList
    ) -> Route:
        """Plan from a pose to a goal (x, y), map frame, on the live free space.

        A goal that is too close to something ends the path beside it, within the tolerance.
        Where a path has become much longer because of a gap that only margins or people close, the
        route leads to a viewpoint before that gap first (`Route.is_look`).
        Without a path the route leads to a viewpoint before the gap that is most likely to be
        open, or next to a goal that was reachable before; its outcome still says why no path
        exists.
        """
        start = self._start(costmap, pose)
        if start is None:
            return no_route(Reason.START_BLOCKED)
        end, point = self._end(costmap, goal)
        outcome = self._search(costmap, start, end)
        alternative, lacking = None, self.lacking
        if isinstance(outcome, Path):
            self._gap = None
            look = self._detour.before(outcome, costmap, pose, goal, beware.people_ids)
            if look is not None:
                alternative = self._to_look(costmap, start, look, outcome)
        if outcome == NoPath(reason=Reason.UNREACHABLE):
            alternative = self._to_viewpoint(costmap, pose, goal, beware)
        elif (
            outcome == NoPath(reason=Reason.GOAL_BLOCKED)
            and self._reachable_goal == goal
            and pose.distance_to(*goal) > self._config.planning.viewpoint.goal_believed_m
        ):
            alternative = self._to_goal_neighbour(costmap, start, goal)
        self.lacking = lacking
        return alternative or self._built(outcome, point, costmap.spec)

    def preview(
        self,
        costmap: Costmap,
        pose: Pose2,
        goal: tuple[float, float],
        *,
        unknown_price: float | None = None,
    ) -> Route:
        """Plan from scratch over any costmap; changes nothing and may run in any thread.

        `unknown_price`: as in `NavigationRequest`.
        """
        start = self._start(costmap, pose)
        if start is None:
            return no_route(Reason.START_BLOCKED)
        space, budget = FreeSpace.of(costmap.blocked), self._config.plan_budget
        end, point = self._end(costmap, goal)
        ends, price = (start, end), self._price_of(unknown_price)
        if price > 1:
            unseen, free = self._explored.unseen_on(costmap.spec), ~costmap.blocked
            outcome = plan_weighted(free, unseen, price, *ends, max_expansions=budget)
        if price == 1 or outcome == NoPath(reason=Reason.TIMEOUT):
            outcome = plan_in(space, SearchWorkspace(space), *ends, max_expansions=budget)
        return build_route(
            outcome, point, space.across[FREE], costmap.spec, self._profile, self._config
        )

    def escape(self, costmap: Costmap, pose: Pose2, zones: tuple[Zone, ...]) -> Route:
        """Plan the shortest route out of the forbidden area the robot stands in.

        At its end no part of the robot is in a forbidden area, however it turns, and it crosses no
        area but the one it starts in. `zones` are those that the costmap was made with.
        """
        found = escape_path(costmap, pose, zones, self._profile, self._config)
        if found.outcome == NoPath(reason=Reason.UNREACHABLE):
            self.lacking = _beyond_escape(found)  # all of the grid was searched
            self._escape_waits = ESCAPE_WAITS if self.lacking is None else 0
        if isinstance(found.outcome, NoPath):
            return no_route(found.outcome.reason)
        goal = found.spec.centre(*found.outcome.cells[-1])
        route = build_route(
            found.outcome, goal, found.free, found.spec, self._profile, self._config
        )
        return dataclasses.replace(route, outcome=found.on_the_map)

    def _to_viewpoint(
        self, costmap: Costmap, pose: Pose2, goal: tuple[float, float], beware: BewareList
    ) -> Route | None:
        """The route to a viewpoint before a gap; None if there is none or the robot is there."""
        spec, present = costmap.spec, self._present_gap(costmap, pose, goal)
        ends = viewpoint_before_gap(
            costmap,
            spec.cell(pose.x_m, pose.y_m),
            spec.cell(*goal),
            people=beware.people_ids,
            vehicle_width_m=self._profile.width_m,
            relief_cells=self._config.start_relief_m / spec.resolution_m,
            body_m=self._config.map.body_m,
            present=present,
        )
        self._gap = None if ends is None else (goal, spec.centre(*ends[1]))
        if ends is None:
            return None
        workspace, budget = SearchWorkspace(self._space), self._config.plan_budget
        path = plan_in(self._space, workspace, *ends, max_expansions=budget)
        if not isinstance(path, Path):
            return None
        route = self._built(path, spec.centre(*ends[1]), spec)
        return dataclasses.replace(route, outcome=NoPath(reason=Reason.UNREACHABLE))

    def _to_look(self, costmap: Costmap, start: Cell, look: Cell, outcome: Path) -> Route | None:
        """The route to a cell from which the robot looks at a gap before it takes a path; None if
        there is none."""
        budget, space = self._config.plan_budget, self._space
        path = plan_in(space, SearchWorkspace(space), start, look, max_expansions=budget)
        if not isinstance(path, Path):
            return None
        route = self._built(path, costmap.spec.centre(*look), costmap.spec)
        round_m = outcome.length * costmap.spec.resolution_m
        return dataclasses.replace(route, outcome=outcome, round_m=round_m)

    def end_look(self) -> None:
        """Take the way round: the robot cannot come to the viewpoint."""
        self._detour.end_look()
        self._newest = None

    def _present_gap(
        self, costmap: Costmap, pose: Pose2, goal: tuple[float, float]
    ) -> BitPlane | None:
        """The surroundings of the gap that the robot drives to; None when it drives to none, or has
        reached it."""
        rules, spec = self._config.planning.viewpoint, costmap.spec
        if self._gap is None or self._gap[0] != goal:
            return None
        viewpoint = self._gap[1]
        if pose.distance_to(*viewpoint) <= rules.gap_reached_m:
            return None
        radius = math.ceil(rules.gap_m / spec.resolution_m)
        centre = plane_of(spec.cell(*viewpoint), like=costmap.free.plane)
        return inflated({radius: centre}, spec.rows, spec.cols)

    def _to_goal_neighbour(
        self, costmap: Costmap, start: Cell, goal: tuple[float, float]
    ) -> Route | None:
        """The route to a free cell next to a goal that something now occupies, to look again.

        None where there is no such cell, and where an operator's zone lies on the goal or near it:
        a zone does not go away by being looked at.
        """
        grid, spec, (row, col) = costmap.grid, costmap.spec, costmap.spec.cell(*goal)
        within = self._config.planning.viewpoint.goal_neighbour_m / spec.resolution_m
        reach = math.ceil(within)
        window = np.s_[max(row - reach, 0) : row + reach + 1, max(col - reach, 0) : col + reach + 1]
        neighbour = nearest_free(costmap.free, (row, col), within)
        zones = (grid.zones, *(zone for _, zone in grid.wide_zones))
        if neighbour is None or any(layer[window].any() for layer in zones):
            return None
        path = self._search(costmap, start, neighbour)
        route = self._built(path, spec.centre(*neighbour), spec)
        return dataclasses.replace(route, outcome=NoPath(reason=Reason.GOAL_BLOCKED))

    def _price_of(self, asked: float | None) -> float:
        return self._config.planning.unknown_price if asked is None else asked

    def _search(self, costmap: Costmap, start: Cell, goal: Cell) -> Path | NoPath:
        """The path of the live search: the shortest, or the cheapest where unseen floor costs and
        that is found in time."""
        budget, priced = self._config.plan_budget, (goal, self._price)
        if self._price == 1 or self._too_large == priced:
            searches = self._replanner.searches
            outcome = self._replanner.plan(start, goal, max_expansions=budget)
            if self._replanner.searches != searches:
                # A path that is kept is as short as when it was searched for.
                self.lacking = lacking_cells(self._space, start, goal, outcome)
            return outcome
        free, unseen = ~costmap.blocked, self._explored.unseen_on(costmap.spec)
        found = self._weighted.plan(free, unseen, self._price, start, goal, max_expansions=budget)
        if found == NoPath(reason=Reason.TIMEOUT):
            # A preference for seen floor keeps no goal from being reached.
            self._too_large = priced
            return self._search(costmap, start, goal)
        bound = found
        if isinstance(found, Path):
            # Outside the grid no path costs less than its length.
            cost = path_cost(found.cells, free, unseen, self._price)
            bound = Path(cells=found.cells, length=cost)
        self.lacking = lacking_cells(self._space, start, goal, bound)
        return found

    def _start(self, costmap: Costmap, pose: Pose2) -> Cell | None:
        spec = costmap.spec
        relief = self._config.start_relief_m / spec.resolution_m
        return nearest_free(costmap.free, spec.cell(pose.x_m, pose.y_m), relief)

    def _end(self, costmap: Costmap, goal: tuple[float, float]) -> tuple[Cell, tuple[float, float]]:
        """The cell and the point where a path to the goal ends: the goal's own, or where that is
        blocked those of the nearest free cell within the tolerance."""
        spec = costmap.spec
        own = spec.cell(*goal)
        within = goal_tolerance_m(self._config, self._profile) / spec.resolution_m
        end = nearest_free(costmap.free, own, within)
        return (own, goal) if end is None or end == own else (end, spec.centre(*end))

    def _built(self, outcome: Path | NoPath, goal: tuple[float, float], spec: GridSpec) -> Route:
        free = self._space.across[FREE]
        return build_route(outcome, goal, free, spec, self._profile, self._config)


def _beyond_escape(found: EscapePath) -> Box | None:
    """Return the part in which an area may end that ends nowhere on the grid; None where the robot
    is kept from the border, or has it `ESCAPE_WITHIN_M` away.

    Each border that is reached comes to be twice as far from the robot, since all of the grid is
    searched again.
    """
    if found.start is None:
        return None
    rows, cols, (row, col) = found.spec.rows, found.spec.cols, found.start
    away = {TOP: row, LEFT: col, BOTTOM: rows - 1 - row, RIGHT: cols - 1 - col}
    reached = sides_reached(found.free, rows, cols, found.start)
    within = math.ceil(ESCAPE_WITHIN_M / found.spec.resolution_m)
    lines = {
        side: min(max(cells, 1), within - cells) if reached & side and cells < within else 0
        for side, cells in away.items()
    }
    if not any(lines.values()):
        return None
    return -lines[TOP], -lines[LEFT], rows + lines[BOTTOM], cols + lines[RIGHT]


def goal_tolerance_m(config: NavigatorConfig, profile: RobotProfile) -> float:
    """Return the largest distance in metres from a goal at which a path to it may end. A goal in a
    zone or an obstacle stays blocked: no free cell is that near to it, since the tolerance is at
    most half of the robot's width."""
    return min(config.planning.goal_tolerance_m, profile.width_m / 2)


Replan = Callable[[GlobalPlanner, Costmap, Pose2, tuple[float, float], BewareList], Route]
"""The signature of `GlobalPlanner.plan`."""
