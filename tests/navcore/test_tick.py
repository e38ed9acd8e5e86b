"""A tick of the whole navigation: from a frame to a path and a motion."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.control.motion import ControllerState
from navcore.costmap.costmap import Costmap
from navcore.errors import BadFrame
from navcore.grid.cell_mask import CellMask
from navcore.grid.nearest import nearest_free
from navcore.planning.path import NoPath, Path, Reason
from tests.navcore.scene import SPEC, Box, Paint, picture
from tests.navcore.ticks import ACROSS, NAN, OPEN, navigator, order

RED_PATCH = Paint(x=(1.6, 2.4), y=(-0.5, 0.5))


def test_the_path_leads_around_a_red_floor_and_across_it_once_the_class_is_off() -> None:
    loop = navigator()
    around = loop.tick(picture(RED_PATCH), order()).route
    across = loop.tick(picture(RED_PATCH), order(enabled=False)).route
    assert around is not None
    assert across is not None
    assert isinstance(around.outcome, Path)
    assert isinstance(across.outcome, Path)
    assert across.outcome.length == 40.0
    assert around.outcome.length > 42.0
    assert np.abs(around.points[:, 1]).max() > 0.8


def test_a_tick_that_refuses_its_frame_has_changed_nothing() -> None:
    loop = navigator()
    with pytest.raises(BadFrame):
        loop.tick(NAN, order())
    assert loop.map.version == 0
    assert not loop.map.explored.seen.bools.any()


def test_without_a_goal_the_robot_looks_and_stands() -> None:
    decision = navigator().tick(picture(Box(x=(2, 3), y=(-1, 1), z=(0, 1))), order(None))
    assert decision.route is None
    assert decision.motion.outcome is ControllerState.IDLE
    assert decision.occupancy.grid.geometric.any()


def test_a_goal_in_a_zone_is_blocked_and_the_path_ends_exactly_at_a_free_one() -> None:
    loop = navigator()
    blocked = loop.tick(OPEN, order((1.75, 0.0), zones=(ACROSS,))).route
    assert blocked is not None
    assert blocked.outcome == NoPath(reason=Reason.GOAL_BLOCKED)
    free = loop.tick(OPEN, order((1.234, 0.567))).route
    assert free is not None
    assert free.points[-1].tolist() == free.waypoints[-1].tolist() == [1.234, 0.567]


def test_planning_a_preview_changes_neither_map_nor_route() -> None:
    loop = navigator()
    decision = loop.tick(OPEN, order())
    everything = np.ones((SPEC.rows, SPEC.cols), dtype=np.bool_)
    walled = Costmap.of(decision.occupancy.grid, everything, version=-1)
    assert loop.preview(walled, OPEN.pose, (3.0, 0.0)).outcome == NoPath(
        reason=Reason.START_BLOCKED
    )
    again = loop.tick(OPEN, order())
    assert again.route is decision.route
    assert again.occupancy is decision.occupancy


def test_a_start_inside_the_inflation_is_moved_to_the_nearest_free_cell_within_reach() -> None:
    blocked = np.zeros((20, 20), dtype=np.bool_)
    blocked[5:12, 5:12] = True
    assert nearest_free(CellMask.of(~blocked), (3, 3), 0.0) == (3, 3)
    assert nearest_free(CellMask.of(~blocked), (8, 6), 2.0) == (8, 4)
    assert nearest_free(CellMask.of(~blocked), (8, 8), 3.9) is None
    assert nearest_free(CellMask.of(~blocked), (8, 8), 4.0) in {(4, 8), (8, 4), (12, 8), (8, 12)}
    assert nearest_free(CellMask.of(~blocked), (-1, 30), 4.0) == (-1, 30)
