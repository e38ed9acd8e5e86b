"""The global planner goes round what was not seen only where unseen floor has a price, and ends a
path beside a goal that is a little too close to something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.config.planning import PlanningConfig
from navcore.costmap.costmap import Costmap
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import pack
from navcore.grid.cell_mask import CellMask
from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import Box, Cell, GridSpec, OccupancyGrid
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.planning.escape import EscapePath
from navcore.planning.global_planner import ESCAPE_WAITS, GlobalPlanner, _beyond_escape
from navcore.planning.path import NoPath, Path, Reason
from navcore.robot.profile import HUSKY
from navcore.toml_config import from_table

SPEC = GridSpec.centred(size_m=(12.0, 8.0), resolution_m=0.1)
POSE, GOAL = Pose2(x_m=-5.0, y_m=0.0, yaw_rad=0.0), (5.0, 0.0)


def metres_unseen(price: float, asked: float | None = None, *, budget: int = 2_000_000) -> float:
    """Metres of the live and of the previewed path over a band that was not seen, at the price of a
    configuration or at one that is asked for; both agree."""
    nothing = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    seen = ~nothing
    seen[20:, 50:70] = False
    explored = VisibilityMap(SPEC, MappingConfig().raycast, PoseIds(0.5, 20.0))
    pack(seen, explored.measured)
    config = NavigatorConfig(planning=PlanningConfig(unknown_price=price), plan_budget=budget)
    planner = GlobalPlanner(FreeSpace.of(nothing), explored, HUSKY, config)
    grid = OccupancyGrid(spec=SPEC, geometric=nothing, beware={}, zones=nothing)
    costmap = Costmap.of(grid, nothing, version=1)
    request = NavigationRequest(
        goal=GOAL, beware=BewareList(classes=()), zones=(), unknown_price=asked
    )
    routes = (
        planner.route(costmap, POSE, request, (), GlobalPlanner.plan),
        planner.preview(costmap, POSE, GOAL, unknown_price=asked),
    )
    found = []
    for route in routes:
        assert route is not None
        assert isinstance(route.outcome, Path)
        cells = route.outcome.cells
        found.append(float((~seen[cells[:, 0], cells[:, 1]]).sum()) * SPEC.resolution_m)
    assert found[0] == found[1]
    return found[0]


def test_unseen_floor_is_free_by_default_and_avoided_at_a_price() -> None:
    assert NavigatorConfig().planning.unknown_price == 1.0
    assert metres_unseen(1.0) == pytest.approx(2.0, abs=0.2)
    assert metres_unseen(5.0) == 0.0


def test_a_price_that_is_asked_for_takes_the_place_of_the_configured_one() -> None:
    assert metres_unseen(1.0, asked=5.0) == 0.0
    assert metres_unseen(5.0, asked=1.0) == pytest.approx(2.0, abs=0.2)


def test_where_the_search_for_seen_floor_takes_too_long_the_shortest_path_is_followed() -> None:
    assert metres_unseen(5.0, budget=1_000) == pytest.approx(2.0, abs=0.2)
    assert metres_unseen(5.0, budget=10_000) == 0.0


def test_a_price_below_one_is_refused() -> None:
    with pytest.raises(BadConfiguration, match="unknown_price"):
        from_table(NavigatorConfig, {"planning": {"unknown_price": 0.5}}, "test")


@pytest.mark.parametrize(
    ("blocked_m", "width_m", "is_reached"),
    [(0.1, HUSKY.width_m, True), (0.4, HUSKY.width_m, False), (0.1, 0.15, False)],
)
def test_a_path_may_end_beside_a_goal_that_is_a_little_too_close_to_something(
    blocked_m: float, width_m: float, is_reached: bool
) -> None:
    """A column of the map is blocked from the goal on, and as far before it as `blocked_m`. In a
    zone the goal of a narrow robot may be as near to free floor, and is none to drive beside."""
    blocked = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    _, col = SPEC.cell(*GOAL)
    blocked[:, col - round(blocked_m / SPEC.resolution_m) + 1 :] = True
    planner = GlobalPlanner(
        FreeSpace.of(blocked),
        VisibilityMap(SPEC, MappingConfig().raycast, PoseIds(0.5, 20.0)),
        replace(HUSKY, width_m=width_m),
        NavigatorConfig(),
    )
    grid = OccupancyGrid(spec=SPEC, geometric=blocked, beware={}, zones=np.zeros_like(blocked))
    costmap = Costmap.of(grid, blocked, version=1)
    request = NavigationRequest(goal=GOAL, beware=BewareList(classes=()), zones=())
    routes = (
        planner.route(costmap, POSE, request, (), GlobalPlanner.plan),
        planner.preview(costmap, POSE, GOAL),
    )
    for route in routes:
        assert route is not None
        if is_reached:
            assert isinstance(route.outcome, Path)
            end = route.track[-1]
            assert not blocked[SPEC.cell(*end)]
            assert np.hypot(*(end - GOAL)) <= NavigatorConfig().planning.goal_tolerance_m
        else:
            assert route.outcome == NoPath(reason=Reason.GOAL_BLOCKED)


@pytest.mark.parametrize(
    ("shape", "cell", "asked"),
    [
        ((800, 12_000), (400, 6_000), (-400, 0, 1_199, 12_000)),
        ((300, 300), (20, 150), (-20, -150, 579, 449)),
        ((4_000, 4_000), (2_000, 2_000), None),
    ],
)
def test_for_a_way_out_each_side_grows_by_its_own_distance_from_the_robot(
    shape: tuple[int, int], cell: Cell, asked: Box | None
) -> None:
    spec = GridSpec(rows=shape[0], cols=shape[1], resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    found = EscapePath(
        outcome=NoPath(reason=Reason.UNREACHABLE),
        spec=spec,
        corner=(0, 0),
        free=CellMask.of(np.ones(shape, dtype=np.bool_)).plane,
        start=cell,
    )
    assert _beyond_escape(found) == asked


def test_a_way_out_that_is_nowhere_on_the_grid_is_searched_for_once_in_many_ticks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    searches, nothing = [0], np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)

    def search(*_given: object) -> EscapePath:
        searches[0] += 1
        none = NoPath(reason=Reason.UNREACHABLE)
        return EscapePath(outcome=none, spec=SPEC, corner=(0, 0), free=CellMask.of(nothing).plane)

    monkeypatch.setattr("navcore.planning.global_planner.escape_path", search)
    explored = VisibilityMap(SPEC, MappingConfig().raycast, PoseIds(0.5, 20.0))
    planner = GlobalPlanner(FreeSpace.of(nothing), explored, HUSKY, NavigatorConfig())
    grid = OccupancyGrid(spec=SPEC, geometric=nothing, beware={}, zones=nothing)
    request = NavigationRequest(goal=None, leave=True, beware=BewareList(classes=()), zones=())

    def route(version: int, request: NavigationRequest = request) -> None:
        found = planner.route(
            Costmap.of(grid, nothing, version=version), POSE, request, (), GlobalPlanner.plan
        )
        assert found is None or found.outcome == NoPath(reason=Reason.UNREACHABLE)

    for version in range(1 + 2 * (ESCAPE_WAITS + 1)):
        route(version)
    assert searches[0] == 3
    route(1000, replace(request, leave=False))
    route(1001)
    assert searches[0] == 4, "another order to leave is searched for at once"
