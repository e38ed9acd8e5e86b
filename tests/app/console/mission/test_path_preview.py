"""Metres and seconds of a preview come from one path and one speed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.console.mission.path_preview import measured
from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.control.speed_limits import travel_time_s
from navcore.costmap.costmap import Costmap
from navcore.geometry.transform import Pose2
from navcore.grid.cell_mask import CellMask
from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mapping.points.pose_ids import PoseIds
from navcore.planning.global_planner import GlobalPlanner
from navcore.planning.path import NoPath
from navcore.robot.profile import HUSKY
from tests.navcore.laws import law
from web.interface.drafts import PathPreview

SPEC = GridSpec.centred(size_m=(8.0, 6.0), resolution_m=0.1)
NOTHING = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)


def preview(blocked: BoolGrid) -> PathPreview:
    explored = VisibilityMap(SPEC, MappingConfig().raycast, PoseIds(0.5, 20.0))
    planner = GlobalPlanner(FreeSpace.of(blocked), explored, HUSKY, NavigatorConfig())
    grid = OccupancyGrid(spec=SPEC, geometric=blocked, beware={}, zones=NOTHING)
    pose = Pose2(x_m=-3.5, y_m=0.0, yaw_rad=0.0)
    route = planner.preview(Costmap.of(grid, blocked, version=1), pose, (3.5, 0.0))
    return measured(
        route,
        (),
        lambda points, zones: travel_time_s(points, zones, HUSKY),
        CellMask.of(~NOTHING),
        SPEC,
    )


@law(40)
@given(st.integers(20, 55), st.integers(5, 40), st.integers(2, 15), st.integers(3, 30))
def test_a_path_that_is_longer_takes_longer_by_the_same_speed(
    left: int, low: int, width: int, height: int
) -> None:
    blocked = NOTHING.copy()
    blocked[low : low + height, left : left + width] = True
    without, drafted = preview(NOTHING), preview(blocked)
    if isinstance(drafted.outcome, NoPath):
        return
    assert drafted.length_m and drafted.time_s and without.length_m and without.time_s
    change_m, change_s = drafted.length_m - without.length_m, drafted.time_s - without.time_s
    assert change_s == pytest.approx(change_m / HUSKY.max_speed_mps, abs=1e-6)
    assert drafted.unseen_m == 0.0
