"""The explanation of a path for the console: `navcore.planning.explanation.path_explanation` and
`navcore.planning.explanation.constraint_removal` combined."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from navcore.costmap.costmap import Costmap
from navcore.errors import NotKnown
from navcore.geometry.polyline import metres_along
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, Cell
from navcore.grid.nearest import nearest_of
from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone
from navcore.planning.explanation.constraint_removal import minimum_removal
from navcore.planning.explanation.path_explanation import Rules, path_without, rules_of, stretches
from navcore.planning.explanation.rule_costs import RuleCosts, rule_costs
from navcore.planning.path import NoPath, Path
from navcore.robot.profile import RobotProfile
from web.interface.insight import Alternative, ExplainedRule, Explanation
from web.interface.wire import Position

BUDGET = 2_000_000
"""Search budget of one path; see `navcore.planning.planner.plan`."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExplanationQuery:
    """A path to explain, or the lack of one, on one snapshot of the map."""

    occupancy: Costmap
    """Costmap of the snapshot."""
    beware: BewareList
    """Beware list of the snapshot."""
    zones: tuple[Zone, ...]
    """Zones of the snapshot."""
    pose: Pose2
    """Pose of the robot in the map frame."""
    goal: Position
    """Goal (x, y) in metres of the map frame."""
    goal_tolerance_m: float
    """Largest distance in metres from the goal at which a path to it may end."""
    path: Path | None
    """Path that the robot follows; without one the shortest path is planned and explained."""
    profile: RobotProfile
    """Profile of the robot."""
    safety_margin_m: float
    """Safety margin around the robot, metres."""
    start_relief_m: float
    """Largest distance of the start from the robot whose own cell is blocked, metres."""
    unseen: BoolGrid | None = None
    """(rows, cols) cells that were not seen yet, where they cost more; None where they do not."""
    unknown_price: float = 1.0
    """Price of unseen floor."""

    def rules(self) -> Rules:
        """Return everything that blocks cells."""
        rules = rules_of(
            self.occupancy.grid,
            self.beware,
            self.zones,
            vehicle_width_m=self.profile.width_m,
            safety_margin_m=self.safety_margin_m,
        )
        return replace(rules, unseen=self.unseen, unknown_price=self.unknown_price)

    def start(self, rules: Rules, lifted: Collection[str] = ()) -> Cell:
        """Return the free cell nearest to the robot, or the robot's own cell."""
        here = (self.pose.x_m, self.pose.y_m)
        return self._free_near(here, self.start_relief_m, rules, lifted)

    def end(self, rules: Rules, lifted: Collection[str] = ()) -> Cell:
        """Return the free cell nearest to the goal, as the robot takes it, or the goal's own."""
        return self._free_near(self.goal, self.goal_tolerance_m, rules, lifted)

    def present(self, rules: Rules) -> Path | NoPath:
        """Return the path that the robot follows, or the shortest."""
        return self.path or self.without(rules, ())

    def without(self, rules: Rules, keys: Collection[str]) -> Path | NoPath:
        """Return the shortest path without the rules of some keys."""
        start, end = self.start(rules, keys), self.end(rules, keys)
        return path_without(rules, tuple(keys), start, end, budget=BUDGET)

    def _free_near(
        self, position: Position, within_m: float, rules: Rules, lifted: Collection[str]
    ) -> Cell:
        """Return the nearest free cell within a distance, or the position's own cell."""
        cell = self.occupancy.spec.cell(*position)
        reach = within_m / self.occupancy.spec.resolution_m
        around = math.ceil(reach) + 1
        free = ~rules.blocked(lifted)[
            max(cell[0] - around, 0) : cell[0] + around + 1,
            max(cell[1] - around, 0) : cell[1] + around + 1,
        ]
        near = np.argwhere(free) + np.array([max(cell[0] - around, 0), max(cell[1] - around, 0)])
        return nearest_of(near, cell, reach) or cell


def explain(query: ExplanationQuery) -> Explanation:
    """Explain why the path leads where it does, or what would open one."""
    rules, spec = query.rules(), query.occupancy.spec
    path = query.present(rules)
    if isinstance(path, NoPath):
        # A robot slightly inside a wall starts beside it; a robot inside a zone starts there.
        everything = [rule.key for rule in rules.removable]
        start, end = query.start(rules, everything), query.end(rules, everything)
        lift = minimum_removal(rules, start, end)
        return Explanation(
            goal=query.goal,
            reason=str(path.reason),
            length_m=None,
            path=np.empty((0, 2)),
            stretches=(),
            rules=tuple(
                ExplainedRule(key=rule.key, name=rule.name, along_m=0.0) for rule in rules.removable
            ),
            all_cost_m=None,
            lift=lift,
        )
    parts = stretches(path, rules)
    steps = metres_along(path.cells.astype(np.float64)) * spec.resolution_m
    along: dict[str, float] = {}
    for part in parts:
        if part.key is not None:
            along[part.key] = along.get(part.key, 0.0) + float(
                steps[part.last] - steps[max(part.first - 1, 0)]
            )
    # Where the robot's path ends, which may be beside the goal.
    row, col = path.cells[-1].tolist()
    costs = rule_costs(rules, path, query.start(rules), (row, col), budget=BUDGET)
    return Explanation(
        goal=query.goal,
        reason=None,
        length_m=path.length * spec.resolution_m,
        path=spec.centres(path.cells),
        stretches=parts,
        rules=_explained(rules, costs, along, spec.resolution_m),
        all_cost_m=_metres(costs.together, spec.resolution_m),
        main=costs.main,
        main_cost_m=costs.main_cost * spec.resolution_m,
        lift=None,
    )


def alternative(query: ExplanationQuery, keys: Collection[str]) -> Alternative:
    """Plan the path without some rules; raises `NotKnown` for a key that blocks nothing."""
    rules, metre = query.rules(), query.occupancy.spec.resolution_m
    for key in keys:
        if rules.find(key) is None:
            raise NotKnown(f"no zone or class that closes anything now has the key {key!r:.60}")
    present, other = query.present(rules), query.without(rules, keys)
    if isinstance(other, NoPath):
        return Alternative(
            reason=str(other.reason), length_m=None, difference_m=None, path=np.empty((0, 2))
        )
    difference = (other.length - present.length) * metre if isinstance(present, Path) else None
    points = query.occupancy.spec.centres(other.cells)
    return Alternative(
        reason=None, length_m=other.length * metre, difference_m=difference, path=points
    )


def _explained(
    rules: Rules, costs: RuleCosts, along: Mapping[str, float], metre: float
) -> tuple[ExplainedRule, ...]:
    """Return the rules with their costs in metres, the costliest first, then those along the
    path."""
    found = [
        ExplainedRule(
            key=rule.key,
            name=rule.name,
            along_m=along.get(rule.key, 0.0),
            saves_m=_metres(costs.each[rule.key], metre),
        )
        for rule in rules.removable
    ]
    if "wall" in along:
        found.append(ExplainedRule(key="wall", name="obstacles", along_m=along["wall"]))
    return tuple(sorted(found, key=lambda rule: (-(rule.saves_m or 0.0), -rule.along_m)))


def _metres(cells: float | None, metre: float) -> float | None:
    return None if cells is None else cells * metre
