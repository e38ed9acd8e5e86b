"""The local planner never drives the true, oriented footprint onto a cell, and follows the
path where it is free."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.control import LocalPlannerConfig
from navcore.control.collision.collision_checker import COMMAND_LIFE_S
from navcore.control.local_planner import LocalPlannerInput, compute_velocity
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.control.motions.path_follower import candidates
from navcore.control.people.people_state import NO_PEOPLE, PeopleState
from navcore.costmap.local_costmap import nearby, obstacle_masks, outside, people_mask
from navcore.geometry.arrays import Points
from navcore.geometry.polyline import path_from
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid
from navcore.robot.profile import HUSKY, RobotProfile
from tests.navcore.laws import law

SPEC = GridSpec.centred(size_m=(6.0, 6.0), resolution_m=0.1)
LOCAL = LocalPlannerConfig()
NONE: Points = np.empty((0, 2))
AHEAD: Points = np.column_stack([np.linspace(0, 3, 31), np.zeros(31)])
ORIGIN = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
TURNING = Motion(twist=STANDSTILL, outcome=ControllerState.TURN)
BEND: Points = np.array([[0.0, 0.0], [0.5, 0.0], [0.7, 0.5], [0.7, 1.5]])
"""A path that bends to the left."""
ROUND_THE_BEND: Points = np.array([[0.7, y] for y in (1.0, 1.1, 1.2)])
"""Unobserved cells that it leads over."""


def decide(
    *,
    geometric: Points = NONE,
    forbidden: Points = NONE,
    unseen: Points = NONE,
    path: Points = AHEAD,
    previous: Motion = IDLE,
    local: LocalPlannerConfig = LOCAL,
    people: PeopleState = NO_PEOPLE,
    goal_yaw_rad: float | None = None,
    ignore_predictions: bool = False,
    pose: Pose2 = ORIGIN,
    twist: Twist = STANDSTILL,
    retreat: Points | None = None,
    leaves_lane: bool = False,
    expects_return: bool = False,
    is_cautious: bool = False,
    people_cells: Points = NONE,
    profile: RobotProfile = HUSKY,
) -> Motion:
    """A decision, by default at the map's origin, where the base frame is the map frame."""
    return compute_velocity(
        LocalPlannerInput(
            geometric=geometric,
            forbidden=forbidden,
            unseen=unseen,
            cell_m=0.1,
            path=path,
            pose=pose,
            twist=twist,
            previous=previous,
            profile=profile,
            local=local,
            people=dataclasses.replace(
                people,
                expectations=dataclasses.replace(
                    people.expectations,
                    ignore_predictions=ignore_predictions,
                    leaves_lane=leaves_lane,
                    expects_return=expects_return,
                    is_cautious=is_cautious,
                ),
            ),
            goal_yaw_rad=goal_yaw_rad,
            retreat=retreat,
            people_cells=people_cells,
        )
    )


def stands(motion: Motion, outcome: ControllerState) -> bool:
    return motion.twist == STANDSTILL and motion.outcome is outcome


def simulated(twist: Twist, start: Pose2) -> list[Pose2]:
    """Where the robot comes by when the twist is held until it expires and the wheels then brake
    along the same arc."""
    step_s, pose, poses = 0.005, start, [start]
    share, elapsed = 1.0, 0.0
    fade = max(
        abs(twist.v_mps) / HUSKY.max_accel_mps2,
        abs(twist.w_radps) / HUSKY.max_yaw_accel_radps2,
        1e-9,
    )
    while share > 0:
        turn = twist.w_radps * share * step_s
        pose = pose @ Pose2(x_m=0, y_m=0, yaw_rad=turn / 2)
        pose = (
            pose
            @ Pose2(x_m=twist.v_mps * share * step_s, y_m=0, yaw_rad=0)
            @ Pose2(x_m=0, y_m=0, yaw_rad=turn / 2)
        )
        poses.append(pose)
        elapsed += step_s
        if elapsed > COMMAND_LIFE_S:
            share -= step_s / fade
    return poses


def footprints(poses: list[Pose2]) -> npt.NDArray[np.object_]:
    """The oriented body at each pose, less a tenth of a millimetre of rounding."""
    corners = HUSKY.footprint(-1e-4)
    turned = [
        corners
        @ np.array(
            [
                [math.cos(p.yaw_rad), math.sin(p.yaw_rad)],
                [-math.sin(p.yaw_rad), math.cos(p.yaw_rad)],
            ]
        )
        + [p.x_m, p.y_m]
        for p in poses
    ]
    return np.asarray(shapely.polygons(np.array(turned)))


def squares(mask: BoolGrid) -> npt.NDArray[np.object_]:
    """The marked cells as squares of the map frame."""
    x, y = SPEC.centres(np.argwhere(mask)).T
    return np.asarray(shapely.box(x - 0.05, y - 0.05, x + 0.05, y + 0.05))


def newly_touched(twist: Twist, pose: Pose2, mask: BoolGrid) -> int:
    """Cells outside the footprint now, that the motion drives onto; a cell so near that a corner of
    it may touch the body counts if the body comes nearer to its middle."""
    cells, centres = squares(mask), SPEC.centres(np.argwhere(mask))
    poses = simulated(twist, pose)
    bodies = footprints(poses)
    shapely.prepare(bodies)
    hits = shapely.intersects(bodies[:, None], cells[None, :])
    away_m = np.array([HUSKY.distances_m(one.from_parent(centres)) for one in poses])
    nearer = away_m.min(axis=0) < away_m[0] - 1e-4
    is_far = away_m[0] > SPEC.resolution_m * math.sqrt(0.5)
    return int((hits[1:].any(axis=0) & ~hits[0] & (is_far | nearer)).sum())


def world(seed: int) -> tuple[Pose2, BoolGrid, BoolGrid, Points, Motion]:
    """A robot somewhere among cells that do not touch it (a few may), tight or wide, with a path
    anywhere."""
    rng = np.random.default_rng(seed)
    pose = Pose2(
        x_m=rng.uniform(-0.3, 0.3),
        y_m=rng.uniform(-0.3, 0.3),
        yaw_rad=rng.uniform(-math.pi, math.pi),
    )
    mask = rng.random((SPEC.rows, SPEC.cols)) < rng.choice([0.005, 0.02, 0.05, 0.15, 0.4])
    x, y = SPEC.centres(np.argwhere(np.ones_like(mask))).T
    gap_m = rng.choice([0.001, 0.02, 0.06, 0.12, 0.25])
    body = shapely.buffer(footprints([pose])[0], gap_m)
    shapely.prepare(body)
    touching = shapely.intersects(
        body, shapely.box(x - 0.05, y - 0.05, x + 0.05, y + 0.05)
    ).reshape(mask.shape)
    mask &= ~touching
    if rng.random() < 0.15:
        mask |= touching & (rng.random(mask.shape) < 0.02)
    forbidden = mask & (rng.random(mask.shape) < 0.5)
    bearing, length = rng.uniform(-math.pi, math.pi), rng.uniform(0.3, 3.0)
    if rng.random() < 0.6:
        bearing *= 0.2
    along = np.linspace(0, length, 30)
    path = np.column_stack(
        [along * math.cos(bearing), along * math.sin(bearing) + rng.uniform(-0.3, 0.3) * along**2]
    )
    return pose, mask & ~forbidden, forbidden, path, TURNING if rng.random() < 0.3 else IDLE


def decision_in(seed: int) -> tuple[Motion, Pose2, BoolGrid]:
    pose, geometric, forbidden, path, previous = world(seed)
    grid = OccupancyGrid(spec=SPEC, geometric=geometric, beware={}, zones=forbidden)
    motion = decide(
        geometric=nearby(geometric, grid, pose, 2.6),
        forbidden=nearby(forbidden, grid, pose, 2.6),
        path=path,
        previous=previous,
    )
    return motion, pose, geometric | forbidden


@pytest.mark.parametrize("batch", range(6))
def test_no_motion_drives_the_footprint_onto_a_cell_it_did_not_touch(batch: int) -> None:
    touched = {}
    for seed in range(200 * batch, 200 * (batch + 1)):
        motion, pose, mask = decision_in(seed)
        count = newly_touched(motion.twist, pose, mask)
        if count:
            touched[seed] = (count, motion.outcome.name, motion.twist)
    assert not touched


def test_what_is_driven_is_one_of_the_candidates_and_free_where_it_begins() -> None:
    driven = 0
    for seed in range(120):
        motion, pose, _ = decision_in(seed)
        if motion.outcome is not ControllerState.FOLLOW:
            assert motion.arc is None
            continue
        _, geometric, forbidden, _, _ = world(seed)
        grid = OccupancyGrid(spec=SPEC, geometric=geometric, beware={}, zones=forbidden)
        near = [nearby(mask, grid, pose, 2.6) for mask in (geometric, forbidden)]
        points, free = candidates(
            geometric=near[0],
            forbidden=near[1],
            profile=HUSKY,
            local=LOCAL,
            cell_m=0.1,
        )
        assert motion.arc is not None and free[motion.arc] > 0
        # The last point of an arc tells the side it bends to; the first lies too near.
        assert np.sign(motion.twist.w_radps) == np.sign(points[motion.arc, -1, 1].round(9))
        driven += 1
    assert driven > 20


def test_the_search_for_touched_cells_would_see_a_reckless_motion() -> None:
    """Control: full speed ahead in the same worlds touches cells, and the planner moves in most of
    the open ones."""
    reckless, moving, kinds = 0, 0, set()
    for seed in range(150):
        motion, pose, mask = decision_in(seed)
        reckless += newly_touched(Twist(v_mps=1.0, w_radps=0.0), pose, mask) > 0
        moving += motion.twist != STANDSTILL
        kinds.add(motion.outcome)
    assert reckless > 30
    assert moving > 50
    assert kinds >= {
        ControllerState.FOLLOW,
        ControllerState.TURN,
        ControllerState.BACK,
        ControllerState.BLOCKED,
    }


@law(200)
@given(st.integers(0, 2**32 - 1))
def test_every_twist_is_finite_and_within_the_platforms_limits(seed: int) -> None:
    twist = decision_in(seed)[0].twist
    assert -HUSKY.max_speed_mps <= twist.v_mps <= HUSKY.max_speed_mps
    assert abs(twist.w_radps) <= HUSKY.max_yaw_rate_radps


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


def ring(reach_x: float, reach_y: float) -> Points:
    x, y = np.arange(-reach_x, reach_x + 0.01, 0.05), np.arange(-reach_y, reach_y + 0.01, 0.05)
    return np.vstack(
        [
            *([[v, s * reach_y] for v in x] for s in (-1, 1)),
            *([[s * reach_x, v] for v in y] for s in (-1, 1)),
        ]
    )


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


@pytest.mark.parametrize(("distance", "arrived"), [(0.0, True), (0.11, True), (0.13, False)])
def test_the_robot_has_arrived_when_the_goal_is_near_and_not_before(
    distance: float, arrived: bool
) -> None:
    motion = decide(path=np.array([[0.0, 0.0], [distance, 0.0]]))
    assert stands(motion, ControllerState.ARRIVED) == arrived


@pytest.mark.parametrize(
    ("behind_m", "nearly_m", "arrived"), [(0.2, 0.25, True), (0.3, 0.25, False), (0.2, 0.0, False)]
)
def test_for_the_last_hand_width_the_robot_does_not_manoeuvre(
    behind_m: float, nearly_m: float, arrived: bool
) -> None:
    x = np.arange(-2.0, 2.0, 0.1)
    corridor = np.vstack([np.column_stack([x, np.full(len(x), side)]) for side in (-0.55, 0.55)])
    motion = decide(
        geometric=corridor,
        path=np.array([[0.0, 0.0], [-behind_m, 0.0]]),
        local=LocalPlannerConfig(nearly_m=nearly_m),
    )
    assert motion.outcome in (
        (ControllerState.ARRIVED,) if arrived else (ControllerState.MANOEUVRE, ControllerState.BACK)
    )
    assert (motion.twist == STANDSTILL) is arrived
    in_the_open = decide(
        path=np.array([[0.0, 0.0], [-behind_m, 0.0]]), local=LocalPlannerConfig(nearly_m=nearly_m)
    )
    assert in_the_open.outcome is ControllerState.TURN


def test_at_the_goal_the_robot_turns_in_place_to_the_heading_asked_for_and_has_arrived_then() -> (
    None
):
    here = np.array([[0.05, 0.0]])
    for yaw_rad in (1.5, -1.5):
        motion = decide(path=here, goal_yaw_rad=yaw_rad)
        assert (
            motion.outcome is ControllerState.ALIGN
            and motion.twist.v_mps == 0.0
            and motion.twist.w_radps * yaw_rad > 0
        )
    assert stands(decide(path=here, goal_yaw_rad=0.05), ControllerState.ARRIVED)
    assert decide(goal_yaw_rad=1.5).outcome is ControllerState.FOLLOW


def test_a_robot_that_skids_off_the_goal_while_it_turns_goes_on_turning_but_not_from_anywhere() -> (
    None
):
    aligning = Motion(twist=STANDSTILL, outcome=ControllerState.ALIGN)
    for distance, turns in ((0.2, True), (0.3, False)):
        motion = decide(path=np.array([[distance, 0.0]]), previous=aligning, goal_yaw_rad=1.5)
        assert (motion.outcome is ControllerState.ALIGN) == turns
    assert (
        decide(path=np.array([[0.0, 0.0], [0.2, 0.0]]), goal_yaw_rad=1.5).outcome
        is ControllerState.FOLLOW
    )


def test_a_blocked_turn_to_the_heading_is_boxed_in_and_a_zone_under_the_body_has_priority() -> None:
    here = np.array([[0.05, 0.0]])
    assert stands(
        decide(path=here, geometric=ring(0.55, 0.4), goal_yaw_rad=1.5), ControllerState.BLOCKED
    )
    assert stands(
        decide(path=here, forbidden=np.array([[0.2, 0.0]]), goal_yaw_rad=1.5),
        ControllerState.IN_ZONE,
    )


def test_a_turn_to_the_heading_over_unseen_cells_begins_with_a_look_at_them() -> None:
    here = np.array([[0.05, 0.0]])
    beside = np.array([[x, -0.5] for x in np.arange(-0.3, 0.31, 0.05)])
    assert decide(path=here, goal_yaw_rad=1.5).outcome is ControllerState.ALIGN
    pose, motion = ORIGIN, decide(path=here, unseen=beside, goal_yaw_rad=1.5)
    for _ in range(300):
        if motion.manoeuvre is None:
            break
        pose = simulated(motion.twist, pose)[20]
        motion = decide(
            path=here,
            unseen=pose.from_parent(beside),
            goal_yaw_rad=1.5,
            pose=pose,
            previous=motion,
        )
    to_cells = pose.from_parent(beside)
    bearings = np.abs(np.arctan2(to_cells[:, 1], to_cells[:, 0]))
    assert to_cells[:, 0].min() > HUSKY.length_m / 2
    assert bearings.max() < math.radians(43.5)  # the cells are in view


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


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_nearby_cells_are_those_around_the_robot_seen_from_it(seed: int) -> None:
    pose, mask, _, _, _ = world(seed)
    grid = OccupancyGrid(spec=SPEC, geometric=mask, beware={}, zones=mask)
    points = nearby(mask, grid, pose, 1.0)
    back = [(pose @ Pose2(x_m=x, y_m=y, yaw_rad=0)) for x, y in points]
    cells = {SPEC.cell(p.x_m, p.y_m) for p in back}
    assert len(cells) == len(points)
    assert all(mask[cell] for cell in cells)
    expected = {
        (int(r), int(c))
        for r, c in np.argwhere(mask)
        if math.dist(SPEC.centre(r, c), (pose.x_m, pose.y_m)) <= 1.0
    }
    assert expected <= cells


def test_nearby_finds_nothing_off_the_grid() -> None:
    full = np.ones((SPEC.rows, SPEC.cols), dtype=np.bool_)
    grid = OccupancyGrid(spec=SPEC, geometric=full, beware={}, zones=full)
    for x, y in ((50.0, 0.0), (-50.0, 0.0), (0.0, -50.0)):
        assert len(nearby(full, grid, Pose2(x_m=x, y_m=y, yaw_rad=0.0), 2.0)) == 0


def test_forbidden_cells_are_zones_and_beware_classes_grown_by_their_margins() -> None:
    one, empty = (
        np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_),
        np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_),
    )
    one[30, 30] = True
    grid = OccupancyGrid(
        spec=SPEC, geometric=empty, beware={1: one}, margins_m={1: 0.2}, zones=empty
    )
    geometric, forbidden = obstacle_masks(grid)
    assert not geometric.any()
    assert np.flatnonzero(forbidden[30]).tolist() == list(range(28, 33))
    wide = OccupancyGrid(spec=SPEC, geometric=one, beware={}, zones=empty, wide_zones=((0.1, one),))
    assert obstacle_masks(wide)[1].sum() == 5
    person = OccupancyGrid(
        spec=SPEC, geometric=empty, beware={3: one}, zones=empty, margins_m={3: 0.1}
    )
    assert obstacle_masks(person)[1].sum() == people_mask(person, [3]).sum() > one.sum()
    assert obstacle_masks(person, people=[3])[1].sum() == people_mask(person, [4]).sum() == 0
    np.testing.assert_array_equal(obstacle_masks(wide)[0], one)
    assert not empty.any()


def test_the_path_is_seen_from_the_robot_from_its_nearest_point_on() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    seen = path_from(path, Pose2(x_m=1.1, y_m=-0.5, yaw_rad=math.pi / 2))
    np.testing.assert_allclose(seen, [[0.5, 0.1], [0.5, -0.9], [1.5, -0.9]], atol=1e-12)
