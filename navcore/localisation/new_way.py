"""Way on which a robot sees something new, by which a place on the map has to prove itself."""

from __future__ import annotations

import math

import numpy as np

from navcore.geometry.transform import Pose2, wrap_angle

_APART_M = 0.5
"""Distance in metres from wherever the robot has been from which floor is new."""
_LONGEST_M = 1.0
"""Distance in metres that counts at most between two frames: beyond it odometry has jumped."""
_ROUND_RAD = 2.0 * math.pi
"""Turn in radians that has shown everything around the robot."""


class NewWay:
    """Counts the metres over floor where the robot has not been yet, by odometry, until there are
    enough, and once for the whole way how far it has turned.

    Strokes to and fro, turning about at each end, or a way that is driven again, show only what was
    seen before: it fits a wrong place as well as it did.
    """

    def __init__(self, needed_m: float) -> None:
        """Begin at the next pose."""
        self._needed_m = needed_m
        self._positions = np.zeros((0, 2))  # each apart from all others
        self._floor_m = self._turned_rad = self._most_rad = 0.0
        self._newest: Pose2 | None = None
        self.driven_m = 0.0
        """Distance in metres since the beginning, over new floor or not."""

    @property
    def is_enough(self) -> bool:
        """Whether the robot has come as far as is needed; a turn by 1 rad counts as 0.5 m."""
        return self._floor_m + self._most_rad / 2 >= self._needed_m

    def follow(self, T_odom_base: Pose2) -> None:
        """Note the pose of one more frame."""
        if self.is_enough:
            return
        if self._newest is not None:
            moved_m = T_odom_base.distance_to(self._newest.x_m, self._newest.y_m)
            self.driven_m += min(moved_m, _LONGEST_M)
            self._turned_rad += wrap_angle(T_odom_base.yaw_rad - self._newest.yaw_rad)
            self._most_rad = min(max(self._most_rad, abs(self._turned_rad)), _ROUND_RAD)
        self._newest, here = T_odom_base, np.array([T_odom_base.x_m, T_odom_base.y_m])
        nearest_m = float(np.hypot(*(self._positions - here).T).min(initial=math.inf))
        if nearest_m < _APART_M:
            return
        if len(self._positions):
            self._floor_m += min(nearest_m, _LONGEST_M)
        self._positions = np.vstack([self._positions, here])
