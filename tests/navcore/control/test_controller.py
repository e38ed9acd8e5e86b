"""The controller beside what the operator's rules forbid."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.config.navigator import NavigatorConfig
from navcore.control.controller import Controller, ControlTask
from navcore.control.motion import ControllerState, Motion
from navcore.costmap.costmap import Costmap
from navcore.costmap.local_costmap import split_areas
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.grid.grid import GridSpec, OccupancyGrid
from navcore.mapping.point_map import PointMap
from navcore.robot.profile import HUSKY

SPEC = GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.05)
CONFIG = NavigatorConfig()
HERE = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
LANDMINE, MARGIN_M = 5, 0.5


def grid(x_m: float) -> OccupancyGrid:
    """A landmine straight ahead, which is kept at half a metre."""
    empty = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    mine = empty.copy()
    mine[SPEC.cell(x_m, 0.0)] = mine[SPEC.cell(x_m, 0.06)] = True
    return OccupancyGrid(
        spec=SPEC,
        geometric=empty,
        beware={LANDMINE: mine},
        zones=empty,
        margins_m={LANDMINE: MARGIN_M},
    )


def decided(x_m: float) -> Motion:
    """The motion to a goal beyond the landmine, past it by a metre."""
    costmap = Costmap.of(grid(x_m), grid(x_m).geometric, version=1)
    track = np.column_stack([np.linspace(0.0, 2.5, 26), np.linspace(0.0, 1.5, 26)])
    controller = Controller(PointMap(SPEC, CONFIG.map).explored, HUSKY, CONFIG)
    task = ControlTask(
        costmap=costmap, pose=HERE, twist=STANDSTILL, track=track, reaches_goal=True, people=()
    )
    return controller.control(task)


@pytest.mark.parametrize("gap_m", [0.1, 0.3, 0.45])
def test_a_margin_that_reaches_the_body_does_not_hold_the_robot(gap_m: float) -> None:
    """A thing that is recognised late is nearer than its margin: the robot moves away from it."""
    x_m = HUSKY.length_m / 2 + gap_m
    motion = decided(x_m)
    assert motion.outcome is not ControllerState.IN_ZONE and motion.twist != STANDSTILL
    mine = SPEC.centres(np.argwhere(grid(x_m).beware[LANDMINE]))
    step = Pose2(x_m=0.2 * motion.twist.v_mps, y_m=0.0, yaw_rad=0.2 * motion.twist.w_radps)
    later_m, now_m = (HUSKY.distances_m(pose.from_parent(mine)).min() for pose in (step, HERE))
    assert later_m >= now_m - 1e-3


def test_a_thing_under_the_body_holds_it() -> None:
    assert decided(HUSKY.length_m / 2 - 0.1).outcome is ControllerState.IN_ZONE


def test_of_an_area_that_is_entered_by_its_margin_alone_what_has_the_margin_stays_forbidden() -> (
    None
):
    beside, under = grid(HUSKY.length_m / 2 + 0.2), grid(HUSKY.length_m / 2 - 0.1)
    (entered,), others = split_areas(beside, (), HUSKY, HERE)
    assert entered.sum() > 100 and (others == beside.beware[LANDMINE]).all()
    (entered,), others = split_areas(under, (), HUSKY, HERE)
    assert entered.any() and not others.any()
    far = dataclasses.replace(beside, margins_m={LANDMINE: 0.1})
    assert split_areas(far, (), HUSKY, HERE)[0] == []
