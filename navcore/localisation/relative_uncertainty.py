"""How uncertain the robot's position has become relative to a place where it was before.

By motion alone that is the growth of the covariance since then. But the covariance also shrinks:
an absolute position, a place that was found again or a closed loop tells the robot where it is. An
absolute position moves the estimate, and not what is on the map beside it: the robot is as
uncertain relative to that as the covariance has shrunk. A closed loop moves map and robot together.
A push moves the robot, which odometry does not tell.
"""

from __future__ import annotations

import numpy as np

from navcore.geometry.transform import Matrix
from navcore.localisation.estimate import LocalisationEstimate

_JUMP_M = 0.05
"""Standard deviation in metres of the motion of an estimate that counts: with every fix of RTK, and
every match with a saved map, the covariance shrinks by less."""


class RelativeUncertainty:
    """Follows the covariance of the position by motion; no clock."""

    def __init__(self) -> None:
        self._offset, self._most = np.zeros((2, 2)), np.zeros((2, 2))
        self._was_known = True
        self.is_moved = False
        """Whether the newest estimate is elsewhere than odometry has led from the one before."""

    def follow(self, place: LocalisationEstimate, *, with_map: bool) -> None:
        """Follow one more estimate; `with_map`: a correction has moved the map and the robot."""
        covariance = place.positions[1]
        shrunk = _positive_part(self._most - covariance)
        has_shrunk = np.linalg.eigvalsh(shrunk)[-1] > _JUMP_M**2
        if has_shrunk:
            self._offset = self._offset + (1.0 if with_map else 2.0) * shrunk
        if has_shrunk or np.trace(covariance) > np.trace(self._most):
            self._most = covariance
        is_found = place.is_known and not self._was_known
        self._was_known = place.is_known
        self.is_moved = (
            (bool(has_shrunk) and not with_map)
            or is_found
            or place.pushed_m > 0.0
            or place.place_correction is not None
        )

    def covariance(self, place: LocalisationEstimate) -> Matrix:
        """Return a (2, 2) covariance of the position in square metres, whose growth between two
        estimates is that of the position relative to where it was at the first."""
        return np.asarray(place.positions[1] + self._offset)


def growth(now: Matrix, then: Matrix) -> Matrix:
    """Return the (2, 2) covariance by which one has grown since another, 0 where it has not."""
    return _positive_part(now - then)


def _positive_part(matrix: Matrix) -> Matrix:
    variances, axes = np.linalg.eigh(matrix)
    return np.asarray((axes * np.maximum(variances, 0.0)) @ axes.T)
