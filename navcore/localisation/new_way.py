"""Way on which a robot sees something new, by which a place on the map has to prove itself."""

from __future__ import annotations

import math

import numpy as np

from navcore.geometry.transform import Pose2

_APART_M, _APART_RAD = 0.5, 1.0
"""Difference of two poses in metres or in radians from which another part of the world is seen."""


class NewWay:
    """Counts the metres that lead where the robot has not been yet, by odometry, until there are
    enough; a turn by 1 rad counts as 0.5 m, a full turn at most.

    Strokes to and fro, or a way that is driven again, show only what was seen before: it fits a
    wrong place as well as it did.
    """

    def __init__(self, needed_m: float) -> None:
        """Begin at the next pose."""
        self._needed_m = needed_m
        self._poses = np.zeros((0, 3))  # each apart from all others

    @property
    def is_enough(self) -> bool:
        """Whether the robot has come as far as is needed."""
        return max(len(self._poses) - 1, 0) * _APART_M >= self._needed_m

    def follow(self, T_odom_base: Pose2) -> None:
        """Note the pose of one more frame."""
        if self.is_enough:
            return
        pose = T_odom_base.x_m, T_odom_base.y_m, T_odom_base.yaw_rad
        x_m, y_m, turn_rad = (self._poses - pose).T
        has_turned = np.cos(turn_rad) <= math.cos(_APART_RAD)
        if (has_turned | (np.hypot(x_m, y_m) >= _APART_M)).all():
            self._poses = np.vstack([self._poses, pose])
