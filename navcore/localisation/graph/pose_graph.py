"""Pose graph in the plane: the poses that agree best with all edges, and which loops do not.

Levenberg–Marquardt on sparse normal equations. Edges are independent but for the constant errors of
odometry, which are unknowns beside the poses (Kümmerle, Grisetti, Burgard 2012): errors of scale
and bias of many edges add up themselves, not their variances. Odometry is trusted; loops and
absolute positions are weighted by graduated non-convexity with a truncated least squares cost
(Yang, Antonante, Tzoumas, Carlone 2020): the cost starts convex and tightens until each is believed
or rejected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from navcore.config.localisation.pose_graph import DEFAULT_POSE_GRAPH, PoseGraphConfig
from navcore.errors import BadGeometry
from navcore.geometry.arrays import Bools, Floats
from navcore.geometry.transform import IDENTITY, Matrix, Pose2, wrap_angle
from navcore.localisation.graph.edges import ConstantErrors, Edge, in_own_axes
from navcore.localisation.graph.normal_equations import Factors, NormalEquations, factors_of

SMALLEST_DAMPING = 1e-9
"""Damping, as a share of the diagonal, that keeps poses without any constraint where they are."""
LARGEST_DAMPING = 1e8
"""Damping beyond which no smaller cost is expected."""
_NO_DAMPING = 1e-15
"""Damping below the rounding of the diagonal. Covariances take no more: where positions in the map
are weak, even the smallest of the others would be worth more than they are."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AbsolutePose:
    """A measured pose in the map, by GNSS, a tag or a dock."""

    pose_id: int
    """Pose ID that was measured."""
    T_map_base: Pose2
    """Measured pose of the robot; the heading is arbitrary where it was not measured."""
    information: Matrix
    """(3, 3) inverse of the covariance of x and y in metres along the map's axes and yaw in
    radians; singular for what was not measured."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseGraph:
    """Poses and what is known about them."""

    poses: Mapping[int, Pose2]
    """First guess of T_map_base by pose ID."""
    odometry: Sequence[Edge]
    """Trusted edges between the poses of consecutive keyframes."""
    loops: Sequence[Edge] = ()
    """Edges that may be wrong."""
    constant_errors: ConstantErrors | None = None
    """What is known of the constant errors of the odometry; None if it has none."""
    absolute: Sequence[AbsolutePose] = ()
    """Positions in the map that may be wrong."""
    first_covariance: Matrix | None = None
    """(3, 3) covariance of the first pose in the map, along its axes; None if nothing is known of
    it. Without absolute positions that pose stays."""
    first: Pose2 | None = None
    """T_map_base from which the first pose deviates by that covariance, whatever the first guess
    is; None for the first guess."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OptimisedGraph:
    """Result of the optimisation."""

    poses: Mapping[int, Pose2]
    """T_map_base by pose ID."""
    accepted_loops: tuple[bool, ...]
    """For each loop whether it was believed."""
    held: Matrix | None
    """(3, 3) covariance of the first pose where that stayed, which the equations leave out; None
    where it took part."""
    _equations: NormalEquations = field(repr=False)
    _state: Floats = field(repr=False)
    _weights: Floats = field(repr=False)

    def covariances(self, pose_ids: Sequence[int]) -> dict[int, Matrix]:
        """Return the (3, 3) marginal covariance of x, y and yaw of poses in the map, along its
        axes. Solves one linear system for each pose."""
        index = {pose_id: i for i, pose_id in enumerate(self.poses)}
        blocks = self._equations.covariances(
            self._state, self._weights, [index[pose_id] for pose_id in pose_ids], _NO_DAMPING
        )
        return {
            pose_id: block + self._by_first(self.poses[pose_id])
            for pose_id, block in zip(pose_ids, blocks, strict=True)
        }

    def _by_first(self, pose: Pose2) -> Matrix:
        """Return the (3, 3) covariance of a pose that the first, where it stayed, gives to all."""
        if self.held is None:
            return np.zeros((3, 3))
        first, swing = next(iter(self.poses.values())), np.eye(3)
        swing[:2, 2] = first.y_m - pose.y_m, pose.x_m - first.x_m
        return np.asarray(swing @ self.held @ swing.T)

    def relative_covariance(self, from_id: int, to_id: int) -> Matrix:
        """Return the (3, 3) covariance of the second pose in the frame of the first, as an `Edge`
        has it."""
        index = {pose_id: i for i, pose_id in enumerate(self.poses)}
        return self._equations.relative_covariance(
            self._state, self._weights, index[from_id], index[to_id], _NO_DAMPING
        )


def optimise(graph: PoseGraph, config: PoseGraphConfig = DEFAULT_POSE_GRAPH) -> OptimisedGraph:
    """Return the poses that fit best, and which loops were believed.

    Deterministic. Raises `BadGeometry` if a factor names an unknown pose or has a covariance that
    is not positive definite.
    """
    ids = list(graph.poses)
    index = {pose_id: i for i, pose_id in enumerate(ids)}
    factors = _factors(graph, index)
    state = np.array([*((p.x_m, p.y_m, p.yaw_rad) for p in graph.poses.values()), (0.0, 0.0, 0.0)])
    free = np.ones(len(ids) + 1, dtype=bool)
    free[0], free[-1] = bool(graph.absolute), graph.constant_errors is not None
    equations = NormalEquations(factors, len(ids), free)
    first_absolute = len(graph.odometry) + len(graph.loops)
    after_absolute = first_absolute + len(graph.absolute)
    trusted = np.ones(len(factors.first), dtype=bool)
    trusted[len(graph.odometry) : after_absolute] = False
    state, weights = _Solver(equations, config).graduated(state, trusted)
    believed = weights > 0.5
    return OptimisedGraph(
        poses=_poses(ids, state),
        accepted_loops=tuple(map(bool, believed[len(graph.odometry) : first_absolute])),
        held=None if graph.absolute else graph.first_covariance,
        _equations=equations,
        _state=state,
        _weights=weights,
    )


def _factors(graph: PoseGraph, index: Mapping[int, int]) -> Factors:
    edges = [*graph.odometry, *graph.loops]
    named = [i for e in edges for i in (e.from_id, e.to_id)] + [a.pose_id for a in graph.absolute]
    for pose_id in named:
        if pose_id not in index:
            raise BadGeometry(f"pose graph: unknown pose ID {pose_id}; it is none of the poses")
    ends = [(index[e.from_id], index[e.to_id]) for e in edges]
    ends += [(-1, index[a.pose_id]) for a in graph.absolute]
    known = graph.constant_errors
    measured = [_without(e, known) for e in edges] + [a.T_map_base for a in graph.absolute]
    by_errors = [e.by_constant_errors for e in edges] + [np.zeros((3, 3))] * len(graph.absolute)
    try:
        information: list[Matrix] = [np.asarray(np.linalg.inv(e.covariance)) for e in edges]
        information += [in_own_axes(a.T_map_base, a.information) for a in graph.absolute]
        if graph.absolute and graph.first_covariance is not None:
            first = graph.first or next(iter(graph.poses.values()))
            ends.append((-1, 0))
            measured.append(first)
            information.append(
                in_own_axes(first, np.asarray(np.linalg.inv(graph.first_covariance)))
            )
            by_errors.append(np.zeros((3, 3)))
        if known is not None:  # the last factor says how far they may be from what is known
            ends.append((-1, -1))
            measured.append(IDENTITY)
            information.append(np.asarray(np.linalg.inv(known.covariance)))
            by_errors.append(np.eye(3))
        return factors_of(
            ends=ends, measured=measured, information=information, by_errors=by_errors
        )
    except np.linalg.LinAlgError:
        raise BadGeometry(
            "pose graph: a covariance is not positive definite; give each edge (3, 3) with "
            "positive variances"
        ) from None


def _without(edge: Edge, known: ConstantErrors | None) -> Pose2:
    """Return the motion of an edge without the constant errors that are known."""
    if known is None:
        return edge.T_from_to
    x_m, y_m, yaw_rad = (edge.by_constant_errors @ known.mean).tolist()
    return edge.T_from_to @ Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


def _poses(ids: Sequence[int], state: Floats) -> dict[int, Pose2]:
    return {
        pose_id: Pose2(x_m=float(x), y_m=float(y), yaw_rad=wrap_angle(float(yaw)))
        for pose_id, (x, y, yaw) in zip(ids, state[:-1], strict=True)
    }


class _Solver:
    """Levenberg–Marquardt, alone and within graduated non-convexity."""

    def __init__(self, equations: NormalEquations, config: PoseGraphConfig) -> None:
        self._equations = equations
        self._config = config
        self._damping = SMALLEST_DAMPING

    def graduated(self, state: Floats, trusted: Bools) -> tuple[Floats, Floats]:
        """Return poses and weights, 0 or 1 for each factor."""
        limit = self._config.inlier_chi2
        weights = np.ones(len(trusted))
        doubtful = ~trusted
        state = self._minimise(state, weights)
        worst = float(self._equations.chi2(state)[doubtful].max(initial=0.0))
        mu = limit / max(2.0 * worst - limit, 1e-9)
        for _ in range(self._config.gnc_steps if worst > limit else 0):
            chi2 = self._equations.chi2(state)
            weights[doubtful] = _truncated_weights(chi2[doubtful], limit, mu)
            if np.isin(weights, (0.0, 1.0)).all():
                break
            state, _ = self._step(state, weights)
            mu *= self._config.gnc_factor
        for _ in range(10):  # what the last poses say is an outlier or not, until nothing changes
            decided = np.where(doubtful, self._equations.chi2(state) <= limit, 1.0)
            if (decided == weights).all():
                break
            weights = decided.astype(np.float64)
            state = self._minimise(state, weights)
        return self._minimise(state, weights), weights

    def _minimise(self, state: Floats, weights: Floats) -> Floats:
        for _ in range(self._config.max_steps):
            state, change = self._step(state, weights)
            if change < self._config.converged_m:
                break
        return state

    def _step(self, state: Floats, weights: Floats) -> tuple[Floats, float]:
        """Return the poses after one step and the largest change; no step makes the cost
        larger."""
        equations = self._equations
        chi2 = equations.chi2(state)
        cost = float(weights @ chi2)
        while self._damping < LARGEST_DAMPING:
            change = equations.step(state, weights, self._damping)
            new = state + change
            if float(weights @ equations.chi2(new)) <= cost * (1.0 + 1e-12) + 1e-15:
                self._damping = max(self._damping / 10.0, SMALLEST_DAMPING)
                return new, float(np.abs(change).max(initial=0.0))
            self._damping *= 100.0
        self._damping = SMALLEST_DAMPING
        return state, 0.0


def _truncated_weights(chi2: Floats, limit: float, mu: float) -> Floats:
    """Return the weights of the truncated least squares cost at the convexity `mu`."""
    low, high = mu / (mu + 1.0) * limit, (mu + 1.0) / mu * limit
    between = np.sqrt(limit * mu * (mu + 1.0) / np.maximum(chi2, 1e-12)) - mu
    return np.where(chi2 <= low, 1.0, np.where(chi2 >= high, 0.0, between))
