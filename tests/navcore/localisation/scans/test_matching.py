"""Matching finds the pose of a scan on the surfaces that face the camera."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.localisation.localisation import MatchConfig
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.scans.matching import (
    Match,
    lines_blocked_share,
    match,
    match_widely,
    search,
)
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from tests.navcore.laws import law
from tests.navcore.localisation.plan_worlds import PlanWorld, colonnade, drive, office

WORLD = office(3)
LOOSE = np.diag([0.3, 0.3, 0.15]) ** 2


def map_of(world: PlanWorld, poses: list[Pose2], seed: int = 1) -> ScanMap:
    """The map that exact poses make."""
    rng, scan_map = np.random.default_rng(seed), ScanMap()
    for k, pose in enumerate(poses):
        scan_map.put(Keyframe(pose_id=k, T_map_base=pose, scan=world.scan(pose, rng)))
    return scan_map


CORRIDOR = drive([(1.5, 0.0), (22.0, 0.0)])
MAP = map_of(WORLD, CORRIDOR[::3])


def errors(pose: Pose2, true: Pose2) -> tuple[float, float]:
    """Distance in metres and angle in degrees."""
    away = pose.distance_to(true.x_m, true.y_m)
    return away, abs(math.degrees(wrap_angle(pose.yaw_rad - true.yaw_rad)))


@law(25)
@given(st.integers(10, 150), st.floats(-0.25, 0.25), st.floats(-0.25, 0.25), st.floats(-0.09, 0.09))
def test_a_match_finds_the_pose_back(k: int, dx: float, dy: float, turn: float) -> None:
    true = CORRIDOR[k]
    scan = WORLD.scan(true, np.random.default_rng(k))
    expected = Pose2(x_m=true.x_m + dx, y_m=true.y_m + dy, yaw_rad=true.yaw_rad + turn)

    found = match(scan, MAP, expected, LOOSE)

    # Along the corridor only its doors and ends tell.
    assert found.share > 0.7
    assert abs(found.pose.y_m - true.y_m) < 0.02
    assert errors(found.pose, true)[1] < 0.6


@pytest.mark.parametrize("iterations", [1, 2, 12])
def test_all_points_that_fit_are_counted_however_few_steps_are_taken(iterations: int) -> None:
    scan = WORLD.scan(CORRIDOR[0], np.random.default_rng(1))
    scan_map = ScanMap()
    scan_map.put(Keyframe(pose_id=0, T_map_base=CORRIDOR[0], scan=scan))

    found = match(scan, scan_map, CORRIDOR[0], LOOSE, config=MatchConfig(iterations=iterations))

    assert found.share > 0.95


def square_room() -> tuple[PlanWorld, ScanMap]:
    """A room of 4 × 4 m and its map from one turn on the spot."""
    room = PlanWorld()
    for start, end in (((0, -2), (4, -2)), ((4, -2), (4, 2)), ((4, 2), (0, 2)), ((0, 2), (0, -2))):
        room.wall(start, end)
    room.box(3.2, -1.9, 3.9, -1.0)
    turn = [Pose2(x_m=1.0, y_m=0.0, yaw_rad=wrap_angle(0.5 * k)) for k in range(13)]
    return room, map_of(room, turn)


def test_in_a_room_a_match_is_exact_in_all_directions() -> None:
    room, scan_map = square_room()
    true = Pose2(x_m=1.3, y_m=0.2, yaw_rad=0.2)
    expected = Pose2(x_m=1.1, y_m=0.35, yaw_rad=0.3)

    found = match(room.scan(true, np.random.default_rng(9)), scan_map, expected, LOOSE)

    away, turn = errors(found.pose, true)
    assert away < 0.03
    assert turn < 0.5


def test_a_search_finds_what_the_operator_pointed_at_roughly() -> None:
    room, scan_map = square_room()
    true = Pose2(x_m=1.2, y_m=0.2, yaw_rad=0.2)
    scan = room.scan(true, np.random.default_rng(2))
    clicked = Pose2(x_m=true.x_m - 0.6, y_m=true.y_m + 0.5, yaw_rad=true.yaw_rad + 0.3)

    away, turn = errors(search(scan, scan_map, clicked).pose, true)

    assert away < 0.05
    assert turn < 1.0


def test_a_wall_seen_from_the_other_side_is_not_matched() -> None:
    world = PlanWorld()
    world.wall((2.0, -3.0), (2.0, 3.0))
    scan_map = map_of(world, [Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)])
    behind = Pose2(x_m=4.0, y_m=0.0, yaw_rad=math.pi)
    scan = world.scan(behind, np.random.default_rng(3))

    assert match(scan, scan_map, behind, LOOSE).near == 0
    # The control: from the side it was mapped from.
    front = Pose2(x_m=0.1, y_m=0.1, yaw_rad=0.0)
    again = world.scan(front, np.random.default_rng(3))
    assert match(again, scan_map, front, LOOSE).share > 0.95


def test_nor_is_what_forms_no_line_on_the_other_side_of_a_wall_near_it() -> None:
    world, rng = PlanWorld(), np.random.default_rng(3)
    world.wall((2.0, -3.0), (2.0, 3.0))
    mapped_from = Pose2(x_m=0.5, y_m=-2.5, yaw_rad=1.1)
    blurred = without_lines(world.scan(mapped_from, rng))
    scan_map = ScanMap()
    scan_map.put(Keyframe(pose_id=0, T_map_base=mapped_from, scan=blurred))
    behind = Pose2(x_m=3.0, y_m=-2.5, yaw_rad=1.9)
    scan = world.scan(behind, rng)
    scan = scan.part(np.asarray(scan.normals.any(axis=1)))
    assert len(scan) > 50

    assert match(scan, scan_map, behind, LOOSE).near == 0
    # The control: points that form no line either have no other side.
    assert match(without_lines(scan), scan_map, behind, LOOSE).near > 50


def without_lines(scan: Scan) -> Scan:
    """The points of a scan as if they were legs and posts."""
    return dataclasses.replace(scan, normals=np.zeros_like(scan.normals))


def test_along_an_empty_corridor_the_expectation_stays() -> None:
    world = PlanWorld()
    world.wall((-30.0, 1.0), (30.0, 1.0))
    world.wall((-30.0, -1.0), (30.0, -1.0))
    scan_map = map_of(world, [Pose2(x_m=0.5 * k, y_m=0.0, yaw_rad=0.0) for k in range(12)])
    true = Pose2(x_m=3.0, y_m=0.05, yaw_rad=0.01)
    expected = Pose2(x_m=3.2, y_m=-0.1, yaw_rad=0.0)

    scan = world.scan(true, np.random.default_rng(4))
    found = match(scan, scan_map, expected, LOOSE, scale=1.0 / 12.0)

    values, vectors = np.linalg.eigh(found.information)
    assert abs(vectors[0, 0]) > 0.99  # nothing is known along the corridor
    assert values[0] < 1e-6
    assert found.found_with[0, 0] > 500.0, "as the nearest surfaces have it"
    _, information = found.alone(expected, np.linalg.inv(LOOSE), 1.0 / 12.0)
    assert information[1, 1] > 1e4
    assert abs(found.pose.y_m - true.y_m) < 0.01
    assert found.pose.x_m == pytest.approx(expected.x_m, abs=0.1)


@pytest.mark.parametrize("beside_m", [-0.1, 0.0, 0.1])
def test_a_leg_tells_the_way_along_a_corridor_where_the_expectation_holds_the_pose_beside_it(
    beside_m: float,
) -> None:
    true = Pose2(x_m=1.5, y_m=0.0, yaw_rad=0.0)
    expected = Pose2(x_m=true.x_m + beside_m, y_m=0.0, yaw_rad=0.0)
    prior = np.diag([0.05, 0.03, math.radians(0.5)]) ** 2
    for legs in (0, 1):
        world = PlanWorld()
        world.wall((-10.0, 1.0), (20.0, 1.0))
        world.wall((-10.0, -1.0), (20.0, -1.0))
        if legs:
            world.box(3.0, 0.6, 3.08, 0.68)
        scan_map = map_of(world, drive([(0.0, 0.0), (6.0, 0.0)]))
        scan = world.scan(true, np.random.default_rng(99))
        found = match(scan, scan_map, expected, prior, scale=1.0 / 12.0, search_m=0.45)
        assert abs(found.pose.x_m - expected.x_m) < 0.03, "the expectation holds it"
        pull, information = found.alone(expected, np.linalg.inv(prior), 1.0 / 12.0)
        if legs:
            assert information[0, 0] > 200.0
            assert pull[0] * beside_m <= 0.0, "towards the true pose"
        else:
            assert information[0, 0] < 1.0


def test_legs_and_posts_alone_give_a_pose() -> None:
    world = PlanWorld()
    for x, y in [(2.0, 0.5), (2.6, -0.7), (3.1, 1.3), (3.5, -0.2), (1.8, -1.1), (4.0, 0.8)]:
        world.box(x, y, x + 0.05, y + 0.05)
    start = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    scan_map = map_of(world, [start])
    true = Pose2(x_m=0.05, y_m=0.1, yaw_rad=0.03)

    found = match(world.scan(true, np.random.default_rng(5)), scan_map, start, LOOSE)

    away, turn = errors(found.pose, true)
    assert away < 0.05
    assert turn < 1.0


def test_a_scan_of_somewhere_else_neither_fits_nor_lets_one_see_through_walls() -> None:
    true = CORRIDOR[80]
    scan = WORLD.scan(true, np.random.default_rng(6))
    elsewhere = Pose2(x_m=true.x_m - 6.0, y_m=true.y_m, yaw_rad=true.yaw_rad + 1.3)

    there = match(scan, MAP, elsewhere, np.diag([0.02, 0.02, 0.01]) ** 2)
    here = match(scan, MAP, true, np.diag([0.02, 0.02, 0.01]) ** 2)

    assert there.share < 0.6 < here.share
    assert lines_blocked_share(scan, MAP, there.pose) > 0.3
    assert lines_blocked_share(scan, MAP, here.pose) < 0.3


def test_a_map_without_surfaces_gives_the_expectation() -> None:
    scan = WORLD.scan(CORRIDOR[20], np.random.default_rng(7))

    found = match(scan, ScanMap(), CORRIDOR[20], LOOSE)

    assert found.near == found.fitting == 0
    assert errors(found.pose, CORRIDOR[20]) == pytest.approx((0.0, 0.0), abs=1e-6)


def sigmas(found: Match) -> tuple[float, float]:
    """Standard deviations along x and y in metres of a match that counts as one measurement for
    each twelve points."""
    covariance = np.linalg.inv(found.information / 12.0 + 1e-6 * np.eye(3))
    return math.sqrt(covariance[0, 0]), math.sqrt(covariance[1, 1])


def test_a_wide_match_between_pillars_that_are_alike_is_as_uncertain_as_they_are_apart() -> None:
    world = colonnade()
    scan_map = map_of(world, drive([(-4.0, 0.0), (8.0, 0.0)])[::3])
    true = Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0)
    scan = world.scan(true, np.random.default_rng(4))
    expected = Pose2(x_m=1.2, y_m=0.05, yaw_rad=0.02)

    one = match(scan, scan_map, expected, LOOSE, scale=1 / 12)
    found = match_widely(scan, scan_map, expected, LOOSE, scale=1 / 12)

    assert sigmas(one)[0] < 0.05  # the control: the next pillars alone seem to tell
    assert sigmas(found)[0] > 0.2
    assert sigmas(found)[1] < 0.05
    assert abs(found.pose.y_m) < 0.02


def test_a_wide_match_in_a_room_is_as_certain_as_its_surfaces() -> None:
    room, scan_map = square_room()
    true = Pose2(x_m=1.3, y_m=0.2, yaw_rad=0.2)
    expected = Pose2(x_m=1.05, y_m=0.45, yaw_rad=0.3)

    found = match_widely(
        room.scan(true, np.random.default_rng(9)), scan_map, expected, LOOSE, scale=1 / 12
    )

    away, turn = errors(found.pose, true)
    assert away < 0.03
    assert turn < 0.5
    assert max(sigmas(found)) < 0.03
