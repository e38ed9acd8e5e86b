"""The map grows while the robot drives: with the robot, its goal, what it sees and where a path
leads; and nothing changes for a drive that stays within the first extent."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.config.navigator import NavigatorConfig
from navcore.geometry.polyline import Corners
from navcore.geometry.transform import Pose2
from navcore.grid.grid import Box as Part
from navcore.grid.grid import GridSpec
from navcore.mission.zone import Zone, ZoneKind
from navcore.navigator import Navigator, TickResult
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.planning import global_planner
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.planner import plan
from navcore.robot.profile import HUSKY
from tests.navcore.scene import Box, picture
from tests.navcore.test_navigator import CARPET, ORDER, WALL

SMALL = GridSpec.centred(size_m=(14.0, 14.0), resolution_m=0.05)
TILE_M = 12.8


class FixedNavigator(Navigator):
    """A navigator whose grid never grows, as a control."""

    def grow_to(self, part: Part) -> bool:
        """Grow never."""
        return False


def navigator_on(spec: GridSpec, kind: type[Navigator] = Navigator) -> Navigator:
    return kind(spec=spec, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig())


def path_of(decision: TickResult) -> Path:
    assert decision.route is not None and isinstance(decision.route.outcome, Path)
    return decision.route.outcome


def test_a_goal_outside_the_first_extent_is_planned_to_in_the_same_tick() -> None:
    for goal in ((30.0, -3.0), (0.0, 200.0), (-40.0, -40.0)):
        navigator = navigator_on(SMALL)
        decision = navigator.tick(picture(WALL), dataclasses.replace(ORDER, goal=goal))
        spec = decision.occupancy.spec
        assert spec == navigator.map.spec and spec.contains(*goal)
        cells, ends = path_of(decision), (spec.cell(0.0, 0.0), spec.cell(*goal))
        expected = plan(decision.occupancy.blocked, *ends)
        assert isinstance(expected, Path)
        assert cells.length == pytest.approx(expected.length)
        assert decision.route is not None and tuple(decision.route.points[-1]) == goal


def test_without_growth_there_is_no_path_to_it() -> None:
    """Control."""
    order = dataclasses.replace(ORDER, goal=(30.0, -3.0))
    decision = navigator_on(SMALL, FixedNavigator).tick(picture(WALL), order)
    assert decision.route is not None
    assert decision.route.outcome == NoPath(reason=Reason.OUTSIDE)


def test_a_robot_that_drives_out_of_the_first_extent_maps_what_it_sees_there() -> None:
    navigator = navigator_on(SMALL)
    for number in range(12):
        pose = Pose2(x_m=2.0 * number, y_m=0.0, yaw_rad=0.0)
        wall = Box(x=(25.0, 25.2), y=(-1.0, 1.0), z=(0.0, 1.0))
        decision = navigator.tick(picture(wall, pose=pose, stamp_ns=number), ORDER)
    spec = navigator.map.spec
    assert (spec.cols, spec.rows) == (SMALL.cols + 2 * 256, SMALL.rows)
    assert decision.occupancy.grid.geometric[spec.cell(25.05, 0.0)]
    assert navigator.map.explored.known(spec)[spec.cell(24.0, 0.0)]
    assert (navigator.map.points.points_map[:, 0] > 24.9).any()


def test_a_drive_that_stays_within_the_first_extent_is_the_same_with_and_without_growth() -> None:
    growing, fixed = navigator_on(SMALL), navigator_on(SMALL, FixedNavigator)
    zone = Zone(id="z", name="z", polygon=((2.9, 1.0), (3.5, 1.0), (3.5, 2.0), (2.9, 2.0)))
    order = dataclasses.replace(ORDER, zones=(zone,))
    for number, yaw in enumerate((0.0, 0.1, 0.2, -0.4, -0.2)):
        pose = Pose2(x_m=0.15 * number, y_m=0.02 * number, yaw_rad=yaw)
        wall = Box(x=(3.2, 3.4), y=(-6.0, 6.0), z=(0.0, 1.0))
        frame = picture(CARPET, wall, pose=pose, stamp_ns=number * 200_000_000)
        one, other = growing.tick(frame, order), fixed.tick(frame, order)
        assert (one.motion.twist, one.motion.outcome) == (other.motion.twist, other.motion.outcome)
        assert one.occupancy.spec == SMALL
        np.testing.assert_array_equal(one.occupancy.blocked, other.occupancy.blocked)
        for name in ("points", "track", "waypoints"):
            np.testing.assert_array_equal(getattr(one.route, name), getattr(other.route, name))
    np.testing.assert_array_equal(growing.map.points.points_map, fixed.map.points.points_map)


def test_a_path_that_is_shorter_outside_makes_the_grid_grow() -> None:
    # A zone across the map, with a gap far off on one side, that ends just outside on the other.
    fence = ((2.0, -6.0), (2.2, -6.0), (2.2, 7.1), (2.0, 7.1))
    order = dataclasses.replace(
        ORDER, goal=(4.0, 6.0), zones=(Zone(id="f", name="fence", polygon=fence),)
    )
    pose = Pose2(x_m=0.0, y_m=6.0, yaw_rad=0.0)
    growing, fixed = navigator_on(SMALL), navigator_on(SMALL, FixedNavigator)
    one, other = (navigator.tick(picture(pose=pose), order) for navigator in (growing, fixed))
    assert path_of(one).length < path_of(other).length / 3
    assert growing.map.spec.rows > SMALL.rows
    closed = dataclasses.replace(
        order, zones=(dataclasses.replace(order.zones[0], polygon=((2.0, -7.1), *fence[1:])),)
    )
    walled = dataclasses.replace(
        closed.zones[0], polygon=((2.0, -7.1), (2.2, -7.1), (2.2, 7.1), (2.0, 7.1))
    )
    decision = navigator_on(SMALL).tick(
        picture(pose=pose), dataclasses.replace(order, zones=(walled,))
    )
    assert path_of(decision).length == pytest.approx(path_of(one).length)


def test_a_path_that_is_shorter_outside_is_taken_where_another_one_is_on_the_grid() -> None:
    # The goal is near the border, so that the grid grows only once a path is found: by the south.
    fence = ((2.0, -6.0), (2.2, -6.0), (2.2, 7.1), (2.0, 7.1))
    order = dataclasses.replace(
        ORDER, goal=(4.0, 5.5), zones=(Zone(id="f", name="fence", polygon=fence),)
    )
    navigator = navigator_on(SMALL)
    decision = navigator.tick(picture(), order)
    assert navigator.map.spec.rows > SMALL.rows
    spec = decision.occupancy.spec
    expected = plan(decision.occupancy.blocked, spec.cell(0.0, 0.0), spec.cell(4.0, 5.5))
    assert isinstance(expected, Path)
    assert path_of(decision).length == pytest.approx(expected.length)
    south = navigator_on(SMALL, FixedNavigator).tick(picture(), order)
    assert path_of(south).length > 1.3 * expected.length  # control


@pytest.mark.parametrize(
    ("kind", "corners", "has_exit"),
    [
        (ZoneKind.KEEP_OUT, ((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)), True),
        (ZoneKind.STAY_INSIDE, ((11.0, -5.0), (21.0, -5.0), (21.0, 5.0), (11.0, 5.0)), True),
        (ZoneKind.KEEP_OUT, ((-5e3, -5e3), (5e3, -5e3), (5e3, 5e3), (-5e3, 5e3)), False),
    ],
)
def test_a_robot_leaves_an_area_that_ends_beyond_the_grid(
    kind: ZoneKind, corners: Corners, has_exit: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(global_planner, "ESCAPE_WITHIN_M", 15.0)
    area = Zone(id="a", name="a", polygon=corners, kind=kind)
    leave = dataclasses.replace(ORDER, goal=None, leave=True, zones=(area,))
    for navigator in (navigator_on(SMALL), navigator_on(SMALL, FixedNavigator)):
        route = navigator.tick(picture(), leave).route
        assert route is not None
        if has_exit and not isinstance(navigator, FixedNavigator):
            assert isinstance(route.outcome, Path)
            assert 9.0 < route.outcome.length * 0.05 < 14.0
        else:
            assert route.outcome == NoPath(reason=Reason.UNREACHABLE)
        assert max(navigator.map.spec.rows, navigator.map.spec.cols) * 0.05 < 80.0


def test_no_path_leads_out_of_a_site_and_the_grid_does_not_grow_beyond_it() -> None:
    site = Zone(
        id="s",
        name="site",
        polygon=((-6.5, -6.5), (6.5, -6.5), (6.5, 6.5), (-6.5, 6.5)),
        kind=ZoneKind.STAY_INSIDE,
    )
    wall = Zone(id="w", name="w", polygon=((2.0, -7.5), (2.2, -7.5), (2.2, 7.5), (2.0, 7.5)))
    order = dataclasses.replace(ORDER, zones=(site, wall))
    navigator = navigator_on(SMALL)
    decision = navigator.tick(picture(), order)
    assert decision.route is not None
    assert decision.route.outcome == NoPath(reason=Reason.UNREACHABLE)
    assert navigator.map.spec == SMALL
    # Control: without the boundary the path leads around the wall, outside.
    free = navigator.tick(picture(stamp_ns=1), dataclasses.replace(order, zones=(wall,)))
    assert isinstance(path_of(free), Path)
    assert navigator.map.spec.rows > SMALL.rows
    blocked = navigator.tick(picture(stamp_ns=2), order)
    assert blocked.route is not None
    assert blocked.route.outcome == NoPath(reason=Reason.UNREACHABLE)


def test_a_zone_outside_the_grid_is_known_before_the_robot_gets_there() -> None:
    zone = Zone(id="z", name="z", polygon=((7.3, -1.0), (9.0, -1.0), (9.0, 1.0), (7.3, 1.0)))
    navigator = navigator_on(SMALL)
    order = dataclasses.replace(ORDER, goal=(6.0, 3.0), zones=(zone,))
    pose = Pose2(x_m=5.5, y_m=0.0, yaw_rad=np.pi)
    decision = navigator.tick(picture(pose=pose), order)
    spec = decision.occupancy.spec
    assert spec.contains(8.0, 0.0) and decision.occupancy.grid.zones[spec.cell(8.0, 0.0)]
