"""Zones and goals move rigidly with the poses beside which they were drawn, and otherwise stay."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.geometry.transform import Pose2
from navcore.mission.anchor import Anchor, NumberedPoses
from navcore.mission.anchors import Item, anchored, is_anchored, moved_m, place_of, placed
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from navcore.mission.zone_shapes import Circle, Corridor, still_drawn
from tests.navcore.laws import law

SQUARE = Zone(id="z", name="carpet", polygon=((3.0, 0.0), (5.0, 0.0), (5.0, 1.0), (3.0, 1.0)))
GOAL = Goal(id=1, x_m=4.0, y_m=1.0, yaw_rad=0.5)


def pose(x: float, y: float = 0.0, yaw: float = 0.0) -> Pose2:
    return Pose2(x_m=x, y_m=y, yaw_rad=yaw)


PATH = tuple(pose(0.5 * k) for k in range(40))


def numbered(poses: tuple[Pose2, ...], frozen: int = 0, numbering: str = "new") -> NumberedPoses:
    return NumberedPoses(
        numbering=numbering, poses=poses, frozen=frozen, loaded_numbering="old" if frozen else ""
    )


def drawn(item: Item, poses: tuple[Pose2, ...] = PATH, frozen: int = 0) -> Item:
    """Return an item that is drawn beside poses."""
    found = anchored(item, numbered(poses, frozen))
    assert is_anchored(found, "new") and anchored(found, numbered(poses, frozen)) is found
    return found


def anchor_of(item: Zone | Goal) -> Anchor:
    return item.anchors[0]


def at(item: Item, poses: tuple[Pose2, ...]) -> Item:
    return placed(item, numbered(poses))


def sides(zone: Zone) -> list[float]:
    corners = place_of(zone).corners
    return [float(math.dist(a, b)) for a, b in zip(corners, np.roll(corners, 1, 0), strict=True)]


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_a_zone_moves_rigidly_and_comes_back_exactly_with_its_poses(seed: int) -> None:
    rng, zone = np.random.default_rng(seed), drawn(SQUARE)
    for _ in range(4):
        after = tuple(
            pose(p.x_m + rng.normal(0, 0.5), p.y_m + rng.normal(0, 0.5), rng.normal()) for p in PATH
        )
        old, zone = zone, at(zone, after)
        assert sides(zone) == pytest.approx(sides(SQUARE))
        before, now = place_of(old), place_of(zone)
        apart = np.linalg.norm(now.corners - before.corners, axis=1)
        assert moved_m(before, now) == pytest.approx(apart.max())
    assert moved_m(place_of(zone), place_of(SQUARE)) > 0.01
    assert at(zone, PATH) == SQUARE


@law(40)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_when_the_whole_map_moves_zones_and_goals_move_with_it(
    x: float, y: float, yaw: float
) -> None:
    motion = pose(x, y, yaw)
    after = tuple(motion @ each for each in PATH)
    zone, goal = at(drawn(SQUARE), after), at(drawn(GOAL), after)
    for before, there in ((SQUARE, zone), (GOAL, goal)):
        expected = motion.to_parent(place_of(before).corners)
        np.testing.assert_allclose(place_of(there).corners, expected, atol=0.01)
    assert goal.yaw_rad is not None
    assert math.cos(goal.yaw_rad - 0.5 - yaw) == pytest.approx(1.0, abs=1e-4)


def test_poses_far_away_do_not_move_a_zone() -> None:
    zone = drawn(SQUARE)
    assert at(zone, (*PATH[:12], *(pose(p.x_m, 0.4, 0.1) for p in PATH[12:]))) is zone
    near = tuple(pose(p.x_m, 0.4) if 3.0 <= p.x_m <= 5.0 else p for p in PATH)
    assert moved_m(place_of(SQUARE), place_of(at(zone, near))) == pytest.approx(0.4)  # control


def test_a_zone_far_from_every_pose_or_on_a_map_without_poses_stays() -> None:
    far = dataclasses.replace(SQUARE, polygon=((3.0, 20.0), (5.0, 20.0), (5.0, 21.0)))
    assert anchor_of(drawn(far)).poses == ()
    assert anchor_of(drawn(SQUARE, ())).poses == ()
    assert at(drawn(SQUARE, ()), PATH) == SQUARE


def test_a_zone_beside_a_pose_of_the_loaded_map_stays_and_a_new_part_of_the_map_takes_its_own() -> (
    None
):
    assert anchor_of(drawn(SQUARE, PATH, len(PATH))).poses == ()
    assert anchor_of(drawn(SQUARE, PATH, 12)).poses == ()
    mixed = anchor_of(drawn(SQUARE, (pose(20.0), *PATH), frozen=1))
    assert mixed.poses and all(pose_id >= 1 for pose_id, _ in mixed.poses)


def test_a_zone_that_an_operator_has_put_elsewhere_is_anchored_there() -> None:
    moved = tuple(pose(p.x_m, 0.4) for p in PATH)
    elsewhere = dataclasses.replace(drawn(SQUARE), polygon=((8.0, 0.0), (9.0, 0.0), (9.0, 1.0)))
    assert at(elsewhere, moved) is elsewhere
    again = anchored(elsewhere, numbered(PATH))
    assert {n for n, _ in anchor_of(again).poses} == {16, 17, 18, 15, 19}
    assert at(again, moved).polygon[0] == pytest.approx((8.0, 0.4))


def test_an_item_is_where_any_map_that_it_was_drawn_on_has_it() -> None:
    """It was drawn on one map, and moved on the next one, on which that was loaded."""
    moved = tuple(pose(p.x_m, 0.4) for p in PATH)
    old = anchored(SQUARE, numbered(PATH, numbering="old"))
    loaded = numbered(PATH, frozen=len(PATH))
    stays = anchored(old, loaded)
    assert anchor_of(stays).poses == () and placed(stays, loaded) is stays
    assert placed(stays, numbered(moved, numbering="old")).polygon[0] == pytest.approx((3.0, 0.4))
    newer = anchored(at_new := dataclasses.replace(old), numbered(PATH))
    assert newer is not at_new and at(newer, moved).polygon[0] == pytest.approx((3.0, 0.4))
    there = at(newer, moved)
    assert placed(there, numbered(PATH, numbering="old")).polygon == SQUARE.polygon
    assert placed(there, numbered(PATH, numbering="another")) is there


def test_poses_that_a_map_lacks_are_left_out() -> None:
    moved = tuple(pose(p.x_m, 0.4) for p in PATH)
    zone = drawn(SQUARE)
    first = min(n for n, _ in anchor_of(zone).poses)
    assert at(zone, moved[: first + 1]).polygon[0] == pytest.approx((3.0, 0.4))
    assert at(zone, moved[:first]) is zone


@pytest.mark.parametrize(
    "shape",
    [
        Circle(centre=(4.0, 1.0), radius_m=1.5),
        Corridor(line=((3.0, 1.0), (5.0, 1.0), (5.0, 2.0)), width_m=0.4),
    ],
)
def test_shapes_stay_the_shapes_they_were_drawn_as(shape: Circle | Corridor) -> None:
    turned = tuple(pose(1.0, 2.0, 0.7) @ each for each in PATH)
    new = at(drawn(dataclasses.replace(SQUARE, drawn=shape, polygon=shape.outline())), turned)
    assert new.drawn is not None
    assert new.drawn != shape
    assert still_drawn(new.drawn, new.polygon) == new.drawn


def test_a_goal_without_a_heading_keeps_none() -> None:
    goal = drawn(dataclasses.replace(GOAL, yaw_rad=None))
    moved = at(goal, tuple(pose(p.x_m, 0.2, 0.3) for p in PATH))
    assert moved.yaw_rad is None
    assert (moved.x_m, moved.y_m) != (GOAL.x_m, GOAL.y_m)


def test_a_correction_of_less_than_a_centimetre_adds_to_the_next() -> None:
    zone = drawn(SQUARE)
    assert at(zone, tuple(pose(p.x_m, 0.006) for p in PATH)) is zone
    there = at(zone, tuple(pose(p.x_m, 0.012) for p in PATH))
    assert there.polygon[0] == pytest.approx((3.0, 0.012))
