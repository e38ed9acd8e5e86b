"""Places beside the best one that fit nearly as well.

Along a corridor a fit ends at what lies next to where it began, and its own covariance knows only
the surfaces at which it ended. So it is begun again around the place, and the place is as uncertain
as those are apart that fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from navcore.geometry.transform import Matrix, Pose2, difference

_BESIDE_M = (-0.4, -0.2, 0.2, 0.4)
"""Distances in metres from a pose at which a fit is begun again."""


def poses_beside(pose: Pose2, covariance: Matrix) -> list[Pose2]:
    """Return poses around one, along the axes of its (3, 3) covariance: that along which it is
    least certain is the way along a corridor."""
    axes = np.linalg.eigh(covariance[:2, :2])[1].T
    return [
        replace(pose, x_m=pose.x_m + d * float(x), y_m=pose.y_m + d * float(y))
        for x, y in axes
        for d in _BESIDE_M
    ]


def spread_to(pose: Pose2, others: Iterable[Pose2]) -> Matrix:
    """Return the (3, 3) covariance by which a pose is more uncertain if it may be any of others:
    that of the farthest."""
    away = [difference(other, pose) for other in others]
    farthest = max(away, key=lambda one: math.hypot(one[0], one[1]), default=np.zeros(3))
    return np.outer(farthest, farthest)
