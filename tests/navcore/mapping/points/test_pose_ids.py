"""Pose IDs: a known pose is found again, so their number is bounded by the world."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.mapping.points.pose_ids import PoseIds, check_movable
from tests.navcore.laws import law
from tests.navcore.mapping.points.moved_poses import move


def pose(x: float, y: float = 0.0, yaw_deg: float = 0.0) -> Pose2:
    return Pose2(x_m=x, y_m=y, yaw_rad=math.radians(yaw_deg))


def somewhere(rng: np.random.Generator) -> Pose2:
    return pose(rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6), rng.uniform(-360, 360))


def ids() -> PoseIds:
    return PoseIds(0.25, 10.0)


def slow_known(poses: tuple[Pose2, ...], wanted: Pose2) -> int | None:
    """Return the known ID by a search over all poses."""
    costs = {
        number: (other.distance_to(wanted.x_m, wanted.y_m) / 0.25) ** 2
        + (abs(wrap_angle(wanted.yaw_rad - other.yaw_rad)) / math.radians(10)) ** 2
        for number, other in enumerate(poses)
        if other.distance_to(wanted.x_m, wanted.y_m) < 0.25
        and abs(wrap_angle(wanted.yaw_rad - other.yaw_rad)) < math.radians(10)
    }
    return min(costs, key=lambda number: (costs[number], -number)) if costs else None


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_the_lookup_finds_what_a_search_over_all_poses_finds_also_after_moves(seed: int) -> None:
    rng, known = np.random.default_rng(seed), ids()
    for _ in range(60):
        wanted = somewhere(rng)
        expected = slow_known(known.poses, wanted)
        assert known.known(wanted) == expected
        before = len(known)
        assert known.id_of(wanted) == (before if expected is None else expected)
        if rng.random() < 0.2:
            moved = somewhere(rng)
            move(known, {int(rng.integers(len(known))): moved})


def test_of_two_equally_near_poses_the_newer_one_is_found() -> None:
    known = ids()
    assert [known.id_of(pose(0.0)), known.id_of(pose(0.25)), known.id_of(pose(0.125))] == [0, 1, 1]
    move(known, {0: pose(0.25), 1: pose(0.0)})
    assert known.known(pose(0.125)) == 1


def test_turning_to_and_fro_and_driving_rounds_adds_no_ids() -> None:
    known = ids()
    headings = [30.0 * math.sin(0.1 * step) for step in range(400)]
    for heading in headings[:100]:
        known.id_of(pose(0.0, 0.0, heading))
    swept = len(known)
    for heading in headings[100:]:
        known.id_of(pose(0.0, 0.0, heading))
    assert len(known) == swept <= 8

    def lap() -> None:
        for degrees in range(0, 360, 2):
            angle = math.radians(degrees)
            known.id_of(pose(3 * math.cos(angle), 3 * math.sin(angle), degrees + 90.0))

    lap()
    rounds = len(known)
    for _ in range(3):
        lap()
    assert len(known) == rounds > swept


def test_ids_are_bounded_by_the_space_however_long_the_robot_wanders() -> None:
    rng, known = np.random.default_rng(3), ids()
    counts = []
    for _ in range(4):
        for x, y, yaw in rng.uniform([0, 0, -180], [1, 1, 180], (20_000, 3)):
            known.id_of(pose(x, y, yaw))
        counts.append(len(known))
    # Each pose keeps a box of 0.25 m and 10° to itself, so a square metre fills up.
    assert counts[-1] < 1.05 * counts[1]
    assert counts[-1] < 36 * 2 * 36


def test_a_heading_across_the_turn_of_the_circle_is_known() -> None:
    known = ids()
    assert known.id_of(pose(0.0, 0.0, 179.0)) == known.id_of(pose(0.0, 0.0, -179.0)) == 0
    assert known.id_of(pose(-1e-12, 0.0, 355.0)) == known.id_of(pose(1e-12, 0.0, 3.0)) == 1


def test_an_unknown_or_frozen_pose_is_not_movable() -> None:
    check_movable((0, 2), known=3, frozen=0)
    with pytest.raises(BadConfiguration, match="pose ID 3 is not on the map, which has 3"):
        check_movable((0, 3), known=3, frozen=0)
    with pytest.raises(BadConfiguration, match="pose ID -1 is not on the map"):
        check_movable((-1,), known=3, frozen=0)
    with pytest.raises(BadConfiguration, match="pose ID 2 belongs to the loaded map, whose first"):
        check_movable((3, 2), known=4, frozen=3)


def test_restored_ids_are_the_same_poses_and_frozen() -> None:
    first, second, names = ids(), ids(), map(str, itertools.count(1)).__next__
    assert first.numbering == second.numbering == "", "equal drives give equal maps"
    first.name_numberings(names)
    second.name_numberings(names)
    for x in (0.0, 1.0, 2.0):
        first.id_of(pose(x, 0.3, 20 * x))
    second.id_of(pose(7.0))
    second.restore(first.array(), first.numbering)
    assert second.poses == first.poses
    assert second.frozen == 3
    assert second.loaded_numbering == first.numbering
    assert second.numbering not in ("", first.numbering), "its next ID is another place"
    assert second.known(pose(7.0)) is None
    assert second.known(pose(1.1, 0.3, 20.0)) == 1
