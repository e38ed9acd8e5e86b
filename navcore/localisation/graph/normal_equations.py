"""Sparse normal equations of a pose graph in the plane.

The state is one row for each pose, x and y in metres and yaw, and a last one for the constant
errors of odometry, which all its edges have in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU, splu

from navcore.geometry.arrays import Bools, Floats, Indices
from navcore.geometry.transform import Matrix, Pose2


class Factors(NamedTuple):
    """Measured relative poses as arrays; factors on a single pose come last."""

    first: Indices
    """(F,) index of the pose in whose frame was measured; −1 for the map."""
    second: Indices
    """(F,) index of the measured pose."""
    measured: Floats
    """(F, 3) measured x, y in metres and yaw in radians."""
    whitening: Floats
    """(F, 3, 3) root of the information: its product with the error has unit covariance."""
    by_errors: Floats
    """(F, 3, 3) derivative of the whitened measurement by the constant errors."""


def factors_of(
    *,
    ends: Sequence[tuple[int, int]],
    measured: Sequence[Pose2],
    information: Sequence[Matrix],
    by_errors: Sequence[Matrix],
) -> Factors:
    """Return factors as arrays; raises `LinAlgError` for information that has a negative
    eigenvalue."""
    pairs = np.array(ends, dtype=np.int64).reshape(-1, 2)
    blocks = np.array(information, dtype=np.float64).reshape(-1, 3, 3)
    values, vectors = np.linalg.eigh(0.5 * (blocks + blocks.transpose(0, 2, 1)))
    if len(values) and (values < -1e-9 * np.abs(values).max(axis=1, keepdims=True)).any():
        raise np.linalg.LinAlgError("negative information")
    roots = np.sqrt(np.maximum(values, 0.0))[:, :, None] * vectors.transpose(0, 2, 1)
    return Factors(
        first=pairs[:, 0],
        second=pairs[:, 1],
        measured=np.array([(p.x_m, p.y_m, p.yaw_rad) for p in measured]).reshape(-1, 3),
        whitening=roots,
        by_errors=roots @ np.array(by_errors, dtype=np.float64).reshape(-1, 3, 3),
    )


class NormalEquations:
    """Errors, their derivatives and linear steps; the pattern of the matrix is found once."""

    def __init__(self, factors: Factors, poses: int, free: Bools) -> None:
        """`poses`: number of poses. `free`: (poses + 1,) which rows of the state may change."""
        self._factors = factors
        self._free = free
        self._size = 3 * int(free.sum())
        column = np.full(poses + 2, -1, dtype=np.int64)
        column[:-1][free] = np.arange(int(free.sum()))
        self._column = column  # the last entry is the map, which index −1 names
        errors = np.full(len(factors.first), poses, dtype=np.int64)
        self._ends = (factors.first, factors.second, errors)
        self._kept: SuperLU | None = None
        self._pattern()

    def _pattern(self) -> None:
        """Find the row and the column of each block, and the place of each entry in the matrix."""
        columns = [self._column[end] for end in self._ends]
        rows = np.concatenate([row for row in columns for _ in columns])
        cols = np.concatenate(columns * len(columns))
        self._used = (rows >= 0) & (cols >= 0)
        three = np.arange(3)
        row = (3 * rows[self._used])[:, None, None] + three[None, :, None]
        col = (3 * cols[self._used])[:, None, None] + three[None, None, :]
        diagonal = np.arange(self._size)
        keys = np.concatenate([(col * self._size + row).ravel(), diagonal * (self._size + 1)])
        unique, self._place = np.unique(keys, return_inverse=True)
        self._indices = (unique % self._size).astype(np.int32) if self._size else unique
        counts = np.bincount(unique // max(self._size, 1), minlength=self._size)
        self._indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        self._diagonal = self._place[len(self._place) - self._size :]

    def errors(self, state: Floats) -> Floats:
        """Return the (F, 3) whitened errors of a state."""
        if not len(self._factors.first):
            return np.zeros((0, 3))
        cos, sin, delta, turn = self._relative(state)
        z = self._factors.measured
        x = cos * delta[:, 0] + sin * delta[:, 1] - z[:, 0]
        y = -sin * delta[:, 0] + cos * delta[:, 1] - z[:, 1]
        cos_z, sin_z = np.cos(z[:, 2]), np.sin(z[:, 2])
        yaw = turn - z[:, 2]
        error = np.column_stack(
            [
                cos_z * x + sin_z * y,
                -sin_z * x + cos_z * y,
                yaw - 2.0 * np.pi * np.round(yaw / (2.0 * np.pi)),
            ]
        )
        whitened = np.einsum("fij,fj->fi", self._factors.whitening, error)
        return np.asarray(whitened - self._factors.by_errors @ state[-1])

    def chi2(self, state: Floats) -> Floats:
        """Return the (F,) squared Mahalanobis distances."""
        return np.asarray(np.square(self.errors(state)).sum(axis=1))

    def step(self, state: Floats, weights: Floats, damping: float) -> Floats:
        """Return the (poses + 1, 3) change of a damped Gauss–Newton step."""
        change = np.zeros_like(state)
        if not self._size:
            return change
        jacobians = self._jacobians(state)
        error = self.errors(state) * weights[:, None]
        gradient = np.zeros((len(state) + 1, 3))
        for ends, jacobian in zip(self._ends, jacobians, strict=True):
            pulls = np.einsum("fji,fj->fi", jacobian, error)
            for k in range(3):
                gradient[:, k] += np.bincount(
                    ends % (len(state) + 1), weights=pulls[:, k], minlength=len(state) + 1
                )
        solved = self._factorised(jacobians, weights, damping).solve(
            -gradient[:-1][self._free].ravel()
        )
        change[self._free] = solved.reshape(-1, 3)
        return change

    def covariances(
        self, state: Floats, weights: Floats, wanted: Sequence[int], damping: float
    ) -> list[Matrix]:
        """Return the (3, 3) marginal covariances of poses, zero for those that are not free."""
        blocks = [np.zeros((3, 3)) for _ in wanted]
        if not self._size or not self._free[list(wanted)].any():
            return blocks
        factor = self._factor(state, weights, damping)
        for block, pose in zip(blocks, wanted, strict=True):
            start = 3 * int(self._column[pose])
            if start >= 0:
                unit = np.zeros((self._size, 3))
                unit[start : start + 3] = np.eye(3)
                solved = factor.solve(unit)[start : start + 3]
                block[:] = 0.5 * (solved + solved.T)
        return blocks

    def relative_covariance(
        self, state: Floats, weights: Floats, first: int, second: int, damping: float
    ) -> Matrix:
        """Return the (3, 3) covariance of one pose in the frame of another."""
        starts = [3 * int(self._column[pose]) for pose in (first, second)]
        joint = np.zeros((6, 6))
        if max(starts) >= 0:
            rows = [start + k if start >= 0 else -1 for start in starts for k in range(3)]
            free = [k for k, row in enumerate(rows) if row >= 0]
            unit = np.zeros((self._size, len(free)))
            unit[[rows[k] for k in free], range(len(free))] = 1.0
            solved = self._factor(state, weights, damping).solve(unit)
            joint[np.ix_(free, free)] = solved[[rows[k] for k in free]]
        one, two = state[first], state[second]
        cos, sin = np.cos(two[2]), np.sin(two[2])
        into = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        swing = np.eye(3)
        swing[:2, 2] = one[1] - two[1], two[0] - one[0]
        jacobian = np.hstack([-into @ swing, into])
        covariance = jacobian @ joint @ jacobian.T
        return np.asarray(0.5 * (covariance + covariance.T))

    def _factor(self, state: Floats, weights: Floats, damping: float) -> SuperLU:
        """Return the factorised matrix at the final poses, which is needed again and again."""
        if self._kept is None:
            self._kept = self._factorised(self._jacobians(state), weights, damping)
        return self._kept

    def _relative(self, state: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return cosine and sine of the first poses, the shifts in the map and the turns."""
        padded = np.vstack([state, np.zeros((1, 3))])
        one, two = padded[self._factors.first], padded[self._factors.second]
        return np.cos(one[:, 2]), np.sin(one[:, 2]), two[:, :2] - one[:, :2], two[:, 2] - one[:, 2]

    def _jacobians(self, state: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the (F, 3, 3) derivatives of the whitened errors by the first and the second pose
        and by the constant errors."""
        cos, sin, delta, _ = self._relative(state)
        z = self._factors.measured[:, 2]
        # The rotation into the frame of the measured pose, and its derivative by the first yaw.
        c, s = cos * np.cos(z) - sin * np.sin(z), sin * np.cos(z) + cos * np.sin(z)
        by_first = np.zeros((len(c), 3, 3))
        by_second = np.zeros((len(c), 3, 3))
        by_second[:, 0, 0], by_second[:, 0, 1] = c, s
        by_second[:, 1, 0], by_second[:, 1, 1] = -s, c
        by_second[:, 2, 2] = 1.0
        by_first[:, :2, :2] = -by_second[:, :2, :2]
        by_first[:, 0, 2] = -s * delta[:, 0] + c * delta[:, 1]
        by_first[:, 1, 2] = -c * delta[:, 0] - s * delta[:, 1]
        by_first[:, 2, 2] = -1.0
        whitening = self._factors.whitening
        return whitening @ by_first, whitening @ by_second, -self._factors.by_errors

    def _factorised(
        self, jacobians: tuple[Floats, Floats, Floats], weights: Floats, damping: float
    ) -> SuperLU:
        weighted = [one.transpose(0, 2, 1) * weights[:, None, None] for one in jacobians]
        blocks = np.concatenate([one @ two for one in weighted for two in jacobians])[self._used]
        values = np.concatenate([blocks.ravel(), np.zeros(self._size)])
        data = np.zeros(len(self._indices))
        data += np.bincount(self._place, weights=values, minlength=len(data))
        diagonal = data[self._diagonal]
        data[self._diagonal] = diagonal + damping * np.maximum(diagonal, 1.0)
        matrix = csc_matrix((data, self._indices, self._indptr), shape=(self._size, self._size))
        return splu(
            matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
