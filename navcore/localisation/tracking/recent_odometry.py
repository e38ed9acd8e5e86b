"""Odometry of the last second: where the robot was, relative to now, at the time of a position fix,
which an image brings later."""

from __future__ import annotations

from bisect import bisect_left

from navcore.geometry.transform import Pose2

LIFE_NS = 1_000_000_000
"""Time in nanoseconds that is covered: frames repeat the fixes of the last second."""


class RecentOdometry:
    """Poses by odometry with their stamps, in the order of time."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._poses: list[Pose2] = []

    def add(self, T_odom_base: Pose2, stamp_ns: int) -> None:
        """Add the newest frame; a clock that goes back begins again."""
        if self._stamps and stamp_ns <= self._stamps[-1]:
            self.clear()
        self._stamps.append(stamp_ns)
        self._poses.append(T_odom_base)
        while len(self._stamps) > 1 and self._stamps[1] <= stamp_ns - LIFE_NS:
            del self._stamps[0], self._poses[0]

    def clear(self) -> None:
        """Forget all poses: odometry has jumped."""
        self._stamps, self._poses = [], []

    def since(self, stamp_ns: int) -> Pose2 | None:
        """Return the motion from a stamp to the newest frame, T_then_now; None if the stamp is
        older than what is kept. After the newest frame there is none."""
        if not self._stamps or stamp_ns < self._stamps[0]:
            return None
        after = min(bisect_left(self._stamps, stamp_ns), len(self._stamps) - 1)
        if after == 0:
            then = self._poses[0]
        else:
            begin_ns, end_ns = self._stamps[after - 1 : after + 1]
            share = min((stamp_ns - begin_ns) / (end_ns - begin_ns), 1.0)
            step = self._poses[after - 1].inverse() @ self._poses[after]
            then = self._poses[after - 1] @ Pose2(
                x_m=share * step.x_m, y_m=share * step.y_m, yaw_rad=share * step.yaw_rad
            )
        return then.inverse() @ self._poses[-1]
