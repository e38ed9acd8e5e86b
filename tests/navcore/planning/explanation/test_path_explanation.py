"""The rules close exactly the cells that the planner avoids, and the smallest set to remove is the
smallest."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from navcore.config.planning import ConstraintRemovalConfig
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid, inflate_layers
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.mission.zone import Zone
from navcore.mission.zone_cells import rasterise
from navcore.planning.explanation.constraint_removal import minimum_removal
from navcore.planning.explanation.path_explanation import (
    Rule,
    Rules,
    path_without,
    rules_of,
    stretches,
)
from navcore.planning.path import NoPath, Path
from navcore.planning.planner import plan

SPEC = GridSpec.centred(size_m=(6.0, 4.0), resolution_m=0.1)
WIDTH_M, MARGIN_M = 0.3, 0.05
BEWARE = BewareList(
    classes=(
        BewareClass(name="cup", class_id=2, margin_m=0.1),
        BewareClass(name="book", class_id=3),
    )
)
NOTHING: BoolGrid = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)


def box(left: float, right: float, low: float, high: float) -> tuple[tuple[float, float], ...]:
    return ((left, low), (right, low), (right, high), (left, high))


def world(
    walls: BoolGrid,
    cups: BoolGrid,
    zones: tuple[Zone, ...],
    uncertain: tuple[tuple[float, BoolGrid], ...],
) -> OccupancyGrid:
    enabled = [zone for zone in zones if zone.enabled]
    plain = [rasterise(zone.polygon, SPEC) for zone in enabled if zone.margin_m == 0]
    return OccupancyGrid(
        spec=SPEC,
        geometric=walls,
        beware={2: cups, 3: NOTHING},
        margins_m={2: 0.1, 3: 0.0},
        zones=np.logical_or.reduce([NOTHING, *plain]),
        wide_zones=tuple(
            (zone.margin_m, rasterise(zone.polygon, SPEC)) for zone in enabled if zone.margin_m > 0
        ),
        uncertain=uncertain,
    )


def made(
    walls: BoolGrid,
    cups: BoolGrid,
    zones: tuple[Zone, ...],
    uncertain: tuple[tuple[float, BoolGrid], ...] = (),
) -> tuple[OccupancyGrid, Rules]:
    grid = world(walls, cups, zones, uncertain)
    return grid, rules_of(grid, BEWARE, zones, vehicle_width_m=WIDTH_M, safety_margin_m=MARGIN_M)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_the_rules_together_close_exactly_the_cells_that_the_planner_avoids(seed: int) -> None:
    generator = np.random.default_rng(seed)
    walls, cups = (generator.random((SPEC.rows, SPEC.cols)) < share for share in (0.01, 0.005))
    zones = tuple(
        Zone(
            id=str(i),
            name=f"z{i}",
            polygon=box(x, x + 0.7, y, y + 0.4),
            margin_m=margin,
            enabled=on,
        )
        for i, (x, y, margin, on) in enumerate(
            ((-2.0, -1.5, 0.0, True), (0.5, 0.2, 0.25, True), (1.5, -1.0, 0.0, False))
        )
    )
    wider = generator.integers(0, 3, (SPEC.rows, SPEC.cols))
    uncertain = tuple((margin_m, cups & (wider == i)) for i, margin_m in ((1, 0.2), (2, 0.4)))
    grid, rules = made(walls, cups, zones, uncertain)
    assert (
        rules.blocked() == inflate_layers(grid, vehicle_width_m=WIDTH_M, safety_margin_m=MARGIN_M)
    ).all()


def test_the_path_is_cut_into_stretches_that_name_what_bends_them() -> None:
    wall, zone = (
        rasterise(box(-2.0, -1.6, -2.0, 0.5), SPEC),
        Zone(id="wet", name="Wet floor", polygon=box(0.8, 1.6, -0.6, 2.0)),
    )
    _, rules = made(wall, NOTHING, (zone,))
    start, goal = SPEC.cell(-2.6, -0.6), SPEC.cell(2.6, 0.4)
    path = plan(rules.blocked(), start, goal)
    assert isinstance(path, Path)
    parts = stretches(path, rules)
    assert {part.key for part in parts} == {None, "wall", "zone:wet"}
    assert [part.first for part in parts] == [0, *(part.last + 1 for part in parts[:-1])] and parts[
        -1
    ].last == len(path.cells) - 1
    for part in parts:
        if part.key == "zone:wet":
            xy = SPEC.centres(path.cells[part.first : part.last + 1])
            assert (np.abs(xy[:, 0] - 1.2) < 0.4 + 0.5).all() and (xy[:, 1] < -0.6).all()
    shorter = path_without(rules, ["zone:wet"], start, goal, budget=None)
    assert isinstance(shorter, Path) and shorter.length < path.length - 1


def test_only_the_zone_that_shuts_the_door_must_be_removed() -> None:
    wall = rasterise(box(-0.2, 0.2, -2.0, 2.0), SPEC) & ~rasterise(box(-0.4, 0.4, -0.6, 0.6), SPEC)
    door = Zone(id="door", name="Door", polygon=box(-0.1, 0.1, -0.6, 0.6))
    aside = Zone(id="aside", name="Aside", polygon=box(1.0, 2.0, 1.0, 1.8))
    _, rules = made(wall, NOTHING, (aside, door))
    start, goal = SPEC.cell(-2.0, 0.0), SPEC.cell(2.0, 0.0)
    assert isinstance(plan(rules.blocked(), start, goal), NoPath)
    found = minimum_removal(rules, start, goal)
    assert found.keys == ("zone:door",) and found.exact and found.at_least == 1
    assert isinstance(path_without(rules, found.keys, start, goal, budget=None), Path)


def test_a_class_that_shuts_the_door_only_by_the_uncertainty_of_the_position_is_named() -> None:
    wall = rasterise(box(-0.2, 0.2, -2.0, 2.0), SPEC) & ~rasterise(box(-0.4, 0.4, -1.0, 1.0), SPEC)
    cup = rasterise(box(-0.1, 0.1, -0.1, 0.1), SPEC)
    start, goal = SPEC.cell(-2.0, 0.0), SPEC.cell(2.0, 0.0)
    _, surely = made(wall, cup, ())
    assert minimum_removal(surely, start, goal).keys == ()
    _, unsure = made(wall, cup, (), ((0.7, cup),))
    assert minimum_removal(unsure, start, goal).keys == ("class:2",)


def test_walls_cannot_be_removed_and_an_open_path_needs_nothing() -> None:
    _, rules = made(rasterise(box(-0.2, 0.2, -2.0, 2.0), SPEC), NOTHING, ())
    start, goal = SPEC.cell(-2.0, 0.0), SPEC.cell(2.0, 0.0)
    assert (
        minimum_removal(rules, start, goal).keys is None
        and minimum_removal(rules, start, goal).exact
    )
    assert minimum_removal(rules, start, SPEC.cell(-1.0, 0.5)).keys == ()
    assert minimum_removal(rules, start, SPEC.cell(0.0, 0.0)).keys is None
    assert minimum_removal(rules, start, (-1, 5)).keys is None


def random_rules(seed: int, rows: int, cols: int, count: int) -> Rules:
    """Blots on a small grid, each closed by one rule, and some walls."""
    generator = np.random.default_rng(seed)
    spec = GridSpec(resolution_m=1.0, rows=rows, cols=cols, origin_x_m=0.0, origin_y_m=0.0)

    def rule(key: str, mask: BoolGrid) -> Rule:
        return Rule(
            key=key, name=key, top=0, left=0, beyond=np.where(mask, -1, 9).astype(np.float32)
        )

    def blots(most: int, long: int) -> BoolGrid:
        mask = np.zeros((rows, cols), dtype=np.bool_)
        for _ in range(int(generator.integers(1, most + 1))):
            row, col = int(generator.integers(rows)), int(generator.integers(cols))
            height, width = generator.integers(1, long, 2)
            mask[row : row + height, col : col + width] = True
        return mask

    removable = tuple(rule(f"zone:{i}", blots(3, max(rows, cols))) for i in range(count))
    return Rules(spec=spec, walls=rule("wall", blots(2, 4)), removable=removable)


@given(st.integers(0, 2**32 - 1), st.integers(2, 9), st.integers(2, 9), st.integers(0, 6))
@settings(max_examples=300, deadline=None)
def test_the_smallest_set_is_as_small_as_the_one_found_by_trying_all(
    seed: int, rows: int, cols: int, count: int
) -> None:
    rules = random_rules(seed, rows, cols, count)
    start, goal = (0, 0), (rows - 1, cols - 1)
    keys = [rule.key for rule in rules.removable]
    by_force = next(
        (
            size
            for size in range(len(keys) + 1)
            for chosen in itertools.combinations(keys, size)
            if isinstance(plan(rules.blocked(chosen), start, goal), Path)
        ),
        None,
    )
    found = minimum_removal(rules, start, goal)
    assert found.exact
    if by_force is None:
        assert found.keys is None
    else:
        assert found.keys is not None and len(found.keys) == by_force == found.at_least
        assert isinstance(plan(rules.blocked(found.keys), start, goal), Path)


@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
@settings(max_examples=60, deadline=None)
def test_a_search_that_is_given_up_says_so_and_its_bound_holds(seed: int, states: int) -> None:
    rules = random_rules(seed, 9, 9, 6)
    whole, given_up = (
        minimum_removal(rules, (0, 0), (8, 8), config=ConstraintRemovalConfig(max_states=most))
        for most in (100_000, states)
    )
    if given_up.exact:
        assert (given_up.keys is None) == (whole.keys is None)
    else:
        assert given_up.keys is None
        assert whole.keys is None or given_up.at_least <= len(whole.keys)
