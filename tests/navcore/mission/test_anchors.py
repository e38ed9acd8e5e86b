"""Zones and goals move rigidly with the poses beside which they were drawn, and otherwise stay."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.geometry.transform import Pose2
from navcore.mission.anchors import Anchored, anchored, corners_of, moved_m
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from navcore.mission.zone_shapes import Circle, Corridor, still_drawn
from tests.navcore.laws import law

SQUARE = Zone(id="z", name="carpet", polygon=((3.0, 0.0), (5.0, 0.0), (5.0, 1.0), (3.0, 1.0)))
GOAL = Goal(id=1, x_m=4.0, y_m=1.0, yaw_rad=0.5)


def pose(x: float, y: float = 0.0, yaw: float = 0.0) -> Pose2:
    return Pose2(x_m=x, y_m=y, yaw_rad=yaw)


PATH = tuple(pose(0.5 * k) for k in range(40))


def zone_at(poses: tuple[Pose2, ...], frozen: int = 0, zone: Zone = SQUARE) -> Anchored[Zone]:
    found = anchored(zone, poses, frozen)
    assert found is not None
    return found


def sides(zone: Zone) -> list[float]:
    corners = corners_of(zone)
    return [float(math.dist(a, b)) for a, b in zip(corners, np.roll(corners, 1, 0), strict=True)]


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_a_zone_moves_rigidly_and_comes_back_exactly_with_its_poses(seed: int) -> None:
    rng, zone = np.random.default_rng(seed), zone_at(PATH)
    before = PATH
    for _ in range(4):
        after = tuple(
            pose(p.x_m + rng.normal(0, 0.5), p.y_m + rng.normal(0, 0.5), rng.normal()) for p in PATH
        )
        new = zone.at(after)
        assert sides(new) == pytest.approx(sides(SQUARE))
        old = zone.at(before)
        apart = np.linalg.norm(corners_of(new) - corners_of(old), axis=1)
        assert moved_m(old, new) == pytest.approx(apart.max())
        before = after
    assert zone.at(PATH) == SQUARE


@law(40)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_when_the_whole_map_moves_zones_and_goals_move_with_it(
    x: float, y: float, yaw: float
) -> None:
    motion = pose(x, y, yaw)
    after = tuple(motion @ each for each in PATH)
    new = zone_at(PATH).at(after)
    np.testing.assert_allclose(corners_of(new), motion.to_parent(corners_of(SQUARE)), atol=1e-9)
    found = anchored(GOAL, PATH, 0)
    assert found is not None
    goal = found.at(after)
    np.testing.assert_allclose(corners_of(goal), motion.to_parent(corners_of(GOAL)), atol=1e-9)
    assert goal.yaw_rad is not None
    assert math.cos(goal.yaw_rad - 0.5 - yaw) == pytest.approx(1.0)


def test_poses_far_away_do_not_move_a_zone() -> None:
    zone = zone_at(PATH)
    corrected = (*PATH[:12], *(pose(p.x_m, 0.4, 0.1) for p in PATH[12:]))
    assert zone.at(corrected) == SQUARE
    near = tuple(pose(p.x_m, 0.4) if 3.0 <= p.x_m <= 5.0 else p for p in PATH)
    assert moved_m(SQUARE, zone.at(near)) == pytest.approx(0.4)  # control


def test_a_zone_far_from_every_pose_or_on_a_map_without_poses_stays() -> None:
    far = dataclasses.replace(SQUARE, polygon=((3.0, 20.0), (5.0, 20.0), (5.0, 21.0)))
    assert anchored(far, PATH, 0) is None
    assert anchored(SQUARE, (), 0) is None


def test_a_zone_beside_a_pose_of_the_loaded_map_stays_and_a_new_part_of_the_map_takes_its_own() -> (
    None
):
    assert anchored(SQUARE, PATH, len(PATH)) is None
    assert anchored(SQUARE, PATH, 12) is None
    mixed = zone_at((pose(20.0), *PATH), frozen=1)
    assert all(pose_id >= 1 for pose_id, _ in mixed.anchor.poses)


def test_shapes_stay_the_shapes_they_were_drawn_as() -> None:
    turned = tuple(pose(1.0, 2.0, 0.7) @ each for each in PATH)
    for shape in (
        Circle(centre=(4.0, 1.0), radius_m=1.5),
        Corridor(line=((3.0, 1.0), (5.0, 1.0), (5.0, 2.0)), width_m=0.4),
    ):
        drawn = dataclasses.replace(SQUARE, drawn=shape, polygon=shape.outline())
        new = zone_at(PATH, zone=drawn).at(turned)
        assert new.drawn is not None
        assert new.drawn != shape
        assert still_drawn(new.drawn, new.polygon) == new.drawn


def test_a_goal_without_a_heading_keeps_none() -> None:
    found = anchored(dataclasses.replace(GOAL, yaw_rad=None), PATH, 0)
    assert found is not None
    moved = found.at(tuple(pose(p.x_m, 0.2, 0.3) for p in PATH))
    assert moved.yaw_rad is None
    assert (moved.x_m, moved.y_m) != (GOAL.x_m, GOAL.y_m)
