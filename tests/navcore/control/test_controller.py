"""The controller beside what the operator's rules forbid."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.config.navigator import NavigatorConfig
from navcore.control.controller import Controller, ControlTask
from navcore.control.motion import ControllerState, Motion
from navcore.control.people.people_state import PeopleExpectations
from navcore.costmap.costmap import Costmap
from navcore.costmap.local_costmap import margins_left, split_areas
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.grid.grid import GridSpec, OccupancyGrid, inflate_by
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
    track = np.column_stack([np.linspace(0.0, 2.5, 26), np.linspace(0.0, 1.5, 26)])
    controller = Controller(PointMap(SPEC, CONFIG.map).explored, HUSKY, CONFIG)
    return controller.control(task_in(grid(x_m), track, HERE))


def straight() -> Points:
    """A track straight ahead."""
    return np.column_stack([np.linspace(0.0, 2.5, 26), np.zeros(26)])


def task_in(world: OccupancyGrid, track: Points, pose: Pose2) -> ControlTask:
    """The task of a robot at a pose along a track."""
    costmap = Costmap.of(world, world.geometric, version=1)
    return ControlTask(
        costmap=costmap, pose=pose, twist=STANDSTILL, track=track, reaches_goal=True, people=()
    )


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


def test_a_margin_that_gives_way_leaves_those_of_other_things_whole() -> None:
    near = SPEC.cell(HUSKY.length_m / 2 + 0.1, 0.0)
    far = SPEC.cell(HUSKY.length_m / 2 + 0.1, HUSKY.width_m / 2 + MARGIN_M + 0.05)
    empty = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    mines, alone = empty.copy(), empty.copy()
    mines[near] = mines[far] = alone[far] = True
    world = dataclasses.replace(grid(3.0), beware={LANDMINE: mines})
    left = margins_left(world, HUSKY, HERE)
    whole = inflate_by(alone, MARGIN_M, SPEC.resolution_m)
    assert (left & whole == whole).all()
    assert left.sum() < inflate_by(mines, MARGIN_M, SPEC.resolution_m).sum()


@pytest.mark.parametrize("gap_m", [0.05, 0.135, 0.17, 0.3])
def test_however_deep_the_margin_is_the_robot_comes_no_nearer_to_what_has_it(gap_m: float) -> None:
    x_m, pose, least_m = HUSKY.length_m / 2 + gap_m, HERE, []
    mine = SPEC.centres(np.argwhere(grid(x_m).beware[LANDMINE]))
    now_m = HUSKY.distances_m(mine).min()
    controller = Controller(PointMap(SPEC, CONFIG.map).explored, HUSKY, CONFIG)
    for _ in range(25):
        motion = controller.control(task_in(grid(x_m), straight(), pose))
        pose = pose @ Pose2(
            x_m=0.1 * motion.twist.v_mps, y_m=0.0, yaw_rad=0.1 * motion.twist.w_radps
        )
        least_m.append(HUSKY.distances_m(pose.from_parent(mine)).min())
    assert min(least_m) > now_m - 0.01
    assert pose.distance_to(0.0, 0.0) > 0.2


def test_what_is_before_a_robot_in_a_margin_blocks_it_as_elsewhere() -> None:
    """So the recovery goes on, and an operator can have it leave in the end."""
    world = grid(HUSKY.length_m / 2 + 0.3)
    around = world.geometric.copy()
    row, col = SPEC.cell(0.0, 0.0)
    around[row - 9 : row + 10, col - 12] = around[row - 9 : row + 10, col + 12] = True
    around[row - 9, col - 12 : col + 13] = around[row + 9, col - 12 : col + 13] = True
    shut = dataclasses.replace(world, geometric=around)
    controller = Controller(PointMap(SPEC, CONFIG.map).explored, HUSKY, CONFIG)
    motion = controller.control(task_in(shut, straight(), HERE))
    assert motion.outcome is ControllerState.BLOCKED and controller.in_margin
    motion = controller.control(task_in(world, straight()[:0], HERE))
    assert motion.outcome is ControllerState.IN_ZONE, "without a path"


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


def test_a_robot_that_waited_in_vain_passes_who_stands_before_it_slowly_within_their_margin() -> (
    None
):
    """A post that is taken for a person must not hold it for ever."""
    person = 9
    x_m = HUSKY.length_m / 2 + 0.3
    world = grid(x_m)
    geometric = world.geometric.copy()
    row, col = SPEC.cell(-0.72, 0.0)
    geometric[row - 20 : row + 21, col] = True
    stands = {person: world.beware[LANDMINE]}
    world = dataclasses.replace(
        world, geometric=geometric, beware=stands, margins_m={person: MARGIN_M}
    )
    aside = np.column_stack([np.zeros(26), -np.linspace(0.0, 2.5, 26)])
    task = dataclasses.replace(task_in(world, aside, HERE), people_ids=(person,))
    controller = Controller(PointMap(SPEC, CONFIG.map).explored, HUSKY, CONFIG)
    assert controller.control(task).outcome is ControllerState.BLOCKED
    waited = PeopleExpectations(passes_close=True)
    twist = controller.control(dataclasses.replace(task, expectations=waited)).twist
    fastest_mps = abs(twist.v_mps) + abs(twist.w_radps) * HUSKY.circumscribed_radius_m
    assert twist.w_radps < 0.0 and fastest_mps <= CONFIG.people.cautious_mps + 1e-9
    mines = dataclasses.replace(task, people_ids=(), expectations=waited)
    assert controller.control(mines).outcome is ControllerState.BLOCKED, "another class's margin"
