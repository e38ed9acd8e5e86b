"""A goal that is refused comes with a position that the robot can get to."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.costmap.cell_description import check_goal_free
from navcore.errors import BlockedGoal
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid

SPEC = GridSpec.centred(size_m=(8.0, 6.0), resolution_m=0.1)
ROBOT = Pose2(x_m=-3.0, y_m=0.0, yaw_rad=0.0)


def room() -> tuple[OccupancyGrid, BoolGrid, BoolGrid]:
    """A wall at x = 2 that ends in the unseen north, and the seen floor west of it."""
    walls, seen = (np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_) for _ in range(2))
    low, left = SPEC.cell(2.0, -3.0)
    high, right = SPEC.cell(2.4, 2.0)
    walls[low:high, left:right] = True
    seen[: SPEC.cell(0.0, 1.0)[0], :left] = True
    seen[:, ::5] = False  # columns of pixels have gaps
    return (
        OccupancyGrid(spec=SPEC, geometric=walls, beware={}, zones=np.zeros_like(walls)),
        walls,
        seen,
    )


def offered(goal: tuple[float, float], seen: BoolGrid | None) -> tuple[float, float]:
    grid, walls, _ = room()
    with pytest.raises(BlockedGoal) as refused:
        check_goal_free(grid, walls, goal, robot=ROBOT, seen=seen)
    assert refused.value.nearest is not None
    return refused.value.nearest


def test_the_position_offered_lies_on_the_robots_side_of_the_wall() -> None:
    _, _, seen = room()
    in_the_wall = (2.35, -1.0)
    assert offered(in_the_wall, seen)[0] < 2.0
    # Without what was seen, the floor behind the wall is nearer and counts as free.
    assert offered(in_the_wall, None)[0] > 2.3


def test_where_the_robots_own_floor_was_not_seen_any_reachable_position_is_offered() -> None:
    assert offered((2.35, -1.0), np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_))[0] > 2.3


def test_the_text_names_the_same_centimetres_as_the_position() -> None:
    """The middle of a cell of 5 cm lies on half a centimetre, to the rounding error."""
    spec = GridSpec.centred(size_m=(8.0, 6.0), resolution_m=0.05)
    walls = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    low, left = spec.cell(2.0, -3.0)
    high, right = spec.cell(2.4, 2.9)
    walls[low:high, left:right] = True
    grid = OccupancyGrid(spec=spec, geometric=walls, beware={}, zones=np.zeros_like(walls))
    for y_m in np.arange(-2.9, 2.8, 0.05):
        with pytest.raises(BlockedGoal) as refused:
            check_goal_free(grid, walls, (2.05, y_m), robot=ROBOT, seen=None)
        assert refused.value.nearest is not None
        x, y = (round(value, 3) for value in refused.value.nearest)
        assert f"({x:.2f}, {y:.2f})" in str(refused.value)
