"""The local planner follows the path where it is free, and turns, looks or backs off where it is
not."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import pytest
import shapely

from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.costmap.local_costmap import outside
from navcore.geometry.arrays import Points
from navcore.geometry.polyline import path_from
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.robot.profile import HUSKY
from tests.navcore.control.planning import (
    AHEAD,
    LOCAL,
    NONE,
    ORIGIN,
    TURNING,
    decide,
    footprints,
    ring,
    simulated,
    stands,
)

BEND: Points = np.array([[0.0, 0.0], [0.5, 0.0], [0.7, 0.5], [0.7, 1.5]])
"""A path that bends to the left."""
ROUND_THE_BEND: Points = np.array([[0.7, y] for y in (1.0, 1.1, 1.2)])
"""Unobserved cells that it leads over."""


def test_an_open_path_is_followed_straight_ahead() -> None:
    motion = decide()
    assert motion.outcome is ControllerState.FOLLOW
    assert motion.twist.v_mps > 0.7
    assert motion.twist.w_radps == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_robot_turns_in_place_towards_a_path_that_leads_back(side: float) -> None:
    motion = decide(path=AHEAD * [-1.0, 1.0] + [0.0, side * 0.3])
    assert motion.outcome is ControllerState.TURN
    assert motion.twist.v_mps == 0.0
    assert math.copysign(1.0, motion.twist.w_radps) == side


def test_the_robot_does_not_turn_in_place_where_its_corners_would_touch() -> None:
    walls = np.array([(x, y) for x in np.arange(-2, 2.01, 0.1) for y in (0.5, -0.5)])
    motion = decide(geometric=walls, path=AHEAD * -1.0)
    assert motion.outcome is not ControllerState.TURN
    assert decide(geometric=walls * [1.0, 2.0], path=AHEAD * -1.0).outcome is ControllerState.TURN


def test_the_robot_turns_in_the_longer_direction_when_the_shorter_one_is_blocked() -> None:
    behind_left = math.radians(100)
    path = AHEAD[:, :1] * [math.cos(behind_left), math.sin(behind_left)]
    corner = np.array([[0.36, 0.5]])
    motion = decide(geometric=corner, path=path)
    assert decide(path=path).twist.w_radps > 0
    assert motion.outcome is not ControllerState.TURN or motion.twist.w_radps < 0


def test_turning_goes_on_until_the_path_lies_ahead() -> None:
    slanted = AHEAD[:, :1] * [math.cos(math.radians(30)), math.sin(math.radians(30))]
    assert decide(path=slanted).outcome is ControllerState.FOLLOW
    assert decide(path=slanted, previous=TURNING).outcome is ControllerState.TURN


@pytest.mark.parametrize("path", [AHEAD, -AHEAD], ids=["ahead", "behind"])
def test_a_robot_that_is_boxed_in_stands_and_says_so(
    path: Points,
) -> None:
    for walls in (ring(0.57, 0.42), ring(0.62, 0.45)):
        assert stands(decide(geometric=walls, path=path), ControllerState.BLOCKED)
        assert stands(decide(forbidden=walls, path=path), ControllerState.BLOCKED)


def test_a_zone_is_as_hard_as_a_wall() -> None:
    differ = 0
    for seed in range(60):
        points = np.random.default_rng(seed).uniform(-2.5, 2.5, (6, 2))
        points = points[outside(points, HUSKY, 0.0)]
        as_wall, as_zone = decide(geometric=points), decide(forbidden=points)
        assert (as_wall.twist, as_wall.outcome) == (as_zone.twist, as_zone.outcome)
        differ += as_wall.twist != decide().twist
    assert differ > 10


@pytest.mark.parametrize("gap_m", [0.01, 0.03, 0.05, 0.065])
def test_beside_what_touches_its_side_the_robot_drives_on_and_from_its_rear_away(
    gap_m: float,
) -> None:
    """A person has come up to it, a zone was drawn there, it was switched on beside a wall."""
    along = np.linspace(-0.5, 0.5, 11)
    beside = np.column_stack([along, np.full(11, HUSKY.width_m / 2 + gap_m)])
    behind = np.column_stack([np.full(7, -HUSKY.length_m / 2 - gap_m), np.linspace(-0.3, 0.3, 7)])
    for near in (beside, behind):
        for motion in (decide(forbidden=near), decide(geometric=near), decide(people_cells=near)):
            assert motion.outcome is ControllerState.FOLLOW and motion.twist.v_mps > 0.1
    into = decide(forbidden=beside, path=np.array([[0.0, 0.0], [0.0, 2.0]]))
    assert not newly_near(into.twist, beside)


def newly_near(twist: Twist, cells: Points) -> bool:
    """Whether a motion from the origin brings the body nearer to any of the cells."""
    away_m = np.array([HUSKY.distances_m(p.from_parent(cells)) for p in simulated(twist, ORIGIN)])
    return bool((away_m.min(axis=0) < away_m[0] - 1e-3).any())


@pytest.mark.parametrize("y_m", [-0.33, 0.0, 0.2])
def test_from_what_has_come_up_right_before_its_front_the_robot_backs_off(y_m: float) -> None:
    """A class with a margin, seen only from nearby: its cells touch the body and no motion forward
    is free."""
    across = np.column_stack(
        [np.full(9, HUSKY.length_m / 2 + 0.016), np.linspace(y_m - 0.1, y_m + 0.1, 9)]
    )
    for motion in (decide(forbidden=across), decide(geometric=across)):
        backs = motion.outcome in (ControllerState.BACK, ControllerState.MANOEUVRE)
        assert backs and motion.twist.v_mps < 0
    behind = np.column_stack([-across[:, 0], across[:, 1]])
    assert stands(decide(forbidden=np.vstack([across, behind])), ControllerState.BLOCKED), (
        "and not onto what it touches behind"
    )


def test_a_robot_in_a_wide_box_is_not_boxed_in() -> None:
    """Control of the box."""
    assert decide(geometric=ring(2.0, 2.0)).twist != STANDSTILL


def test_a_rule_within_the_body_stops_the_robot_and_geometric_noise_within_it_does_not() -> None:
    within = np.array([[0.2, 0.1]])
    assert stands(decide(forbidden=within), ControllerState.IN_ZONE)
    assert decide(geometric=within).outcome is ControllerState.FOLLOW


def test_the_body_is_swept_over_nothing_unseen_but_drives_up_to_it() -> None:
    beside = np.array([[-0.2, y] for y in (0.5, 0.55, -0.5, -0.55)])
    assert decide(path=-AHEAD).outcome is ControllerState.TURN
    assert decide(path=-AHEAD, unseen=beside).outcome is not ControllerState.TURN
    wall = np.array([[0.9, y] for y in np.arange(-1.5, 1.51, 0.05)])
    assert 0.0 < decide(unseen=wall).twist.v_mps < decide().twist.v_mps
    within = decide(unseen=ring(0.51, 0.36))
    assert stands(within, ControllerState.BLOCKED) and within.unseen
    walled_in = decide(unseen=ring(0.51, 0.36), geometric=ring(0.6, 0.42))
    assert stands(walled_in, ControllerState.BLOCKED) and not walled_in.unseen


def test_where_the_path_bends_over_unseen_floor_the_robot_looks_there_while_it_has_room() -> None:
    motion = decide(path=BEND, unseen=ROUND_THE_BEND)
    assert motion.outcome is ControllerState.LOOK
    assert motion.twist.v_mps == 0.0 < motion.twist.w_radps
    looking = Motion(twist=STANDSTILL, outcome=ControllerState.LOOK)
    seen = decide(path=BEND, previous=looking)
    assert seen.outcome is ControllerState.FOLLOW and seen.twist.v_mps > 0.0


def test_a_padding_that_reaches_beyond_what_is_measured_keeps_no_robot_from_looking() -> None:
    local = dataclasses.replace(LOCAL, padding_m=0.25)
    motion = decide(path=BEND, unseen=ROUND_THE_BEND, local=local)
    assert motion.outcome is ControllerState.LOOK


def test_the_robot_does_not_turn_to_floor_that_it_could_not_see_or_close_to_an_obstacle() -> None:
    wall = np.array([[x, 0.75] for x in np.arange(0.3, 1.0, 0.1)])
    beside_the_body = np.array([[-0.2, 0.55]])
    beyond_the_bend = np.array([[2.0, 2.0]])
    near = np.array([[0.0, -0.75]])
    for unseen, obstacles in (
        (ROUND_THE_BEND, wall),
        (ROUND_THE_BEND, near),
        (beside_the_body, NONE),
        (beyond_the_bend, NONE),
    ):
        motion = decide(path=BEND, unseen=unseen, geometric=obstacles)
        assert motion.outcome is not ControllerState.LOOK


@pytest.mark.parametrize(("post", "looks"), [((-0.3, 0.6), False), ((-0.3, 0.75), True)])
def test_in_a_door_the_robot_drives_on_before_it_looks(
    post: tuple[float, float], looks: bool
) -> None:
    """The turn that it begins keeps clear of the posts, and leaves it askew between them."""
    motion = decide(path=BEND, unseen=ROUND_THE_BEND, geometric=np.array([post]))
    assert (motion.outcome is ControllerState.LOOK) is looks
    assert looks or motion.outcome is ControllerState.FOLLOW


def test_a_wall_ahead_slows_the_robot_down_the_nearer_it_is() -> None:
    speeds = [
        decide(geometric=np.array([[x, y] for y in np.arange(-1.5, 1.51, 0.1)])).twist.v_mps
        for x in (2.4, 1.6, 0.8)
    ]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] > speeds[-1]


def test_a_path_round_a_corner_between_walls_is_driven_to_its_end_and_nothing_is_touched() -> None:
    walls = [
        *((x, y) for x in np.arange(-1, 3, 0.1) for y in (-0.8, 0.8)),
        *((4.6, y) for y in np.arange(-0.8, 4, 0.1)),
    ]
    walls += [
        *((x, -0.8) for x in np.arange(3, 4.6, 0.1)),
        *((2.9, y) for y in np.arange(0.8, 4, 0.1)),
    ]
    corner = np.array([[0, 0], [3.3, 0], [3.75, 0.45], [3.75, 3.5]])
    along = np.linspace(0, 1, 70)
    path = np.column_stack(
        [np.interp(along, [0, 0.48, 0.57, 1], corner[:, axis]) for axis in (0, 1)]
    )
    cells, pose, motion = np.array(walls), Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), IDLE
    bodies, standing = shapely.box(*(cells - 0.05).T, *(cells + 0.05).T), 0
    for _ in range(200):
        motion = decide(
            geometric=pose.from_parent(cells),
            path=path,
            pose=pose,
            previous=motion,
            twist=motion.twist,
        )
        if motion.outcome is ControllerState.ARRIVED:
            break
        standing += motion.twist == STANDSTILL
        pose = simulated(motion.twist, pose)[20]  # after 0.1 s
        assert not shapely.intersects(footprints([pose])[0], bodies).any()
    assert motion.outcome is ControllerState.ARRIVED and standing == 0


BEHIND = [
    [(-0.401, -0.453), (-1.011, 0.25), (-1.143, -0.368)],
    [(0.378, 0.541), (-0.555, -0.453), (-0.726, -0.247)],
    [(0.245, -0.5), (-0.51, 0.474), (-0.874, -0.233)],
    [(0.363, 0.421), (-0.812, 0.763), (-0.794, -0.173)],
]


@pytest.mark.parametrize("points", BEHIND)
def test_backing_off_drives_the_arc_that_was_found_clear(points: list[tuple[float, float]]) -> None:
    """A wall ahead and posts behind: only an arc backwards is free, and it must be the one that was
    checked."""
    wall = [(0.58, y) for y in np.arange(-0.5, 0.51, 0.1)]
    obstacles = np.array([*wall, *points])
    motion = decide(geometric=obstacles)
    low, high = (obstacles - 0.05).T, (obstacles + 0.05).T
    cells: npt.NDArray[np.object_] = np.asarray(shapely.box(low[0], low[1], high[0], high[1]))
    hits = shapely.intersects(
        footprints(simulated(motion.twist, Pose2(x_m=0, y_m=0, yaw_rad=0)))[:, None], cells[None, :]
    )
    assert motion.twist.v_mps <= 0
    assert not hits[0].any()
    assert not hits.any()


def test_the_path_is_seen_from_the_robot_from_its_nearest_point_on() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    seen = path_from(path, Pose2(x_m=1.1, y_m=-0.5, yaw_rad=math.pi / 2))
    np.testing.assert_allclose(seen, [[0.5, 0.1], [0.5, -0.9], [1.5, -0.9]], atol=1e-12)
