"""Manoeuvres: the true footprint is free at every pose, and they lead through where no single arc
does."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import shapely

from navcore.config.control import LocalPlannerConfig, ManoeuvreConfig, StateLatticeConfig
from navcore.control.local_planner import LocalPlannerInput, compute_velocity
from navcore.control.manoeuvre.manoeuvre import (
    Manoeuvre,
    ManoeuvreProblem,
    manoeuvre_along,
    manoeuvre_to_see,
)
from navcore.control.manoeuvre.steering import steer
from navcore.control.motion import BLOCKED, IDLE, ControllerState, Motion
from navcore.control.people.people_state import NO_PEOPLE, PeopleState
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY

HERE = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
NONE: Points = np.empty((0, 2))
CLEARANCE_M, CELL_M = 0.04, 0.05
CELL_RADIUS_M = CELL_M * math.sqrt(0.5)
TICK_S = 0.1
MANOEUVRE, LATTICE = ManoeuvreConfig(), StateLatticeConfig()


def line(*corners: tuple[float, float]) -> Points:
    """Points every 5 cm along straights from corner to corner."""
    parts = []
    for (x0, y0), (x1, y1) in itertools.pairwise(corners):
        count = math.ceil(math.dist((x0, y0), (x1, y1)) / 0.05) + 1
        parts.append(np.column_stack([np.linspace(x0, x1, count), np.linspace(y0, y1, count)]))
    return np.vstack(parts)


def tight(obstacles: Points, unseen: Points = NONE) -> ManoeuvreProblem:
    return ManoeuvreProblem(
        obstacles=obstacles,
        cell_radius_m=CELL_RADIUS_M,
        unseen=unseen,
        unseen_clearance_m=CELL_RADIUS_M,
        profile=HUSKY,
        clearance_m=CLEARANCE_M,
    )


def find(
    path: Points, obstacles: Points = NONE, unseen: Points = NONE, pose: Pose2 = HERE
) -> Manoeuvre | None:
    return manoeuvre_along(path, tight(obstacles, unseen), pose)


def bodies(poses: Points) -> list[shapely.Polygon]:
    """The oriented footprint at each of (K, 3) poses."""
    return [
        shapely.affinity.translate(
            shapely.affinity.rotate(shapely.box(-0.5, -0.35, 0.5, 0.35), yaw, (0, 0), True), x, y
        )
        for x, y, yaw in poses.tolist()
    ]


AHEAD = line((0, 0), (3, 0))
ZIGZAG = np.vstack(
    [line((1.1, 0.5), (1.1, 2.5)), line((1.1, -0.5), (1.1, -2.5)), line((2.6, 0.3), (2.6, -2.5))]
)
"""A gap of a metre straight ahead, and a wall behind it that only leaves the left."""
SIDE_DOOR = np.vstack(
    [line((-3, 0.6), (0.9, 0.6)), line((1.95, 0.6), (3, 0.6)), line((-3, -0.75), (3, -0.75))]
)
"""A corridor with a door in its side."""
DEAD_END = np.vstack(
    [
        line((0.75, -0.8), (0.75, 0.8)),
        line((-3.0, 0.8), (0.75, 0.8)),
        line((-3.0, -0.8), (0.75, -0.8)),
    ]
)
NARROW = DEAD_END * [1.0, 0.6]
BOX = line((0.8, 0.65), (0.8, -0.65), (-0.8, -0.65), (-0.8, 0.65), (0.8, 0.65))


@pytest.mark.parametrize("seed", range(40))
def test_the_true_footprint_is_free_at_every_pose_and_each_pose_follows_from_the_one_before(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-2.5, 2.5, (int(rng.choice([8, 20, 40])), 2))
    points = points[(np.abs(points) > [0.6, 0.45]).any(axis=1)]
    unseen = rng.uniform(-2.5, 2.5, (6, 2))
    unseen = unseen[(np.abs(unseen) > [0.55, 0.4]).any(axis=1)]
    bearing = rng.uniform(-math.pi, math.pi)
    path = line((0, 0), (3 * math.cos(bearing), 3 * math.sin(bearing)))
    pose = Pose2(x_m=4.0, y_m=-2.0, yaw_rad=1.0)
    manoeuvre = find(path, points, unseen, pose)
    if manoeuvre is None:
        assert seed not in (0, 1, 2)  # of these it is known that there is one
        return
    base = manoeuvre.in_base(pose)
    clear_of = shapely.multipoints(points)
    for body in bodies(base):
        assert (
            body.distance(clear_of) > CLEARANCE_M + CELL_RADIUS_M - 0.004
        )  # between two steps a corner bulges by millimetres
        assert (
            len(unseen) == 0
            or body.distance(shapely.multipoints(unseen)) > 0
            or body.buffer(-0.004).disjoint(shapely.multipoints(unseen))
        )
    before = np.zeros(3)
    for after, gear in zip(base, manoeuvre.gears.tolist(), strict=True):
        moved, turned = after[:2] - before[:2], after[2] - before[2]
        middle = before[2] + turned / 2
        along = moved @ [math.cos(middle), math.sin(middle)]
        assert abs(moved @ [-math.sin(middle), math.cos(middle)]) < 1e-9  # nothing slips sideways
        if abs(gear) == 2:
            assert np.abs(moved).max() < 1e-9 and turned * gear > 0
        else:
            assert along * gear > 0 and abs(turned) < 3.0 * abs(along)
        before = after
    assert np.hypot(*(path - base[-1, :2]).T).min() < 0.35
    assert np.abs(base[:, :2]).max() <= LATTICE.half_side_m


def test_nothing_is_found_in_a_box_or_before_a_wall_and_unseen_cells_are_closed() -> None:
    assert find(AHEAD, BOX) is None
    assert find(AHEAD, line((0.62, -3), (0.62, 3))) is None
    assert find(AHEAD, unseen=line((0.62, -3), (0.62, 3))) is None
    assert (
        find(AHEAD, line((0.62, -3), (0.62, 0.4))) is not None
    )  # control: a wall that leaves a detour


def test_a_path_that_leads_back_out_of_a_dead_end_is_come_to_in_reverse() -> None:
    narrow = DEAD_END * [1.0, 0.6]
    found = find(-AHEAD, narrow)
    assert found is not None and found.gears[0] == -1


def decide(
    path: Points,
    near: Points,
    previous: Motion,
    *,
    pose: Pose2 = HERE,
    people: PeopleState = NO_PEOPLE,
) -> Motion:
    """A decision among cells of the base frame."""
    return compute_velocity(
        LocalPlannerInput(
            geometric=near,
            forbidden=NONE,
            unseen=NONE,
            cell_m=CELL_M,
            path=path,
            pose=pose,
            previous=previous,
            profile=HUSKY,
            local=LocalPlannerConfig(),
            people=people,
        )
    )


def drive(
    path: Points, obstacles: Points, *, seconds: float, slip: float = 0.0, seed: int = 0
) -> tuple[list[Motion], Pose2]:
    """A robot that moves as it decides, but for some slip; it must never touch anything."""
    rng, pose, motion, motions = np.random.default_rng(seed), HERE, IDLE, list[Motion]()
    cells = shapely.multipoints(obstacles)
    for _ in range(round(seconds / TICK_S)):
        offset = obstacles - np.array([pose.x_m, pose.y_m])
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        motion = decide(path, offset @ np.array([[cos, -sin], [sin, cos]]), motion, pose=pose)
        motions.append(motion)
        moved = motion.twist.v_mps * TICK_S * (1 + slip * rng.normal())
        turned = motion.twist.w_radps * TICK_S * (1 + slip * rng.normal())
        half = Pose2(x_m=0.0, y_m=0.0, yaw_rad=turned / 2)
        pose = (
            pose
            @ half
            @ Pose2(x_m=moved, y_m=slip * rng.normal() * abs(turned) * 0.2, yaw_rad=0.0)
            @ half
        )
        (body,) = bodies(np.array([[pose.x_m, pose.y_m, pose.yaw_rad]]))
        assert body.distance(cells) > 0
        if motion.outcome is ControllerState.ARRIVED:
            break
    return motions, pose


@pytest.mark.parametrize("slip", [0.0, 0.2])
@pytest.mark.parametrize(
    ("path", "obstacles"),
    [
        (line((0, 0), (1.6, 0.0), (1.75, 0.3), (1.75, 2.4)), ZIGZAG),
        (line((0, 0), (1.25, 0.05), (1.45, 0.3), (1.45, 2.5)), SIDE_DOOR),
        (line((0, 0), (-2.5, 0)), DEAD_END),
        (line((0, 0), (-2.5, 0)), DEAD_END * [1.0, 0.6]),
    ],
)
def test_the_robot_comes_through_tight_places_without_touching_anything(
    path: Points, obstacles: Points, slip: float
) -> None:
    motions, pose = drive(path, obstacles, seconds=60.0, slip=slip)
    assert motions[-1].outcome is ControllerState.ARRIVED
    assert pose.distance_to(*path[-1].tolist()) < 0.15
    assert ControllerState.BLOCKED not in {motion.outcome for motion in motions}


def test_a_manoeuvre_is_steered_to_its_end_and_dropped_when_the_robot_is_off_it() -> None:
    found = find(-AHEAD, DEAD_END * [1.0, 0.6])
    assert found is not None
    pose, left, count = HERE, found, 0
    while (steered := steer(left, pose, braking_mps2=0.8)) is not None and count < 600:
        twist, left = steered
        half = Pose2(x_m=0.0, y_m=0.0, yaw_rad=twist.w_radps * TICK_S / 2)
        pose, count = (
            pose @ half @ Pose2(x_m=twist.v_mps * TICK_S, y_m=0.0, yaw_rad=0.0) @ half,
            count + 1,
        )
    x, y, yaw = found.poses[-1].tolist()
    assert pose.distance_to(x, y) < 0.05 and abs(wrap_angle(pose.yaw_rad - yaw)) < 0.1
    assert (
        steer(
            found, Pose2(x_m=0.0, y_m=MANOEUVRE.max_error_m + 0.02, yaw_rad=0.0), braking_mps2=0.8
        )
        is None
    )


def test_a_manoeuvre_is_given_up_when_it_is_blocked_or_the_path_is_another() -> None:
    narrow = DEAD_END * [1.0, 0.6]
    first = decide(-AHEAD, narrow, IDLE)
    assert first.outcome is ControllerState.MANOEUVRE and first.twist.v_mps < 0
    assert decide(-AHEAD, narrow, first).manoeuvre is not None
    assert decide(AHEAD, NONE, first).outcome is ControllerState.FOLLOW
    shut = np.vstack([narrow, line((-0.62, -0.5), (-0.62, 0.5))])
    assert decide(-AHEAD, shut, first) is BLOCKED


def test_round_a_corner_that_hides_the_path_the_robot_goes_on_and_turns_to_see_it() -> None:
    wall_left = line((-3.0, 0.55), (0.3, 0.55))
    unseen = np.vstack([line((0.35, 0.6), (0.35, 3.0)), line((-3.0, 0.65), (0.35, 0.65))])
    path = line((0, 0), (0.35, 0.2), (-0.6, 2.5))
    found = manoeuvre_to_see(path, tight(wall_left, unseen), HERE)
    assert found is not None
    x, y, yaw = found.poses[-1].tolist()
    corner = unseen[np.hypot(*unseen.T).argmin()]
    assert np.hypot(*(path - found.target).T).min() < 1e-9
    assert math.hypot(corner[0] - x, corner[1] - y) > 1.1  # not where the robot's own body hides it
    assert abs(wrap_angle(math.atan2(corner[1] - y, corner[0] - x) - yaw)) < math.radians(30)
    assert shapely.LineString([(x, y), corner]).distance(shapely.multipoints(wall_left)) > 0.02
    beside = line((0, -0.1), (3, -0.1))
    assert (
        manoeuvre_to_see(beside, tight(wall_left, unseen), HERE) is None
    )  # nothing hides that path


def test_a_manoeuvre_waits_for_a_person_who_crosses_it_and_goes_on_afterwards() -> None:
    first = decide(-AHEAD, NARROW, IDLE)
    assert first.manoeuvre is not None
    walker = Track(
        id=1,
        x_m=-2.4,
        y_m=0.0,
        vx_mps=0.7,
        vy_mps=0.0,
        radius_m=0.3,
        age_s=9.0,
        last_seen_ns=0,
        walking_speed_mps=0.7,
    )
    waiting = decide(-AHEAD, NARROW, first, people=PeopleState.of((walker,), HERE))
    assert (
        waiting.outcome is ControllerState.WAIT_FOR_PEOPLE
        and waiting.twist.v_mps == 0.0
        and waiting.manoeuvre is not None
    )
    assert decide(-AHEAD, NARROW, waiting).outcome is ControllerState.MANOEUVRE
