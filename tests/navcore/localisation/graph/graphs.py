"""Pose graphs with known true poses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from navcore.geometry.arrays import Floats
from navcore.geometry.transform import Pose2
from navcore.localisation.graph.edges import ConstantErrors, Edge
from navcore.localisation.graph.pose_graph import PoseGraph

ODOMETRY = np.diag(np.square([0.01, 0.005, 0.004]))
LOOP = np.diag(np.square([0.03, 0.03, 0.006]))


class KnownGraph(NamedTuple):
    """A graph with its truth."""

    graph: PoseGraph
    true: dict[int, Pose2]
    right: list[bool]
    """Which of the loops are right."""


def pose(x_m: float, y_m: float, yaw_rad: float) -> Pose2:
    return Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


def rounds(*, sides: int = 4, steps: int = 12, laps: int = 2) -> list[Pose2]:
    """Poses of several laps around a polygon, 0.5 m apart."""
    poses = [pose(0.0, 0.0, 0.0)]
    for step in range(1, sides * steps * laps):
        turn = 2.0 * math.pi / sides if step % steps == 0 else 0.0
        poses.append(poses[-1] @ pose(0.5, 0.0, turn))
    return poses


def edge_between(poses: Sequence[Pose2], i: int, j: int, covariance: Floats, error: Floats) -> Edge:
    """The measured pose j in the frame of pose i."""
    return Edge(
        from_id=i,
        to_id=j,
        T_from_to=poses[i].inverse() @ poses[j] @ pose(*map(float, error)),
        covariance=covariance,
    )


def known_graph(
    seed: int, *, noise: float = 1.0, wrong_share: float = 0.0, sides: int = 4
) -> KnownGraph:
    """Two laps around a polygon: odometry edges, and a loop wherever the second lap passes the
    first; the first guess is odometry."""
    rng = np.random.default_rng(seed)
    true = rounds(sides=sides)
    half = len(true) // 2
    odometry = [
        edge_between(
            true, i, i + 1, ODOMETRY, noise * rng.normal(size=3) * np.sqrt(np.diag(ODOMETRY))
        )
        for i in range(len(true) - 1)
    ]
    loops, right = [], []
    for i in range(0, half, 2):
        is_right = bool(rng.random() >= wrong_share)
        error = (
            noise * rng.normal(size=3) * np.sqrt(np.diag(LOOP))
            if is_right
            else rng.choice([-1.0, 1.0], size=3) * rng.uniform([0.5, 0.5, 0.1], [3.0, 3.0, 1.0])
        )
        loops.append(edge_between(true, i, i + half, LOOP, error))
        right.append(is_right)
    guess = [true[0]]
    for edge in odometry:
        guess.append(guess[-1] @ edge.T_from_to)
    return KnownGraph(
        PoseGraph(poses=dict(enumerate(guess)), odometry=odometry, loops=loops),
        dict(enumerate(true)),
        right,
    )


def drifting_graph(seed: int) -> KnownGraph:
    """The graph of `known_graph` without wrong loops, whose odometry has constant errors as well,
    drawn from what the graph knows of them."""
    rng = np.random.default_rng((seed, 1))
    known = ConstantErrors(mean=np.zeros(3), covariance=np.diag(np.square([1e-3, 0.02, 0.02])))
    drawn = rng.multivariate_normal(known.mean, known.covariance)
    graph, true, right = known_graph(seed)
    edges, guess = [], [true[0]]
    for edge in graph.odometry:
        turn = edge.T_from_to.yaw_rad
        by_errors = np.array([[0.0, -0.5, 0.0], [0.0, 0.0, 0.0], [-1.0, 0.0, -turn]])
        measured = edge.T_from_to @ pose(*map(float, -by_errors @ drawn))
        edges.append(replace(edge, T_from_to=measured, by_constant_errors=by_errors))
        guess.append(guess[-1] @ measured)
    return KnownGraph(
        replace(graph, poses=dict(enumerate(guess)), odometry=edges, constant_errors=known),
        true,
        right,
    )


def largest_error(poses: Mapping[int, Pose2], true: Mapping[int, Pose2]) -> float:
    """The largest distance or turn between two sets of poses, metres or radians."""
    gaps = [true[i].inverse() @ poses[i] for i in true]
    return float(max(max(math.hypot(g.x_m, g.y_m), abs(g.yaw_rad)) for g in gaps))
