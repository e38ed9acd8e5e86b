"""Falco's paths are those of the formula, and a point blocks just those that bring the oriented
footprint onto it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from navcore.control.primitives.arcs import ALONG_M
from navcore.control.primitives.falco import (
    GROUPS,
    HEADINGS_RAD,
    IN_GROUP,
    PATHS,
    RADII_M,
    SCALES,
    SPREAD_RAD,
    VOXEL_M,
    Table,
    blocked_paths,
    ends_rad,
    fan,
    pursuits,
    scores,
)
from navcore.control.primitives.library import Primitives, first_try, likeliest
from tests.navcore.laws import law

Floats = npt.NDArray[np.float64]
HUSKY_M, ROOM_M = (0.5, 0.35), 0.06
ALL = np.ones(36, dtype=np.bool_)
AHEAD: Floats = np.column_stack([np.linspace(0, 6, 61), np.zeros(61)])
NONE: Floats = np.empty((0, 2))


def test_there_are_343_paths_of_301_points_in_7_groups_that_share_their_first_metre() -> None:
    paths = fan()
    assert paths.shape == (343, 301, 3) and (PATHS, GROUPS, IN_GROUP) == (343, 7, 49)
    np.testing.assert_allclose(
        np.hypot(*paths[..., :2].transpose(2, 0, 1)), np.tile(RADII_M, (PATHS, 1)), atol=1e-12
    )
    groups = paths.reshape(GROUPS, IN_GROUP, 301, 3)
    np.testing.assert_allclose(
        groups[:, :, :101], groups[:, :1, :101].repeat(IN_GROUP, axis=1), atol=1e-12
    )
    at_1_m = np.degrees(np.arctan2(groups[:, 0, 100, 1], groups[:, 0, 100, 0]))
    np.testing.assert_allclose(at_1_m, [-27, -18, -9, 0, 9, 18, 27], atol=1e-9)


def test_the_paths_end_in_a_fan_mirrored_left_and_right_without_a_kink_and_headed_as_they_lead() -> (
    None
):
    paths = fan()
    steps = np.array([-1, -2 / 3, -1 / 3, 0, 1 / 3, 2 / 3, 1])
    expected = [a + 0.65 * b + 0.65**2 * c for a in steps for b in steps for c in steps]
    np.testing.assert_allclose(ends_rad(), SPREAD_RAD * np.array(expected), atol=1e-12)
    np.testing.assert_allclose(paths[::-1] * [1, -1, -1], paths, atol=1e-12)
    ahead = np.diff(paths[..., :2], axis=1)
    middle = (paths[:, 1:, 2] + paths[:, :-1, 2]) / 2
    off = np.angle((ahead[..., 0] + 1j * ahead[..., 1]) * np.exp(-1j * middle))
    assert np.abs(off).max() < 0.003
    assert (
        np.abs(np.diff(paths[..., 2], axis=1)).max() < 0.08
    )  # of a path that turns by 44° in a metre


def test_from_the_first_metre_on_it_is_the_not_a_knot_spline() -> None:
    knots = np.concatenate([RADII_M[:101], [2.0, 3.0]])
    angle = np.arctan2(fan()[:, 1:, 1], fan()[:, 1:, 0])
    angle = np.concatenate([np.zeros((PATHS, 1)), angle], axis=1)
    spline = CubicSpline(
        knots,
        np.concatenate([angle[:, :101], angle[:, [200, 300]]], axis=1),
        axis=1,
        bc_type="not-a-knot",
    )
    np.testing.assert_allclose(spline(RADII_M), angle, atol=0.002)


def bits(words: npt.NDArray[np.uint64]) -> npt.NDArray[np.bool_]:
    """(343,) of a row of the table."""
    return np.unpackbits(words.view(np.uint8), bitorder="little")[:PATHS].astype(np.bool_)


def nearest_m(point: Floats, paths: Floats, half_length_m: float, half_width_m: float) -> Floats:
    """(P,) how near the point comes to the oriented footprint anywhere along (P, S, 3) paths."""
    dx, dy = (point[axis] - paths[..., axis] for axis in (0, 1))
    cos, sin = np.cos(paths[..., 2]), np.sin(paths[..., 2])
    out_x, out_y = (
        np.abs(cos * dx + sin * dy) - half_length_m,
        np.abs(cos * dy - sin * dx) - half_width_m,
    )
    return np.asarray(np.hypot(np.maximum(out_x, 0), np.maximum(out_y, 0)).min(axis=1))


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_a_point_blocks_just_the_paths_whose_oriented_footprint_comes_too_near(seed: int) -> None:
    """But for half a cell's diagonal, and as much again where a corner swings out between two
    poses."""
    rng = np.random.default_rng(seed)
    body_m, scale = ((0.5, 0.35), (0.254, 0.215))[seed % 2], float(rng.choice(SCALES))
    table = Table.of(*body_m, ROOM_M, scale)
    radius, bearing, heading = (
        rng.uniform(0.7, 4.2),
        rng.uniform(-1.2, 1.2),
        float(rng.choice(HEADINGS_RAD)),
    )
    point = radius * np.array([math.cos(bearing), math.sin(bearing)])
    turned = radius * np.array([[math.cos(bearing + heading), math.sin(bearing + heading)]])
    blocked = bits(blocked_paths(turned, heading, table.blocks, table.low_m))
    room = nearest_m(point, fan() * np.array([scale, scale, 1.0]), *body_m)
    coarse = VOXEL_M / math.sqrt(2)
    assert blocked[room < ROOM_M - 2 * coarse].all()
    assert not blocked[room > ROOM_M + coarse].any()


def test_a_disc_of_the_bodys_outer_radius_would_block_paths_that_the_body_goes_along() -> None:
    """What the table is made for the footprint for."""
    table, point = Table.of(*HUSKY_M, ROOM_M, 1.0), np.array([[1.0, 0.5]])
    straight = PATHS // 2
    assert not bits(blocked_paths(point, 0.0, table.blocks, table.low_m))[straight]
    assert math.hypot(*HUSKY_M) > 0.5


def test_what_lies_outside_the_table_blocks_nothing() -> None:
    table = Table.of(*HUSKY_M, ROOM_M, 0.75)
    for point in ([9.0, 0.0], [-9.0, 0.0], [0.0, 9.0], [0.0, -9.0]):
        assert not blocked_paths(np.array([point]), 0.3, table.blocks, table.low_m).any()


def test_the_score_falls_with_the_way_a_path_ends_off_and_with_the_turn_that_it_takes() -> None:
    rng = np.random.default_rng(1)
    table, points = Table.of(*HUSKY_M, ROOM_M, 1.0), rng.uniform(-3, 3, (12, 2))
    allowed = rng.random(36) < 0.8
    found = scores(points, HEADINGS_RAD, allowed, table.blocks, table.low_m, ends_rad(), 0.4)
    for h, heading in enumerate(np.degrees(HEADINGS_RAD)):
        blocked = bits(blocked_paths(points, HEADINGS_RAD[h], table.blocks, table.low_m))
        off = np.abs((heading + np.degrees(ends_rad()) - math.degrees(0.4) + 180) % 360 - 180)
        weight = max(10 - abs(heading) / 10, 1)
        expected = np.maximum(1 - (0.02 * off) ** 0.25, 0) * weight**4 * ~blocked * allowed[h]
        np.testing.assert_allclose(found[h], expected, rtol=1e-6, atol=1e-6)
    assert found.any() and not found[:, found.any(axis=0)].all()


def among(
    points: Floats, *, path: Floats = AHEAD, speed: float = 0.0, turns: npt.NDArray[np.bool_] = ALL
) -> Primitives:
    return likeliest(points, turns, path, body_m=HUSKY_M, room_m=ROOM_M, speed=speed)


def count(points: Floats, *, path: Floats = AHEAD, speed: float = 0.0) -> int:
    return len(among(points, path=path, speed=speed).poses)


def wall(x: float, low: float, high: float) -> Floats:
    return np.column_stack([np.full(60, x), np.linspace(low, high, 60)])


def ring(radius: float) -> Floats:
    angles = np.linspace(0, 2 * math.pi, 400)
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def test_the_paths_grow_with_speed_and_shrink_where_nothing_is_free() -> None:
    assert [first_try(speed) for speed in (-0.2, 0.0, 0.6, 0.8, 0.9, 1.0)] == [2, 2, 2, 1, 1, 0]
    assert [count(ring(radius), speed=1.0) for radius in (4.5, 3.2, 1.7, 0.9)] == [
        IN_GROUP,
        IN_GROUP,
        IN_GROUP,
        0,
    ]


def test_what_stands_far_ahead_counts_for_a_fast_robot_alone() -> None:
    far = np.array([[3.5, 0.0]])

    def goes_straight(speed: float) -> bool:
        return bool((np.abs(among(far, speed=speed).poses[..., 1]).max(axis=1) < 1e-9).any())

    assert goes_straight(0.0) and not goes_straight(1.0)


def test_the_way_round_is_found_on_the_open_side_and_only_at_headings_that_can_be_turned_to() -> (
    None
):
    for side in (1.0, -1.0):
        ends = among(wall(1.6, -3, 0.5) * [1, side]).poses[:, -1, 1] * side
        assert len(ends) and (ends > 0).all()
    assert count(NONE, path=-AHEAD) == IN_GROUP
    assert not len(among(NONE, path=-AHEAD, turns=np.arange(36) == 18).poses)


def test_what_stands_beyond_the_goal_is_in_nobodys_way() -> None:
    assert count(ring(1.0)) == 0
    assert count(ring(1.0), path=AHEAD[:4]) == IN_GROUP


def test_a_pursuit_begins_at_the_robot_moves_as_it_is_headed_and_comes_onto_the_path() -> None:
    paths = fan()[:, :, :2]
    bends, poses = pursuits(paths, 0.01, ALONG_M, 0.5)
    with_start = np.concatenate([np.zeros((PATHS, 1, 3)), poses], axis=1)
    ahead, ways = np.diff(with_start[..., :2], axis=1), np.diff(ALONG_M, prepend=0.0)
    np.testing.assert_allclose(
        np.hypot(*ahead.transpose(2, 0, 1)), np.tile(ways, (PATHS, 1)), rtol=1e-3
    )
    middle = (with_start[:, 1:, 2] + with_start[:, :-1, 2]) / 2
    np.testing.assert_allclose(np.arctan2(ahead[..., 1], ahead[..., 0]), middle, atol=1e-9)
    np.testing.assert_allclose(bends, with_start[:, 1, 2] / ALONG_M[0], rtol=1e-9)
    assert np.sign(bends.reshape(GROUPS, IN_GROUP).round(9)).tolist() == [
        [s] * IN_GROUP for s in (-1, -1, -1, 0, 1, 1, 1)
    ]
    lines: npt.NDArray[np.object_] = np.asarray(shapely.linestrings(paths[::6]))
    assert shapely.distance(lines[:, None], shapely.points(poses[::6, ::6, :2])).max() < 0.1


def test_a_path_that_leads_off_aside_is_turned_to_as_sharply_as_is_driven() -> None:
    aside = fan()[PATHS // 2 : PATHS // 2 + 1, :, :2][..., ::-1].copy()
    bends, poses = pursuits(aside, 0.01, ALONG_M, 0.5)
    assert bends.tolist() == [3.0]
    assert poses[0, -1, 2] == pytest.approx(math.pi / 2, abs=0.2)
