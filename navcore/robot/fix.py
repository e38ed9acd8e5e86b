"""Position fix: where the robot is in the map, measured without odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from navcore.errors import BadFrame
from navcore.geometry.transform import Matrix


class FixSource(StrEnum):
    """What measured a position."""

    GNSS = "gnss"
    """A satellite receiver; its position is that of the base, lever arm removed."""
    TAG = "tag"
    """A fiducial marker whose pose in the map is known."""
    DOCK = "dock"
    """The charging dock, which holds the robot in a known pose."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PositionFix:
    """Measured T_map_base: in the map's frame, whatever odometry believes.

    A robot delivers GNSS in the plane of its site: x and y in metres from the site's origin, along
    the axes of the map.
    """

    stamp_ns: int
    """Time of the measurement in nanoseconds of the robot's monotonic clock; not later than the
    frame that brings it."""
    x_m: float
    """Position of the base along the map's x axis in metres."""
    y_m: float
    """Position of the base along the map's y axis in metres."""
    yaw_rad: float | None = None
    """Heading of the base in the map in radians; None where it is not measured."""
    covariance: Matrix
    """(2, 2) covariance of x and y in m², or (3, 3) with yaw in radians where it is measured."""
    source: FixSource
    """What measured it."""
    source_id: int | None = None
    """Number of the tag or dock; None for GNSS."""
    correlation_s: float = 0.0
    """Time in seconds for which the errors of successive fixes stay alike; averaging over less
    gains nothing. 0 for independent errors."""


def check_fix(fix: PositionFix) -> None:
    """Raise `BadFrame` for a fix that must not enter localisation, with the reason."""
    numbers = (fix.x_m, fix.y_m, 0.0 if fix.yaw_rad is None else fix.yaw_rad, fix.correlation_s)
    if not all(map(math.isfinite, numbers)):
        raise BadFrame(f"fix by {fix.source} is not finite: {numbers}")
    size = 2 if fix.yaw_rad is None else 3
    if fix.covariance.shape != (size, size):
        raise BadFrame(
            f"fix by {fix.source} has a covariance of shape {fix.covariance.shape}, expected "
            f"{(size, size)} {'without' if size == 2 else 'with'} yaw"
        )
    symmetric = np.isfinite(fix.covariance).all() and np.allclose(fix.covariance, fix.covariance.T)
    if not symmetric or np.linalg.eigvalsh(fix.covariance)[0] <= 0:
        raise BadFrame(
            f"fix by {fix.source} has the covariance {fix.covariance.tolist()}, expected a "
            "symmetric, positive definite one"
        )
