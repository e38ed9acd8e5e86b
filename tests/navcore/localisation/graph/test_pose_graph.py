"""The pose graph finds the true poses, and rejects wrong loops and positions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.localisation.pose_graph import PoseGraphConfig
from navcore.errors import BadGeometry
from navcore.geometry.transform import difference
from navcore.localisation.graph.edges import ConstantErrors
from navcore.localisation.graph.pose_graph import AbsolutePose, PoseGraph, optimise
from tests.navcore.laws import law
from tests.navcore.localisation.graph.graphs import (
    LOOP,
    ODOMETRY,
    drifting_graph,
    edge_between,
    known_graph,
    largest_error,
    pose,
    rounds,
)

SEEDS = st.integers(0, 2**31)


@law(20)
@given(seed=SEEDS, sides=st.integers(3, 8))
def test_without_noise_the_true_poses_are_found_from_a_wrong_first_guess(
    seed: int, sides: int
) -> None:
    known = known_graph(seed, noise=0.0, sides=sides)
    rng = np.random.default_rng(seed)
    guess = {
        i: p @ pose(*map(float, rng.normal(size=3) * [0.3, 0.3, 0.1])) if i else p
        for i, p in known.true.items()
    }
    found = optimise(dataclasses.replace(known.graph, poses=guess))
    assert largest_error(found.poses, known.true) < 1e-6
    assert all(found.accepted_loops)


@law(20)
@given(seed=SEEDS)
def test_a_third_of_wrong_loops_is_rejected_and_at_most_one_of_the_right_ones(seed: int) -> None:
    known = known_graph(seed, wrong_share=0.3)
    found = optimise(known.graph)
    pairs = list(zip(found.accepted_loops, known.right, strict=True))
    assert not any(accepted and not right for accepted, right in pairs)
    # One in 2,500 right loops has an error that none should have.
    assert sum(right and not accepted for accepted, right in pairs) <= 1
    assert largest_error(found.poses, known.true) < 0.5


def test_wrong_loops_that_are_trusted_spoil_the_poses() -> None:
    known = known_graph(3, wrong_share=0.3)
    trusted = PoseGraph(
        poses=known.graph.poses, odometry=[*known.graph.odometry, *known.graph.loops]
    )
    assert largest_error(optimise(trusted).poses, known.true) > 0.5


def test_the_same_graph_gives_the_same_poses() -> None:
    one, two = (optimise(known_graph(7, wrong_share=0.3).graph) for _ in range(2))
    assert one.poses == two.poses
    assert one.accepted_loops == two.accepted_loops


def test_a_drifted_graph_is_pulled_to_absolute_positions_but_not_to_a_wrong_one() -> None:
    known = known_graph(11)
    graph = dataclasses.replace(known.graph, loops=())
    information = np.diag([1.0 / 0.02**2, 1.0 / 0.02**2, 0.0])
    absolute = [
        AbsolutePose(pose_id=i, T_map_base=known.true[i], information=information)
        for i in range(0, 96, 8)
    ]
    wrong = AbsolutePose(pose_id=50, T_map_base=pose(30.0, -4.0, 2.0), information=information)
    assert largest_error(optimise(graph).poses, known.true) > 0.15
    found = optimise(dataclasses.replace(graph, absolute=[*absolute, wrong]))
    assert largest_error(found.poses, known.true) < 0.1


def test_absolute_positions_alone_place_a_graph_in_the_map() -> None:
    known = known_graph(5, noise=0.0)
    elsewhere = pose(4.0, -3.0, 1.0)
    absolute = [
        AbsolutePose(pose_id=i, T_map_base=elsewhere @ known.true[i], information=1e4 * np.eye(3))
        for i in (0, 20, 40, 60)
    ]
    found = optimise(dataclasses.replace(known.graph, absolute=absolute))
    assert largest_error(found.poses, {i: elsewhere @ p for i, p in known.true.items()}) < 1e-5


def test_the_covariance_along_a_chain_is_that_of_the_composed_edges() -> None:
    true = rounds(laps=1)[:3]
    edges = [edge_between(true, i, i + 1, ODOMETRY, np.zeros(3)) for i in range(2)]
    found = optimise(PoseGraph(poses=dict(enumerate(true)), odometry=edges))
    covariances = found.covariances([0, 1, 2])
    assert not covariances[0].any()
    np.testing.assert_allclose(covariances[1], ODOMETRY, rtol=1e-6, atol=1e-12)
    # The yaw error of the first step swings the second step of 0.5 m sideways.
    swing = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(
        covariances[2], swing @ ODOMETRY @ swing.T + ODOMETRY, rtol=1e-6, atol=1e-12
    )


@pytest.mark.parametrize("is_measured", [False, True])
def test_what_is_unknown_of_the_first_pose_is_unknown_of_all(is_measured: bool) -> None:
    """Whether it stays, or a position that tells next to nothing lets it move."""
    true = [pose(0.5 * i, 0.0, 0.0) for i in range(201)]
    edges = [edge_between(true, i, i + 1, ODOMETRY, np.zeros(3)) for i in range(200)]
    graph = PoseGraph(poses=dict(enumerate(true)), odometry=edges)
    start = np.diag([9.0, 4.0, 0.01])
    weak = AbsolutePose(pose_id=7, T_map_base=true[7], information=1e-9 * np.eye(3))
    placed = dataclasses.replace(
        graph, first_covariance=start, absolute=[weak] if is_measured else []
    )
    # An error of the first heading swings what is 100 m away.
    swing = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 100.0], [0.0, 0.0, 1.0]])
    expected = optimise(graph).covariances([200])[200] + swing @ start @ swing.T
    found = optimise(placed)
    np.testing.assert_allclose(found.covariances([200])[200], expected, rtol=1e-4, atol=1e-6)
    between = optimise(graph).relative_covariance(3, 9)
    np.testing.assert_allclose(found.relative_covariance(3, 9), between, rtol=1e-3, atol=1e-7)


def test_the_first_pose_is_held_to_where_it_was_measured_and_not_to_the_first_guess() -> None:
    true = [pose(0.5 * i, 0.0, 0.0) for i in range(5)]
    edges = [edge_between(true, i, i + 1, ODOMETRY, np.zeros(3)) for i in range(4)]
    aside = AbsolutePose(
        pose_id=0, T_map_base=pose(0.0, 0.3, 0.0), information=np.diag([0.0, 25.0, 0.0])
    )
    graph = PoseGraph(
        poses=dict(enumerate(true)),
        odometry=edges,
        absolute=[aside],
        first=true[0],
        first_covariance=np.diag([0.01, 0.04, 0.01]),
    )
    found = optimise(graph)
    again = optimise(dataclasses.replace(graph, poses=found.poses))
    # Of two measurements that are as sure the middle is the best, as often as it is computed.
    for one in (found, again):
        assert one.poses[0].y_m == pytest.approx(0.15, abs=1e-3)


def test_a_loop_makes_the_last_pose_more_certain() -> None:
    known = known_graph(2)
    alone = optimise(dataclasses.replace(known.graph, loops=()))
    with_loops = optimise(known.graph)
    assert np.trace(with_loops.covariances([95])[95]) < 0.5 * np.trace(alone.covariances([95])[95])


def test_constant_errors_of_a_straight_drive_add_up_themselves_and_noise_by_its_variance() -> None:
    known = ConstantErrors(mean=np.zeros(3), covariance=np.diag(np.square([1e-3, 0.02, 0.01])))
    true = [pose(0.5 * i, 0.0, 0.0) for i in range(101)]
    by_length = np.array([[0.0, -0.5, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    edges = [
        dataclasses.replace(
            edge_between(true, i, i + 1, np.diag([1e-4, 1e-4, 1e-12]), np.zeros(3)),
            by_constant_errors=by_length,
        )
        for i in range(100)
    ]
    graph = PoseGraph(poses=dict(enumerate(true)), odometry=edges, constant_errors=known)
    along = optimise(graph).covariances([100])[100][0, 0]
    bare = optimise(dataclasses.replace(graph, constant_errors=None)).covariances([100])[100][0, 0]
    assert along == pytest.approx(100 * 1e-4 + (0.02 * 50.0) ** 2, rel=2e-3)
    assert bare == pytest.approx(100 * 1e-4, rel=1e-4)


def test_with_loops_the_covariance_covers_constant_errors_that_it_would_not_as_noise() -> None:
    squares = []
    for seed in range(30):
        graph, true, _ = drifting_graph(seed)
        for one in (graph, dataclasses.replace(graph, constant_errors=None)):
            found = optimise(one)
            gap = difference(found.poses[60], true[60])
            squares.append(gap @ np.linalg.solve(found.covariances([60])[60], gap))
    assert 2.0 < np.mean(squares[::2]) < 4.2  # 3 degrees of freedom
    assert np.mean(squares[1::2]) > 10.0  # control


def test_an_unknown_pose_and_a_covariance_that_is_none_are_refused_by_name() -> None:
    known = known_graph(0)
    true = list(known.true.values())
    unknown = dataclasses.replace(edge_between(true, 0, 1, LOOP, np.zeros(3)), to_id=999)
    with pytest.raises(BadGeometry, match="unknown pose ID 999"):
        optimise(dataclasses.replace(known.graph, loops=[unknown]))
    singular = edge_between(true, 0, 1, np.zeros((3, 3)), np.zeros(3))
    with pytest.raises(BadGeometry, match="positive definite"):
        optimise(dataclasses.replace(known.graph, loops=[singular]))


def test_a_graph_of_one_pose_and_one_without_factors_stay_as_they_are() -> None:
    one = PoseGraph(poses={4: pose(1.0, 2.0, 0.5)}, odometry=())
    assert optimise(one).poses == one.poses
    two = PoseGraph(poses={4: pose(1.0, 2.0, 0.5), 5: pose(2.0, 2.0, 0.5)}, odometry=())
    assert optimise(two).poses == two.poses


def test_a_strict_limit_rejects_what_a_wide_one_believes() -> None:
    known = known_graph(1)
    strict = optimise(known.graph, PoseGraphConfig(inlier_chi2=1.0))
    assert sum(strict.accepted_loops) < sum(optimise(known.graph).accepted_loops)
