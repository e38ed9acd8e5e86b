"""The explanation of a path, composed for the console out of `navcore.explain` and
`navcore.lifting`."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from navcore.costmap.costmap import Costmap
from navcore.errors import NotKnown
from navcore.geometry.polyline import metres_along
from navcore.geometry.transform import Pose2
from navcore.grid.grid import Cell
from navcore.grid.nearest import nearest_of
from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone
from navcore.planning.constraint_removal import minimum_removal
from navcore.planning.path import NoPath, Path
from navcore.planning.path_explanation import Rules, path_without, rules_of, stretches
from navcore.robot.profile import RobotProfile
from web.insight import Alternative, ExplainedRule, Explanation, Place

MAX_COSTED = 12
"""For so many rules it is worked out what each costs."""
BUDGET = 2_000_000
"""Of one search for a path; see `navcore.path.plan`."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExplanationQuery:
    """What is to be explained: a path or the lack of one, over one snapshot of the map."""

    occupancy: Costmap
    """The map."""
    beware: BewareList
    """The list it was made under."""
    zones: tuple[Zone, ...]
    """The zones it was made under."""
    pose: Pose2
    """Where the robot is."""
    goal: Place
    """Where it wants to go."""
    path: Path | None
    """What the robot follows; None when it follows none: then the shortest path is planned here."""
    profile: RobotProfile
    """Its body."""
    safety_margin_m: float
    """Room beyond it."""
    start_relief_m: float
    """So far off a free cell is looked for where the robot's own is closed."""

    def rules(self) -> Rules:
        """All that closes cells."""
        return rules_of(
            self.occupancy.grid,
            self.beware,
            self.zones,
            vehicle_width_m=self.profile.width_m,
            safety_margin_m=self.safety_margin_m,
        )

    @property
    def target(self) -> Cell:
        """The goal's cell."""
        return self.occupancy.spec.cell(*self.goal)

    def start(self, rules: Rules, lifted: Collection[str] = ()) -> Cell:
        """The free cell nearest to the robot, or the robot's own."""
        cell = self.occupancy.spec.cell(self.pose.x_m, self.pose.y_m)
        reach = self.start_relief_m / self.occupancy.spec.resolution_m
        around = math.ceil(reach) + 1
        free = ~rules.blocked(lifted)[
            max(cell[0] - around, 0) : cell[0] + around + 1,
            max(cell[1] - around, 0) : cell[1] + around + 1,
        ]
        near = np.argwhere(free) + np.array([max(cell[0] - around, 0), max(cell[1] - around, 0)])
        return nearest_of(near, cell, reach) or cell


def explained(case: ExplanationQuery) -> Explanation:
    """Why the path leads where it does, or what would open one."""
    rules, spec = case.rules(), case.occupancy.spec
    start = case.start(rules)
    path = case.path or path_without(rules, (), start, case.target, budget=BUDGET)
    if isinstance(path, NoPath):
        # A robot that stands in a wall by a hair starts beside it; one that stands in a zone starts
        # there.
        everything = [rule.key for rule in rules.liftable]
        lift = minimum_removal(rules, case.start(rules, everything), case.target)
        return Explanation(
            goal=case.goal,
            reason=str(path.reason),
            length_m=None,
            points=np.empty((0, 2)),
            stretches=(),
            rules=tuple(
                ExplainedRule(key=rule.key, name=rule.name, along_m=0.0) for rule in rules.liftable
            ),
            all_cost_m=None,
            lift=lift.keys,
            lift_exact=lift.exact,
            lift_at_least=lift.at_least,
        )
    parts = stretches(path, rules)
    steps = metres_along(path.cells.astype(np.float64)) * spec.resolution_m
    along: dict[str, float] = {}
    for part in parts:
        if part.key is not None:
            along[part.key] = along.get(part.key, 0.0) + float(
                steps[part.last] - steps[max(part.first - 1, 0)]
            )
    return Explanation(
        goal=case.goal,
        reason=None,
        length_m=path.length * spec.resolution_m,
        points=spec.centres(path.cells),
        stretches=tuple((part.key, part.first, part.last) for part in parts),
        rules=_costed(case, rules, path, along),
        all_cost_m=_all_cost_m(case, rules, path),
        lift=(),
        lift_exact=True,
        lift_at_least=0,
    )


def alternative(case: ExplanationQuery, keys: Collection[str]) -> Alternative:
    """The path if some rules did not stand; raises `NotKnown` for a key that closes nothing here."""
    rules, metre = case.rules(), case.occupancy.spec.resolution_m
    for key in keys:
        if rules.find(key) is None:
            raise NotKnown(f"no zone or class that closes anything now has the key {key!r:.60}")
    present = case.path or path_without(rules, (), case.start(rules), case.target, budget=BUDGET)
    other = path_without(rules, tuple(keys), case.start(rules, keys), case.target, budget=BUDGET)
    if isinstance(other, NoPath):
        return Alternative(
            reason=str(other.reason), length_m=None, difference_m=None, points=np.empty((0, 2))
        )
    difference = (other.length - present.length) * metre if isinstance(present, Path) else None
    points = case.occupancy.spec.centres(other.cells)
    return Alternative(
        reason=None, length_m=other.length * metre, difference_m=difference, points=points
    )


def _costed(
    case: ExplanationQuery, rules: Rules, path: Path, along: dict[str, float]
) -> tuple[ExplainedRule, ...]:
    """What each rule costs by itself, as many as there is time for: first those along the path,
    then those nearest to the straight line, for a rule that the path gives a wide berth may cost
    the most."""
    start, metre = case.start(rules), case.occupancy.spec.resolution_m
    whole = (
        [ExplainedRule(key="wall", name="obstacles", along_m=along["wall"])]
        if "wall" in along
        else []
    )
    steps = np.linspace(start, case.target, 200).round().astype(np.int64)
    ranked = sorted(
        rules.liftable,
        key=lambda rule: (-along.get(rule.key, 0.0), float(rule.at(steps).min()), rule.key),
    )
    for rank, rule in enumerate(ranked):
        other = (
            path_without(rules, [rule.key], start, case.target, budget=BUDGET)
            if rank < MAX_COSTED
            else None
        )
        saves = max((path.length - other.length) * metre, 0.0) if isinstance(other, Path) else None
        whole.append(
            ExplainedRule(
                key=rule.key, name=rule.name, along_m=along.get(rule.key, 0.0), saves_m=saves
            )
        )
    return tuple(sorted(whole, key=lambda rule: -(rule.saves_m or 0.0)))


def _all_cost_m(case: ExplanationQuery, rules: Rules, path: Path) -> float | None:
    """What all rules together cost: more than the sum of each where they close one another's ways
    round."""
    free = path_without(
        rules, [rule.key for rule in rules.liftable], case.start(rules), case.target, budget=BUDGET
    )
    return (
        (path.length - free.length) * case.occupancy.spec.resolution_m
        if isinstance(free, Path)
        else None
    )
