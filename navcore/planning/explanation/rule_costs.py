"""Counterfactual cost of each rule: the length by which the shortest path would be shorter without
it.

Every rule is asked, whether the path touches it or not: the zone that closes a corridor costs most
and lies far from the detour. A rule whose cells are so far off that no path through them is shorter
than the present one costs nothing, and needs no search.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.grid.grid import Cell
from navcore.planning.explanation.path_explanation import Rule, Rules, path_without
from navcore.planning.path import Path
from navcore.planning.planner import SQRT2

SAME = 1e-6
"""Difference in cells below which two paths are as long."""
MAIN_SHARE = 0.5
"""Share of the cost of all rules from which one rule by itself is the cause of a detour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleCosts:
    """Counterfactual costs of all rules for one path, in cells of length."""

    each: Mapping[str, float | None]
    """Cost of each removable rule by key; None where the search was given up."""
    together: float | None
    """Cost of all rules together, more than the sum of each where they close the detours of one
    another; None where the search was given up."""
    main: tuple[str, ...]
    """Keys of the rules that make the path longer: the costliest one where it has at least half of
    the cost of all, otherwise a set without a superfluous rule that has all of it; empty when no
    rule costs anything."""
    main_cost: float
    """Cost of the rules in `main` together."""


def rule_costs(rules: Rules, path: Path, start: Cell, goal: Cell, *, budget: int) -> RuleCosts:
    """Compute the cost of every removable rule for the shortest path from start to goal, (row, col)
    both; `budget` bounds each search as in `navcore.planning.planner.plan`."""

    def saved(keys: Collection[str]) -> float | None:
        other = path_without(rules, tuple(keys), start, goal, budget=budget)
        return max(path.length - other.length, 0.0) if isinstance(other, Path) else None

    free = path_without(rules, [rule.key for rule in rules.removable], start, goal, budget=budget)
    together = max(path.length - free.length, 0.0) if isinstance(free, Path) else None
    # Where unseen floor costs, the free path may be longer and cheaper: then each rule is asked.
    nothing = together is not None and together < SAME and rules.unseen is None
    each = {
        rule.key: 0.0 if nothing or not _may_shorten(rule, path, start, goal) else saved([rule.key])
        for rule in rules.removable
    }
    largest = max(each, key=lambda key: each[key] or 0.0, default=None)
    cost = 0.0 if largest is None else each[largest] or 0.0
    if isinstance(free, Path) and together is not None and cost < MAIN_SHARE * together - SAME:
        group = [rule.key for rule in rules.removable if (rule.at(free.cells) <= 0).any()]
        if (saved(group) or 0.0) < together - SAME:
            group = [rule.key for rule in rules.removable]  # it squeezes past a corner
        for key in sorted(group, key=lambda key: each[key] or 0.0):
            fewer = [other for other in group if other != key]
            if fewer and (saved(fewer) or 0.0) >= together - SAME:
                group = fewer
        return RuleCosts(each=each, together=together, main=tuple(group), main_cost=together)
    main = (largest,) if largest is not None and cost > SAME else ()
    return RuleCosts(each=each, together=together, main=main, main_cost=cost)


def _may_shorten(rule: Rule, path: Path, start: Cell, goal: Cell) -> bool:
    """Return whether a path through a cell that the rule closes, or diagonally past it, can be
    shorter than `path`: an empty grid would allow it."""
    rows, cols = np.nonzero(rule.closed)
    rows, cols = rows + rule.top, cols + rule.left
    least = _octile(rows - start[0], cols - start[1]) + _octile(rows - goal[0], cols - goal[1])
    return bool(np.min(least, initial=np.inf) - (2 - SQRT2) < path.length - SAME)


def _octile(rows: npt.NDArray[np.int64], cols: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Return the lengths of the shortest paths on an empty grid, by the distances in rows and
    columns."""
    rows, cols = np.abs(rows), np.abs(cols)
    low = np.minimum(rows, cols)
    return np.maximum(rows, cols) - low + low * SQRT2
