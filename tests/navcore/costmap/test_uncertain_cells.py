"""Where the safety gate would stop for a beware cell, no path leads."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import Costmap
from navcore.costmap.live_costmap import LiveCostmap
from navcore.geometry.arrays import Floats, Points
from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import GridSpec, inflate_layers
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareList
from navcore.planning.path import Path
from navcore.planning.planner import plan
from navcore.robot.profile import HUSKY
from navcore.safety.keep_out_monitor import KeepOuts, permitted_share
from tests.navcore.laws import law

CELL_M = 0.05
SPEC = GridSpec.centred(size_m=(8.0, 8.0), resolution_m=CELL_M)
BODY = {"vehicle_width_m": HUSKY.width_m, "safety_margin_m": NavigatorConfig().safety_margin_m}
BEFORE_M, BEHIND_M = -2.5, 2.5
AHEAD = Twist(v_mps=0.3, w_radps=0.0)
NOTHING = BewareList(classes=())


def costmap() -> LiveCostmap:
    live = LiveCostmap(PointMap(SPEC, MappingConfig()), **BODY)
    live.follow(NOTHING, ())
    return live


def aisle(half_width_m: float) -> Points:
    """Beware cells in two rows across the map, but for an aisle along the x axis."""
    half = int(half_width_m / CELL_M) * CELL_M
    y = np.arange(half, 4.0, CELL_M) + CELL_M / 2
    return np.concatenate(
        [
            np.column_stack([np.full(len(y), x), side * y])
            for x in (-CELL_M / 2, CELL_M / 2)
            for side in (-1, 1)
        ]
    )


def gate_stops(cells: Points, growth_m: Floats) -> bool:
    """Whether the gate slows down or stops a robot that drives along the x axis."""
    return any(
        permitted_share(
            KeepOuts(
                pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0), cells=cells, cell_growth_m=growth_m
            ),
            AHEAD,
            HUSKY,
            frame_age_s=0.0,
        )[0]
        < 1.0
        for x_m in np.arange(BEFORE_M, 0.0, CELL_M)
    )


def leads_through(costmap: Costmap) -> bool:
    start, goal = SPEC.cell(BEFORE_M, 0.0), SPEC.cell(BEHIND_M, 0.0)
    return isinstance(plan(costmap.blocked, start, goal), Path)


@law(25)
@given(st.floats(0.4, 1.4), st.floats(0.0, 1.0))
def test_no_path_leads_where_the_gate_would_stop_and_none_is_closed_that_it_lets_pass(
    half_width_m: float, growth_m: float
) -> None:
    cells = aisle(half_width_m)
    growth = np.full(len(cells), growth_m)
    planned = leads_through(costmap().widen(cells, growth, NOTHING))
    if planned:
        assert not gate_stops(cells, growth - CELL_M / 2)
    elif growth_m > BODY["safety_margin_m"]:
        assert gate_stops(cells, growth + 1.5 * CELL_M)


def test_without_the_growth_a_path_leads_where_the_gate_stops() -> None:
    cells = aisle(0.6)
    growth = np.full(len(cells), 0.4)
    assert gate_stops(cells, growth)
    assert not leads_through(costmap().widen(cells, growth, NOTHING))
    assert leads_through(costmap().widen(cells, np.zeros(len(cells)), NOTHING))  # control


@law(20)
@given(st.integers(0, 2**32 - 1))
def test_widened_cells_are_inflated_by_their_own_radius_and_only_as_long_as_they_are(
    seed: int,
) -> None:
    rng, live = np.random.default_rng(seed), costmap()
    for _ in range(5):
        cells = SPEC.centres(rng.integers(0, (SPEC.rows, SPEC.cols), (int(rng.integers(0, 9)), 2)))
        found = live.widen(cells, rng.choice([0.0, 0.1, 0.3, 0.32, 0.8], len(cells)), NOTHING)
        assert np.array_equal(found.blocked, inflate_layers(found.grid, **BODY))
        assert live.widen(cells, np.zeros(len(cells)), NOTHING).blocked.sum() == 0
        live.widen(cells, np.full(len(cells), 0.4), NOTHING)


def test_a_costmap_that_is_widened_as_before_is_the_same_object() -> None:
    live, cells = costmap(), aisle(0.6)
    first = live.widen(cells, np.full(len(cells), 0.40), NOTHING)
    assert live.widen(cells, np.full(len(cells), 0.39), NOTHING) is first
    assert live.widen(cells, np.full(len(cells), 0.50), NOTHING) is not first
    assert dataclasses.is_dataclass(first.grid) and len(first.grid.uncertain) == 1
