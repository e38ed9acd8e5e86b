"""Before a way round that is much longer, the robot looks from near at a gap that only margins or
people close."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.config.planning import GapViewpointConfig, PlanningConfig
from navcore.costmap.costmap import Costmap
from navcore.geometry.transform import Pose2
from navcore.grid.free_space import FreeSpace
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid, inflate_layers
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.planning.global_planner import GlobalPlanner
from navcore.planning.path import Path
from navcore.planning.route import Route
from navcore.robot.profile import HUSKY

SPEC = GridSpec.centred(size_m=(14.0, 20.0), resolution_m=0.05)
CONFIG = NavigatorConfig()
PERSON = 11
LIST = BewareList(classes=(BewareClass(class_id=PERSON, name="person", margin_m=0.2),))
POSE, GOAL = Pose2(x_m=-2.0, y_m=0.0, yaw_rad=0.0), (4.0, 0.0)
WALL_X_M = 2.0
OPEN_M, NARROW_M, SHUT_M = 1.2, 0.9, 0.5
"""Widths of a gap: free, closed by the safety margin alone, too narrow for the body."""


def wall(gap_m: float, *, x_m: float = WALL_X_M, end_m: float = -8.0) -> BoolGrid:
    """A wall across the map up to y = `end_m`, with a gap in its middle."""
    cells = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    (row, col), half = SPEC.cell(x_m, 0.0), round(gap_m / 2 / SPEC.resolution_m)
    cells[SPEC.cell(x_m, end_m)[0] :, col : col + 4] = True
    cells[row - half : row + half, col : col + 4] = False
    return cells


def costmap(
    geometric: BoolGrid, *, zones: BoolGrid | None = None, person: BoolGrid | None = None
) -> Costmap:
    nothing = np.zeros_like(geometric)
    grid = OccupancyGrid(
        spec=SPEC,
        geometric=geometric,
        beware={} if person is None else {PERSON: person},
        margins_m={PERSON: 0.2},
        zones=nothing if zones is None else zones,
    )
    blocked = inflate_layers(
        grid, vehicle_width_m=HUSKY.width_m, safety_margin_m=CONFIG.safety_margin_m
    )
    return Costmap.of(grid, blocked, version=1)


class Drive:
    """A planner that is given one map after the other."""

    def __init__(self, rules: GapViewpointConfig | None = None) -> None:
        planning = PlanningConfig(viewpoint=rules or GapViewpointConfig())
        self.space = FreeSpace.of(np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_))
        explored = VisibilityMap(SPEC, MappingConfig().raycast, PoseIds(0.5, 20.0))
        config = dataclasses.replace(CONFIG, planning=planning)
        self.planner = GlobalPlanner(self.space, explored, HUSKY, config)

    def plan(self, known: Costmap, pose: Pose2 = POSE, goal: tuple[float, float] = GOAL) -> Route:
        self.space.update(known.blocked)
        route = self.planner.plan(known, pose, goal, LIST)
        assert isinstance(route.outcome, Path)
        for x_m, y_m in route.points.tolist():
            assert not known.blocked[known.spec.cell(x_m, y_m)], "no closed cell is entered"
        return route


def is_at_gap(route: Route) -> bool:
    x_m, y_m = route.points[-1]
    return bool(WALL_X_M - 0.8 < x_m < WALL_X_M and abs(y_m) < 0.3)


def test_a_gap_that_closes_by_its_margin_is_looked_at_before_the_way_round() -> None:
    drive = Drive()
    assert drive.plan(costmap(wall(OPEN_M))).reaches_goal
    look = drive.plan(costmap(wall(NARROW_M)))
    assert look.is_look and not look.reaches_goal and is_at_gap(look)
    assert isinstance(look.outcome, Path), "there is a path, the way round"
    assert look.outcome.length * SPEC.resolution_m > 15.0
    # Control: without the rule the robot sets off on the way round.
    without = Drive(GapViewpointConfig(detour_m=500.0))
    without.plan(costmap(wall(OPEN_M)))
    assert without.plan(costmap(wall(NARROW_M))).reaches_goal


def test_it_is_looked_at_when_the_path_to_a_goal_is_first_planned_too() -> None:
    assert is_at_gap(Drive().plan(costmap(wall(NARROW_M))))


def test_a_gap_that_opens_on_the_way_is_driven_through() -> None:
    drive = Drive()
    assert drive.plan(costmap(wall(NARROW_M))).is_look
    nearer = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    through = drive.plan(costmap(wall(OPEN_M)), nearer)
    assert through.reaches_goal and through.length_m == pytest.approx(4.0, abs=0.5)


def test_what_was_looked_at_from_near_is_believed() -> None:
    drive, known = Drive(), costmap(wall(NARROW_M))
    look = drive.plan(known)
    x_m, y_m = look.points[-1].tolist()
    there = Pose2(x_m=x_m - 0.1, y_m=y_m, yaw_rad=0.0)
    assert drive.plan(known, there).reaches_goal
    # Not when noise opens and closes it again while the robot drives away either.
    away = Pose2(x_m=1.0, y_m=-1.0, yaw_rad=-1.5)
    assert drive.plan(costmap(wall(OPEN_M)), away).reaches_goal
    assert drive.plan(known, away).reaches_goal
    # For another goal it is looked at again.
    assert drive.plan(known, away, (4.5, 0.0)).is_look


@pytest.mark.parametrize("gap_m", [0.0, SHUT_M])
def test_a_gap_that_the_body_does_not_fit_through_is_not_looked_at(gap_m: float) -> None:
    drive = Drive()
    drive.plan(costmap(wall(OPEN_M)))
    assert drive.plan(costmap(wall(gap_m))).reaches_goal
    # And one that turns out to be so on the way is left.
    again = Drive()
    assert again.plan(costmap(wall(NARROW_M))).is_look
    assert again.plan(costmap(wall(gap_m))).reaches_goal


def test_a_zone_or_an_item_is_no_gap_a_person_is() -> None:
    strip = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    row, col = SPEC.cell(WALL_X_M, 0.0)
    strip[row - 12 : row + 12, col : col + 4] = True
    drive = Drive()
    assert drive.plan(costmap(wall(OPEN_M), zones=strip)).reaches_goal
    body = np.zeros_like(strip)
    body[row - 4 : row + 4, col - 4 : col + 4] = True
    assert Drive().plan(costmap(wall(OPEN_M), person=body)).is_look
    assert Drive().plan(costmap(wall(OPEN_M) | body)).reaches_goal


def test_a_gap_that_is_farther_away_than_it_saves_is_not_gone_to() -> None:
    # Round the end of the wall it is hardly farther than through the gap and back.
    short = wall(NARROW_M, end_m=-3.0)
    assert Drive().plan(costmap(short)).reaches_goal
    # From far off the way there and back is longer than what it saves.
    far = Pose2(x_m=-6.0, y_m=6.0, yaw_rad=0.0)
    long = wall(NARROW_M, end_m=-5.5)
    assert Drive().plan(costmap(long), far).reaches_goal
    assert Drive().plan(costmap(long)).is_look


def test_a_second_narrow_place_that_is_shut_makes_the_first_no_way() -> None:
    both = wall(NARROW_M) | wall(SHUT_M, x_m=3.0)
    assert Drive().plan(costmap(both)).reaches_goal
    assert is_at_gap(Drive().plan(costmap(wall(NARROW_M) | wall(NARROW_M, x_m=3.0))))


def test_a_robot_that_was_moved_away_decides_anew() -> None:
    drive, known = Drive(), costmap(wall(NARROW_M))
    assert drive.plan(known).is_look
    behind = Pose2(x_m=4.0, y_m=-6.0, yaw_rad=0.0)
    assert drive.plan(known, behind).reaches_goal


def test_a_viewpoint_that_the_robot_cannot_come_to_is_given_up() -> None:
    drive, known = Drive(), costmap(wall(NARROW_M))
    assert drive.plan(known).is_look
    drive.planner.end_look()
    assert drive.plan(known).reaches_goal


def test_the_length_of_a_route_that_looks_first_is_that_of_the_way_round() -> None:
    look = Drive().plan(costmap(wall(NARROW_M)))
    assert isinstance(look.outcome, Path)
    assert look.length_m == look.round_m == look.outcome.length * SPEC.resolution_m
