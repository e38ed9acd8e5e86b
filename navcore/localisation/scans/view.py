"""What the camera of one scan has in view of the points of another."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.localisation.localisation import ScanConfig
from navcore.geometry.arrays import Bools, Floats, Indices, Points
from navcore.localisation.scans.scan import Scan

_RIM_M = 0.3
"""Distance in metres from the end of the camera's range, and behind what is in view, within which
points come and go."""
_DIRECTION_RAD = math.radians(3.0)
"""Width of a direction in radians."""


def is_in_view(points: Scan, view: Scan, config: ScanConfig, *, hidden: bool = False) -> Bools:
    """Return (N,) which points of a scan the camera of another one, in the same frame, has in view:
    between its outermost points, within its range, and, unless `hidden`, not behind what it sees.

    What counts is where they are from that camera: a post that the robot has come past is beside
    it then, and no longer in view.
    """
    bearing, range_m = _polar(view.points_base, view.origin)
    theirs, their_range_m = _polar(points.points_base, view.origin)
    in_view = (theirs > bearing.min()) & (theirs < bearing.max())
    in_view &= their_range_m < config.max_range_m - _RIM_M
    if not hidden:
        seen_m = np.full(math.ceil(2 * math.pi / _DIRECTION_RAD) + 1, np.inf)
        np.minimum.at(seen_m, _direction(bearing), range_m)
        in_view &= their_range_m < seen_m[_direction(theirs)] + _RIM_M
    return np.asarray(in_view)


def _polar(points: Points, camera: Points) -> tuple[Floats, Floats]:
    """Return (N,) bearings in radians and (N,) distances in metres of (N, 2) points from a camera
    at (2,)."""
    x, y = (points - camera).T
    return np.arctan2(y, x), np.hypot(x, y)


def _direction(bearing: Floats) -> Indices:
    """Return (N,) numbers of the directions of bearings in radians."""
    return np.floor((bearing + math.pi) / _DIRECTION_RAD).astype(np.int64)
