"""The cost of each rule is the length that its removal saves, also where the path touches it
nowhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_cells import rasterise
from navcore.planning.explanation.path_explanation import path_without
from navcore.planning.explanation.rule_costs import RuleCosts, rule_costs
from navcore.planning.path import Path
from navcore.planning.planner import plan
from tests.navcore.planning.explanation.test_path_explanation import (
    NOTHING,
    SPEC,
    box,
    made,
    random_rules,
)

WALL = rasterise(box(-0.2, 0.2, -2.0, 1.2), SPEC) & ~rasterise(box(-0.4, 0.4, -0.6, 0.6), SPEC)
"""A wall with a door in its middle and a way round its upper end."""
DOOR = Zone(id="door", name="Door", polygon=box(-0.1, 0.1, -0.6, 0.6))
START, GOAL = SPEC.cell(-1.0, 0.0), SPEC.cell(1.0, 0.0)


def costs_of(*zones: Zone) -> RuleCosts:
    _, rules = made(WALL, NOTHING, zones)
    path = plan(rules.blocked(), START, GOAL)
    assert isinstance(path, Path)
    return rule_costs(rules, path, START, GOAL, budget=10**6)


def test_a_zone_that_closes_a_door_is_the_main_rule_though_the_path_is_nowhere_near() -> None:
    beside = Zone(id="beside", name="Beside", polygon=box(0.4, 0.6, 0.7, 1.6))
    costs = costs_of(beside, DOOR)
    assert costs.main == ("zone:door",) and costs.main_cost == costs.each["zone:door"]
    assert costs.main_cost > 10 > (costs.each["zone:beside"] or 0.0)


def test_two_zones_in_one_door_are_named_together_and_no_third_one() -> None:
    other = Zone(id="other", name="Other", polygon=box(0.3, 0.5, -0.8, 0.8))
    third = Zone(id="third", name="Third", polygon=box(-1.2, -0.8, 1.5, 1.8))
    costs = costs_of(DOOR, third, other)
    assert set(costs.main) == {"zone:door", "zone:other"}
    assert costs.each["zone:third"] == 0.0 and costs.main_cost == costs.together
    assert costs.main_cost > 2 * max(cost or 0.0 for cost in costs.each.values())


def test_a_speed_limit_closes_nothing_and_hides_no_cost() -> None:
    slow = Zone(
        id="slow",
        name="Slow",
        polygon=box(-0.5, 0.5, -0.8, 0.8),
        kind=ZoneKind.SPEED_LIMIT,
        max_speed_mps=0.3,
    )
    alone, beside = costs_of(DOOR), costs_of(DOOR, slow)
    assert beside.main == alone.main == ("zone:door",)
    assert beside.main_cost == alone.main_cost and set(beside.each) == {"zone:door"}


@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
@settings(max_examples=150, deadline=None)
def test_each_cost_is_that_of_the_search_without_the_rule(seed: int, count: int) -> None:
    rules = random_rules(seed, 12, 12, count)
    free = np.argwhere(~rules.blocked()).tolist() or [[0, 0]]
    generator = np.random.default_rng(seed)
    (row, col), (to_row, to_col) = (free[generator.integers(len(free))] for _ in range(2))
    start, goal = (row, col), (to_row, to_col)
    path = plan(rules.blocked(), start, goal)
    if not isinstance(path, Path):
        return
    costs = rule_costs(rules, path, start, goal, budget=10**6)
    for rule in rules.removable:
        other = path_without(rules, [rule.key], start, goal, budget=None)
        assert isinstance(other, Path)
        assert costs.each[rule.key] == pytest.approx(path.length - other.length, abs=1e-9)
    without = path_without(rules, costs.main, start, goal, budget=None)
    assert isinstance(without, Path)
    assert costs.main_cost == pytest.approx(path.length - without.length, abs=1e-9)
