"""The escape path out of an area: shortest by brute force, never through closed cells."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.navigator import NavigatorConfig
from navcore.config.planning import EscapeConfig, PlanningConfig
from navcore.control.motion import ControllerState
from navcore.costmap.costmap import Costmap
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid, inflate_layers
from navcore.mission.zone import Zone, zone_masks
from navcore.planning.escape import escape_path, nearest_exit
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan
from navcore.robot.profile import HUSKY
from tests.navcore.laws import law
from tests.navcore.scene import Paint, picture
from tests.navcore.ticks import navigator, order


def brute_force(closed: BoolGrid, inside: BoolGrid, start: tuple[int, int]) -> float:
    lengths = [
        outcome.length
        for row, col in np.argwhere(~closed & ~inside)
        if isinstance(outcome := plan(closed, start, (int(row), int(col))), Path)
    ]
    return min(lengths, default=math.inf)


@law(40)
@given(st.integers(0, 2**32 - 1))
def test_the_escape_path_is_the_shortest_to_any_cell_outside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    closed, inside = rng.random((9, 11)) < 0.25, rng.random((9, 11)) < 0.85
    closed[4, 5] = False
    outcome = nearest_exit(closed=closed, inside=inside, start=(4, 5))
    expected = brute_force(closed, inside, (4, 5))
    if isinstance(outcome, NoPath):
        assert outcome.reason is Reason.UNREACHABLE
        assert expected == math.inf
        return
    assert outcome.length == np.float64(expected) or math.isclose(outcome.length, expected)
    assert outcome.cells[0].tolist() == [4, 5]
    assert not inside[tuple(outcome.cells[-1])]
    assert not closed[outcome.cells[:, 0], outcome.cells[:, 1]].any()
    steps = np.abs(np.diff(outcome.cells, axis=0))
    assert (steps.max(axis=1) == 1).all() if len(steps) else True


def test_a_start_that_is_closed_or_outside_is_reported() -> None:
    closed, inside = np.ones((3, 3), dtype=np.bool_), np.ones((3, 3), dtype=np.bool_)
    assert nearest_exit(closed=closed, inside=inside, start=(1, 1)) == NoPath(
        reason=Reason.START_BLOCKED
    )
    assert nearest_exit(closed=closed, inside=inside, start=(9, 1)) == NoPath(reason=Reason.OUTSIDE)


def test_a_robot_in_a_new_zone_stands_until_told_to_leave_and_drives_into_no_other() -> None:
    zone = Zone(id="z", name="z", polygon=((-3.0, -3.0), (0.9, -3.0), (0.9, 3.0), (-3.0, 3.0)))
    other = Zone(id="o", name="o", polygon=((2.8, -3.0), (3.4, -3.0), (3.4, 3.0), (2.8, 3.0)))
    loop, frame = navigator(), picture(pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    standing = loop.tick(frame, order((3.9, 0.0), zones=(zone, other)))
    assert standing.motion.outcome is ControllerState.IN_ZONE
    assert standing.motion.twist.v_mps == 0.0
    leaving = loop.tick(frame, order(None, zones=(zone, other), leave=True))
    assert leaving.route is not None
    assert isinstance(leaving.route.outcome, Path)
    end = leaving.route.points[-1]
    assert 0.9 + 0.6 < end[0] < 2.8 - 0.6
    assert leaving.motion.outcome is ControllerState.FOLLOW
    assert leaving.motion.twist.v_mps > 0.0


@law(25)
@given(st.integers(0, 2**32 - 1))
def test_the_escape_path_found_nearby_is_that_of_the_whole_map(seed: int) -> None:
    rng = np.random.default_rng(seed)
    spec = GridSpec.centred(size_m=(30.0, 24.0), resolution_m=0.1)
    shape, pose = (
        (spec.rows, spec.cols),
        Pose2(x_m=rng.uniform(-14, 14), y_m=rng.uniform(-11, 11), yaw_rad=rng.uniform(-3, 3)),
    )
    area, zones = np.zeros(shape, dtype=np.bool_), list[Zone]()
    for _ in range(rng.integers(1, 4)):
        at, (long, wide) = (
            spec.cell(pose.x_m + rng.uniform(-3, 3), pose.y_m + rng.uniform(-3, 3)),
            rng.integers(2, 70, 2),
        )
        area[max(at[0] - wide, 0) : max(at[0], 0), max(at[1] - long, 0) : max(at[1] + long, 0)] = (
            True
        )
        x_m, y_m, side_m = (
            pose.x_m + rng.uniform(-4, 4),
            pose.y_m + rng.uniform(-4, 4),
            rng.uniform(0.5, 7),
        )
        corners = (
            (x_m, y_m),
            (x_m + side_m, y_m),
            (x_m + side_m, y_m + side_m),
            (x_m, y_m + side_m),
        )
        zones.append(
            Zone(
                id=f"{len(zones)}", name="", polygon=corners, margin_m=float(rng.choice([0.0, 0.3]))
            )
        )
    drawn, wide_zones = zone_masks(tuple(zones), spec)
    grid = OccupancyGrid(
        spec=spec,
        geometric=rng.random(shape) < 0.003,
        beware={3: area},
        margins_m={3: 0.2},
        zones=drawn,
        wide_zones=wide_zones,
    )
    known = Costmap.of(
        grid, inflate_layers(grid, vehicle_width_m=HUSKY.width_m, safety_margin_m=0.15), version=1
    )
    found = escape_path(known, pose, zones, HUSKY, NavigatorConfig()).on_the_map
    at_once = PlanningConfig(escape=EscapeConfig(first_range_m=1e3))
    whole = escape_path(known, pose, zones, HUSKY, NavigatorConfig(planning=at_once)).on_the_map
    if isinstance(whole, NoPath):
        assert found == whole
    else:
        assert isinstance(found, Path)
        np.testing.assert_array_equal(found.cells[0], whole.cells[0])
        assert found.length == pytest.approx(whole.length)


def test_areas_that_join_farther_off_are_one_area() -> None:
    """A fork of red floor: the robot stands on one tine, the other lies beside it, and they join
    beyond the first range."""
    spec = GridSpec.centred(size_m=(40.0, 40.0), resolution_m=0.1)
    row, col = spec.cell(0.05, 0.05)
    red, nothing = (np.zeros((spec.rows, spec.cols), dtype=np.bool_) for _ in range(2))
    red[row - 18 : row + 3, col - 70 : col + 90] = red[row + 9 : row + 13, col - 70 : col + 90] = (
        True
    )
    red[row - 18 : row + 13, col + 86 : col + 90] = True
    grid = OccupancyGrid(spec=spec, geometric=nothing, beware={3: red}, zones=nothing)
    known = Costmap.of(
        grid, inflate_layers(grid, vehicle_width_m=0.7, safety_margin_m=0.15), version=1
    )
    found = escape_path(known, Pose2(x_m=0.05, y_m=0.05, yaw_rad=0.0), (), HUSKY, NavigatorConfig())
    assert isinstance(found.outcome, Path)
    assert found.outcome.length == pytest.approx(21.0)
    assert found.spec.cols > 2 * 86


def driven_out(*paints: Paint, zones: tuple[Zone, ...]) -> tuple[ControllerState, list[Pose2]]:
    """The last controller state of leaving, and the poses of the robot."""
    loop, pose, driven = navigator(), Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), list[Pose2]()
    for tick in range(150):
        frame = picture(*paints, pose=pose, stamp_ns=(tick + 1) * 100_000_000)
        motion = loop.tick(frame, order(None, zones=zones, leave=True)).motion
        if motion.outcome is ControllerState.ARRIVED:
            break
        turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=motion.twist.w_radps * 0.05)
        pose = pose @ turn @ Pose2(x_m=motion.twist.v_mps * 0.1, y_m=0.0, yaw_rad=0.0) @ turn
        driven.append(pose)
    return motion.outcome, driven


def come_over(driven: list[Pose2], low: tuple[float, float], high: tuple[float, float]) -> bool:
    """Whether any part of the footprint was over a rectangle."""
    area = shapely.box(*low, *high)
    return any(
        bool(shapely.intersects(area, shapely.Polygon(pose.to_parent(HUSKY.footprint()))))
        for pose in driven
    )


def across(name: str, first_m: float, last_m: float) -> Zone:
    corners = ((first_m, -3.0), (last_m, -3.0), (last_m, 3.0), (first_m, 3.0))
    return Zone(id=name, name=name, polygon=corners)


@pytest.mark.parametrize("there", [True, False])
def test_the_escape_path_leads_over_no_object_in_the_area(there: bool) -> None:
    mark = Paint(x=(1.0, 1.3), y=(-0.4, 0.4))
    outcome, driven = driven_out(*[mark] * there, zones=(across("under", -3.0, 1.6),))
    assert outcome is ControllerState.ARRIVED
    assert (
        come_over(driven, (1.0, -0.4), (1.3, 0.4)) is not there
    )  # without it the escape path leads straight ahead


@pytest.mark.parametrize("there", [True, False])
def test_the_escape_path_leads_into_no_zone_that_overlaps_the_area(there: bool) -> None:
    under, other = across("under", -2.0, 0.9), across("other", 0.85, 1.5)
    outcome, driven = driven_out(zones=(under, other) if there else (under,))
    assert outcome is ControllerState.ARRIVED
    assert come_over(driven, (0.95, -3.0), (1.5, 3.0)) is not there


def test_off_the_map_leaving_is_a_plain_answer() -> None:
    off = picture(pose=Pose2(x_m=13.0, y_m=0.0, yaw_rad=0.0))
    assert (
        navigator()
        .tick(off, order(None, zones=(across("z", -1.0, 1.0),), leave=True))
        .motion.twist.v_mps
        == 0.0
    )
