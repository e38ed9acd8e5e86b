"""Margins of beware cells that follow the robot's uncertainty since each cell was in view.

What the camera sees now is where it is seen. What it saw before is as uncertain, relative to the
robot, as odometry has become since, and no more than the position in the map has: the difference of
two covariances in the map holds errors, as of the heading far behind, that moved robot and cell
alike.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from navcore.config.localisation.localisation import OdometryConfig
from navcore.config.safety import KeepOutMonitorConfig
from navcore.geometry.arrays import Bools, Floats, Points
from navcore.geometry.transform import Matrix, Pose2
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.tracking.odometry_model import OdometryStep, travel_of, travel_variance
from navcore.robot.frame import Frame


class _Seen(NamedTuple):
    """Moment at which a cell was last in view."""

    covariance: Matrix
    """(2, 2) covariance of the position in the map, square metres."""
    travel: Floats
    """(3,) travel by odometry until then."""


class CellMargins:
    """Remembers when each nearby cell was last in view."""

    def __init__(
        self,
        *,
        keep_out: KeepOutMonitorConfig,
        odometry: OdometryConfig,
        resolution_m: float,
        range_m: float,
    ) -> None:
        """Cells farther from the camera than `range_m` metres are not in view."""
        self._keep_out, self._odometry = keep_out, odometry
        self._resolution_m, self._range_m = resolution_m, range_m
        self._seen: dict[tuple[int, int], _Seen] = {}
        self._travel = np.zeros(3)
        self._last: tuple[Pose2, int] | None = None

    def follow(self, cells: Points, frame: Frame, place: LocalisationEstimate) -> Floats:
        """Return (N,) growth in metres of (N, 2) cell centres of the map frame.

        The frame is placed in the map. Cells that are left out of a call are forgotten; a cell that
        was never in view, nor any beside it, is as uncertain as the robot's place in the map.
        """
        self._advance(place.T_map_odom.inverse() @ frame.pose, frame.stamp_ns)
        if not len(cells):
            self._seen = {}
            return np.zeros(0)
        now = _Seen(place.covariance[:2, :2], self._travel)
        keys = [(int(x), int(y)) for x, y in np.floor(cells / self._resolution_m)]
        before = self._before(keys)
        seen = [
            now if in_view else before.get(key)
            for key, in_view in zip(keys, self._in_view(cells, frame), strict=True)
        ]
        self._seen = {key: one for key, one in zip(keys, seen, strict=True) if one is not None}
        away_m = np.hypot(*(cells - (frame.pose.x_m, frame.pose.y_m)).T)
        return np.asarray(self._keep_out.sigmas * np.sqrt(self._variance(seen, now, away_m)))

    def _advance(self, odom: Pose2, stamp_ns: int) -> None:
        if self._last is not None:
            before, then_ns = self._last
            step = OdometryStep.between(before, odom, (stamp_ns - then_ns) / 1e9)
            self._travel = self._travel + travel_of(step, self._odometry)
        self._last = odom, stamp_ns

    def _before(self, keys: list[tuple[int, int]]) -> dict[tuple[int, int], _Seen]:
        """Return when cells were in view before; cells that have come up since have the moment of
        the nearest one, within the configured distance."""
        new = [key for key in keys if key not in self._seen]
        if not new or not self._seen:
            return self._seen
        known = list(self._seen)
        away, nearest = cKDTree(known).query(new)
        beside = away * self._resolution_m <= self._keep_out.neighbour_m
        return self._seen | {
            key: self._seen[known[i]]
            for key, i, is_near in zip(new, nearest, beside, strict=True)
            if is_near
        }

    def _variance(self, seen: list[_Seen | None], now: _Seen, away_m: Floats) -> Floats:
        """Return the (N,) largest variances of cells relative to the robot, square metres."""
        never = np.zeros((2, 2))
        then = np.stack([never if one is None else one.covariance for one in seen])
        in_map = np.maximum(np.linalg.eigvalsh(now.covariance - then)[:, -1], 0.0)
        was_seen = np.array([one is not None for one in seen])
        since = now.travel - np.stack([now.travel if one is None else one.travel for one in seen])
        by_odometry = travel_variance(since, away_m, self._odometry)
        return np.asarray(np.where(was_seen, np.minimum(in_map, by_odometry), in_map))

    def _in_view(self, cells: Points, frame: Frame) -> Bools:
        floor = np.column_stack([cells, np.zeros(len(cells))])
        camera = frame.T_map_camera[:2, 3]
        near = np.hypot(*(cells - camera).T) <= self._range_m
        return np.asarray(near & frame.shows(floor))
