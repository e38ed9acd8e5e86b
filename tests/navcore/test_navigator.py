"""The loop as a whole: from a picture to a path and a motion that follow the map, the list and the
zones at once."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.behaviours.lane_keep_out import LaneKeepOut
from navcore.config.navigator import NavigatorConfig
from navcore.control.motion import ControllerState
from navcore.errors import BadFrame
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec
from navcore.grid.nearest import nearest_free
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.navigator import Navigator, TickResult
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.planning.path import NoPath, Path, Reason
from navcore.robot.profile import HUSKY, DepthSensor
from tests.navcore.scene import RED_LIST, Box, Paint, picture

SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.05)
GOAL = (4.0, 0.0)
WALL = Box(x=(2.5, 2.7), y=(-0.8, 0.8), z=(0.0, 1.0))
CARPET = Paint(x=(1.8, 2.6), y=(-0.5, 0.5))
ORDER = NavigationRequest(goal=GOAL, beware=RED_LIST, zones=())
RED_OFF = RED_LIST.edited("red floor", enabled=False)
ZONE = Zone(id="z", name="z", polygon=((1.5, -0.6), (2.5, -0.6), (2.5, 0.6), (1.5, 0.6)))


@pytest.fixture
def navigator() -> Navigator:
    return Navigator(
        spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig()
    )


def length_m(decision: TickResult) -> float:
    assert decision.route is not None
    assert isinstance(decision.route.outcome, Path)
    return decision.route.outcome.length * SPEC.resolution_m


def test_unknown_counts_as_free_and_the_path_is_straight(navigator: Navigator) -> None:
    assert length_m(navigator.tick(picture(), ORDER)) == pytest.approx(4.0, abs=0.1)


def test_a_path_that_crosses_a_newly_seen_obstacle_is_planned_anew_at_that_frame(
    navigator: Navigator,
) -> None:
    straight = length_m(navigator.tick(picture(), ORDER))
    decision = navigator.tick(picture(WALL, stamp_ns=1), ORDER)
    assert length_m(decision) > straight + 0.2
    assert decision.route is not None
    cells = [SPEC.cell(x, y) for x, y in decision.route.points[:-1]]
    assert not any(decision.occupancy.blocked[cell] for cell in cells)


def test_a_flat_marking_is_an_obstacle_until_its_class_is_switched_off_and_again_when_it_is_on(
    navigator: Navigator,
) -> None:
    around = length_m(navigator.tick(picture(CARPET), ORDER))
    across = length_m(
        navigator.tick(picture(CARPET, stamp_ns=1), dataclasses.replace(ORDER, beware=RED_OFF))
    )
    again = length_m(
        navigator.tick(picture(stamp_ns=2, pose=Pose2(x_m=0, y_m=0, yaw_rad=3.1)), ORDER)
    )
    assert across < around - 0.2
    assert again == pytest.approx(around, abs=0.05)


def test_a_zone_bends_the_path_at_the_next_tick_and_its_deletion_straightens_it(
    navigator: Navigator,
) -> None:
    straight = length_m(navigator.tick(picture(), ORDER))
    bent = length_m(navigator.tick(picture(stamp_ns=1), dataclasses.replace(ORDER, zones=(ZONE,))))
    off = dataclasses.replace(ZONE, enabled=False)
    assert bent > straight + 0.2
    assert (
        length_m(navigator.tick(picture(stamp_ns=2), dataclasses.replace(ORDER, zones=(off,))))
        == straight
    )
    assert length_m(navigator.tick(picture(stamp_ns=3), ORDER)) == straight


def test_a_zone_drawn_under_the_robot_stops_it_and_says_so(navigator: Navigator) -> None:
    under = Zone(id="u", name="u", polygon=((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)))
    decision = navigator.tick(picture(), dataclasses.replace(ORDER, zones=(under,)))
    assert decision.motion.twist == STANDSTILL
    assert decision.motion.outcome is ControllerState.IN_ZONE


def test_scans_are_as_uncertain_as_the_depth_camera_of_the_profile() -> None:
    def variance(sensor: DepthSensor) -> float:
        profile = dataclasses.replace(HUSKY, depth_sensor=sensor)
        navigator = Navigator(
            spec=SPEC, profile=profile, segmenter=ColourSegmenter(), config=NavigatorConfig()
        )
        navigator.tick(picture(WALL), ORDER)
        return float(navigator.localisation.keyframes[0].scan.variance_m2.mean())

    husky = HUSKY.depth_sensor
    coarse = dataclasses.replace(husky, disparity_error_px=2 * husky.disparity_error_px)
    assert variance(coarse) == pytest.approx(4 * variance(husky))


def test_without_a_goal_the_robot_looks_and_stands(navigator: Navigator) -> None:
    decision = navigator.tick(picture(WALL), dataclasses.replace(ORDER, goal=None))
    assert decision.route is None
    assert decision.motion.twist == STANDSTILL
    assert decision.occupancy.grid.geometric.any()


def test_a_bad_frame_is_refused_and_changes_nothing(navigator: Navigator) -> None:
    navigator.tick(picture(WALL), ORDER)
    version, points = navigator.map.version, len(navigator.map.points.points_map)
    bad = picture(stamp_ns=1)
    with pytest.raises(BadFrame):
        navigator.tick(dataclasses.replace(bad, depth_m=np.full_like(bad.depth_m, np.nan)), ORDER)
    assert (navigator.map.version, len(navigator.map.points.points_map)) == (version, points)


def test_a_goal_beyond_all_bounds_or_in_a_zone_is_no_path_and_no_motion(
    navigator: Navigator,
) -> None:
    for goal, reason in (((9900.0, 0.0), Reason.OUTSIDE), ((1.9, 0.2), Reason.GOAL_BLOCKED)):
        decision = navigator.tick(picture(), dataclasses.replace(ORDER, goal=goal, zones=(ZONE,)))
        assert decision.route is not None
        assert decision.route.outcome == NoPath(reason=reason)
        assert decision.motion.twist == STANDSTILL


@pytest.mark.parametrize("x_m", [2.55, 4.35])
def test_a_goal_in_an_obstacle_is_no_path_and_no_motion(navigator: Navigator, x_m: float) -> None:
    wall = dataclasses.replace(WALL, x=(x_m - 0.05, x_m + 0.15))
    decision = navigator.tick(picture(wall), dataclasses.replace(ORDER, goal=(x_m, 0.0)))
    assert decision.route is not None
    assert decision.route.outcome == NoPath(reason=Reason.GOAL_BLOCKED)
    assert decision.motion.twist == STANDSTILL


def test_a_goal_that_proves_to_be_taken_on_the_way_there_is_gone_up_to_and_looked_at(
    navigator: Navigator,
) -> None:
    goal, low = (4.35, 0.0), dataclasses.replace(WALL, x=(4.3, 4.5), z=(0.0, 0.4))
    order = dataclasses.replace(ORDER, goal=goal)
    navigator.tick(picture(), order)
    taken = navigator.tick(picture(low, stamp_ns=1), order)
    assert taken.route is not None
    assert taken.route.outcome == NoPath(reason=Reason.GOAL_BLOCKED)
    assert np.hypot(*(taken.route.points[-1] - goal)) < 1.5
    row, col = navigator.map.spec.cell(*taken.route.points[-1])
    assert not taken.occupancy.blocked[row, col]
    assert taken.motion.twist != STANDSTILL
    # From nearer it says so, and stands …
    nearer = Pose2(x_m=1.5, y_m=0.0, yaw_rad=0.0)
    assert navigator.tick(picture(low, pose=nearer, stamp_ns=2), order).motion.twist == STANDSTILL
    # … until what stood there has gone away.
    gone = navigator.tick(picture(pose=Pose2(x_m=2.5, y_m=0.0, yaw_rad=0.0), stamp_ns=3), order)
    assert gone.route is not None and isinstance(gone.route.outcome, Path)


def test_somebodys_lane_bends_the_path_and_is_told_to_whoever_looks(navigator: Navigator) -> None:
    straight = length_m(navigator.tick(picture(), ORDER))
    at = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    lanes = LaneKeepOut(zones=(ZONE,), walked=((0, 1, 2.0, 0.0),), at=at, before_m=straight)
    navigator.behaviour = dataclasses.replace(navigator.behaviour, lanes=lanes)
    decision = navigator.tick(picture(stamp_ns=1), ORDER)
    assert decision.closed == (ZONE,)
    assert length_m(decision) > straight + 0.2
    assert navigator.tick(picture(stamp_ns=30_000_000_000), ORDER).closed == (
        ZONE,
    )  # no person has walked there for long …
    after = navigator.tick(picture(stamp_ns=30_000_000_001), ORDER)
    assert after.closed == () and length_m(after) == straight  # … so it is opened


def test_the_track_passes_the_waypoints_which_are_few_and_end_at_the_goal(
    navigator: Navigator,
) -> None:
    route = navigator.tick(picture(WALL), ORDER).route
    assert route is not None
    assert tuple(route.waypoints[-1]) == tuple(route.track[-1]) == GOAL
    assert 2 <= len(route.waypoints) <= 4
    off_m = np.hypot(*(route.waypoints[:, None] - route.track).transpose(2, 0, 1)).min(axis=1)
    assert off_m.max() < 0.6 * SPEC.resolution_m


def test_on_free_ground_the_goal_is_the_only_waypoint(navigator: Navigator) -> None:
    route = navigator.tick(picture(), ORDER).route
    assert route is not None
    assert route.waypoints.tolist() == [list(GOAL)]


def test_the_nearest_free_cell_is_the_nearest_by_brute_force() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        blocked = rng.random((20, 20)) < 0.9
        cell = (int(rng.integers(20)), int(rng.integers(20)))
        found = nearest_free(CellMask.of(~blocked), cell, 6.0)
        free = np.argwhere(~blocked)
        least = np.hypot(*(free - cell).T).min(initial=np.inf)
        assert (found is None) == (least > 6.0)
        if found is not None:
            assert not blocked[found]
            assert np.hypot(found[0] - cell[0], found[1] - cell[1]) == pytest.approx(least)
