import math

import numpy as np
import pytest

from app.episode.informed_baseline import SensorModel, TrueGrids, ideal_path_m
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, GridSpec

SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.1)
CAMERA = SensorModel(ahead_m=0.3, angle_rad=math.radians(87), range_m=4.0)
ALL_ROUND = SensorModel(ahead_m=0.0, angle_rad=2 * math.pi, range_m=40.0)
EAST = Pose2(x_m=-6.0, y_m=0.0, yaw_rad=0.0)
GOAL = (6.0, 0.0)
INFLATION_M = 0.4


def cells(*boxes: tuple[float, float, float, float]) -> BoolGrid:
    """The cells of boxes (x from, y from, x to, y to) in metres."""
    grid = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    for left, bottom, right, top in boxes:
        (row_0, col_0), (row_1, col_1) = SPEC.cell(left, bottom), SPEC.cell(right, top)
        grid[row_0:row_1, col_0:col_1] = True
    return grid


POCKET = cells((2.0, -5.0, 2.2, 5.0), (-2.0, 5.0, 2.2, 5.2), (-2.0, -5.2, 2.2, -5.0))
"""A dead end between start and goal, open towards the start and longer than the camera's range."""


def path_m(
    *,
    high: BoolGrid | None = None,
    low: BoolGrid | None = None,
    zones: BoolGrid | None = None,
    sensor: SensorModel = CAMERA,
) -> float | None:
    nothing = cells()
    grids = TrueGrids(
        high=nothing if high is None else high,
        low=nothing if low is None else low,
        zones=nothing if zones is None else zones,
    )
    return ideal_path_m(grids, SPEC, EAST, [GOAL], sensor=sensor, inflation_m=INFLATION_M)


def test_without_obstacles_the_driver_drives_straight() -> None:
    assert path_m() == pytest.approx(12.0, abs=0.01)


def test_the_driver_turns_in_place_towards_a_goal_behind() -> None:
    back = ideal_path_m(
        TrueGrids(high=cells(), low=cells(), zones=cells()),
        SPEC,
        EAST,
        [GOAL, (-6.0, 0.0)],
        sensor=CAMERA,
        inflation_m=INFLATION_M,
    )
    assert back == pytest.approx(24.0, abs=0.05)


def test_a_dead_end_costs_only_a_driver_that_sees_it_late() -> None:
    late, early = path_m(high=POCKET), path_m(high=POCKET, sensor=ALL_ROUND)
    assert late is not None and early is not None
    shortest = 2 * math.hypot(4.0, 5.6) + 4.4 + 0.2  # about: round the outside of the pocket
    assert early == pytest.approx(shortest, abs=1.5)
    assert late > early + 3.0


def test_a_known_zone_need_not_be_seen() -> None:
    assert path_m(zones=POCKET) == pytest.approx(path_m(high=POCKET, sensor=ALL_ROUND), abs=0.3)


def test_the_driver_sees_over_low_objects() -> None:
    bar, wall = cells((-4.6, -0.4, -4.4, 2.0)), cells((-3.0, -7.9, -2.8, 3.0))
    over, hidden = path_m(high=wall, low=bar), path_m(high=wall | bar)
    assert over is not None and hidden is not None
    assert over < hidden - 0.2  # the wall's end is known before the bar is passed


def test_a_goal_that_is_walled_in_has_no_path() -> None:
    ring = cells(
        (4.5, -1.5, 7.5, -1.3), (4.5, 1.3, 7.5, 1.5), (4.5, -1.5, 4.7, 1.5), (7.3, -1.5, 7.5, 1.5)
    )
    assert path_m(high=ring) is None


def test_a_start_too_near_to_a_wall_is_left() -> None:
    assert path_m(high=cells((-6.4, -1.0, -6.25, 1.0))) == pytest.approx(12.0, abs=0.3)
