"""The path that the robot has driven on the map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.mapping.points.placing import pose_rows
from navcore.planning.route import read_only

STEP_M = 0.05
"""Distance between two points of the path, metres."""
MAX_POINTS = 20_000
"""Largest number of points: the newest kilometre is kept."""
JUMP_M = 1.0
"""Difference between the motions on the map and by odometry, metres, from which the robot has not
driven but is believed elsewhere."""


class DrivenPath:
    """Fed with each pose by one thread; `points` and `length_m` are read by any."""

    def __init__(self) -> None:
        self.points: Points = np.empty((0, 2))
        """(N, 2) positions in the map since the robot was last believed elsewhere, read-only."""
        self.length_m = 0.0
        """Distance driven so far, metres, by odometry: corrections of the place are no driving."""
        self._T_odom_base: Pose2 | None = None

    def forget(self) -> None:
        """Forget the positions, as after a change of the map."""
        self.points, self._T_odom_base = np.empty((0, 2)), None

    def follow(self, before: Sequence[Pose2], after: Sequence[Pose2]) -> None:
        """Move the positions with a correction of the map, T_map_base by pose ID: each with the
        pose that was nearest to it."""
        if not before or not len(self.points):
            return
        then, now = pose_rows(before), pose_rows(after)
        nearest = KDTree(then[:, :2]).query(self.points)[1]
        x, y = (self.points - then[nearest, :2]).T
        then_cos, then_sin = then[nearest, 2:].T
        along, aside = then_cos * x + then_sin * y, then_cos * y - then_sin * x
        cos, sin = now[nearest, 2:].T
        moved = np.column_stack([cos * along - sin * aside, sin * along + cos * aside])
        self.points = read_only(now[nearest, :2] + moved)

    def add(self, T_map_base: Pose2, T_odom_base: Pose2) -> None:
        """Go on to a pose in the map, which is `T_odom_base` by odometry."""
        here = np.array([[T_map_base.x_m, T_map_base.y_m]])
        before = self._T_odom_base
        if before is None:
            points = here
        else:
            moved_m = T_map_base.distance_to(*self.points[-1])
            if moved_m < STEP_M:
                return
            rolled_m = T_odom_base.distance_to(before.x_m, before.y_m)
            if abs(moved_m - rolled_m) > JUMP_M:
                points = here
            else:
                self.length_m += rolled_m
                points = np.concatenate([self.points[-MAX_POINTS:], here])
        self.points, self._T_odom_base = read_only(points), T_odom_base
