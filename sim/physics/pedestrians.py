"""People who stand, or walk back and forth. They are moved, not pushed, on the clock of the
physics, which would give them unlimited strength: a walker stops where the robot's body is."""

from __future__ import annotations

import bisect
import itertools
import math

import numpy as np

from navcore.geometry.transform import Pose2, wrap_angle
from navcore.robot.profile import HUSKY, RobotProfile
from sim.scenario.schema import Person

BODY_DIAMETER_M = 0.56
"""Diameter of a person on the floor, arms and feet included."""
POLITE_GAP_M = 0.7
"""Distance that a walker keeps from a robot in front."""
SIDE_GAP_M = 0.1
"""Distance that a walker keeps from a robot at the side."""
AHEAD_RAD = math.radians(50)
"""Half of the angle that counts as in front."""
PATIENCE_S = 3.0
"""Waiting time after which a walker turns round."""
TURN_RADPS = math.radians(240)
"""Turning rate of a walker."""


class Walker:
    """One person; `step` advances the person."""

    def __init__(
        self, person: Person, rng: np.random.Generator, period_s: float, robot: RobotProfile = HUSKY
    ) -> None:
        self._robot = robot
        self._points = [(float(x), float(y)) for x, y in person.points]
        self._speed_mps = person.speed_mps if len(self._points) > 1 else 0.0
        self._yields, self._period_s = person.yields, period_s
        self._legs_m = np.hypot(*np.diff(person.points, axis=0).T).tolist()
        self._ends_m = [0.0, *itertools.accumulate(self._legs_m)]
        self._along_m = float(rng.uniform(0, self._ends_m[-1])) if self.walks else 0.0
        self._sense = 1 if rng.random() < 0.5 else -1
        if person.begins_at is not None:
            self._along_m, self._sense = person.begins_at * self._ends_m[-1], 1
        self._pauses_s = person.pauses_s or [0.0] * len(self._points)
        self._pause_left_s = 0.0
        self._waited_s = 0.0
        self.pose = self._pose_at(math.radians(person.yaw_deg))
        """T_map_person; the person faces along x."""
        if self.walks:
            self.pose = Pose2(x_m=self.pose.x_m, y_m=self.pose.y_m, yaw_rad=self._heading())

    @property
    def walks(self) -> bool:
        """Whether the person ever moves."""
        return self._speed_mps > 0

    def step(self, robot: Pose2) -> None:
        """Advance by one physics step, or wait for the robot."""
        if not self.walks:
            return
        if (self._yields and self._is_blocked(robot)) or self._walks_into(robot):
            self._waited_s += self._period_s
            if self._waited_s >= PATIENCE_S:
                self._waited_s, self._sense = 0.0, -self._sense
            return
        self._waited_s = 0.0
        self._pause_left_s -= self._period_s
        if self._pause_left_s > 0:
            return
        before_m = self._along_m
        self._along_m += self._sense * self._speed_mps * self._period_s
        low, high = min(before_m, self._along_m), max(before_m, self._along_m)
        passed = zip(self._pauses_s, self._ends_m, strict=True)
        self._pause_left_s = max(
            (pause_s for pause_s, at_m in passed if low < at_m < high), default=0.0
        )
        if not 0 <= self._along_m <= self._ends_m[-1]:
            self._along_m = min(max(self._along_m, 0.0), self._ends_m[-1])
            self._sense = -self._sense
        self.pose = self._pose_at(self._turned_yaw())

    def _walks_into(self, robot: Pose2) -> bool:
        """Return whether the next step would be into the robot's body.

        Who does not look out walks until they touch the robot. They cannot push it: it weighs as
        much as they do, or more, and its wheels are braked. Nor do they follow it at once: a person
        who took up each millimetre by which the contact moves it would push it after all.
        """
        step_m = self._speed_mps * self._period_s
        x_m, y_m = self.pose.x_m, self.pose.y_m
        gap_m = _gap_m(self._robot, robot, x_m, y_m)
        waits = self._waited_s > 0
        if gap_m > (SIDE_GAP_M if waits else step_m):
            return False
        heading = self._heading()
        x_m, y_m = x_m + step_m * math.cos(heading), y_m + step_m * math.sin(heading)
        return _gap_m(self._robot, robot, x_m, y_m) < (gap_m if waits else min(gap_m, 0.0))

    def _is_blocked(self, robot: Pose2) -> bool:
        reach = robot.distance_to(self.pose.x_m, self.pose.y_m)
        if reach > self._robot.circumscribed_radius_m + BODY_DIAMETER_M / 2 + POLITE_GAP_M:
            return False
        x, y = _nearest_of_footprint(self._robot, robot, self.pose.x_m, self.pose.y_m)
        gap = _gap_m(self._robot, robot, self.pose.x_m, self.pose.y_m)
        if gap <= 0:
            bearing = math.atan2(robot.y_m - self.pose.y_m, robot.x_m - self.pose.x_m)
        else:
            bearing = math.atan2(y - self.pose.y_m, x - self.pose.x_m)
        off = abs(wrap_angle(bearing - self._heading()))
        return (off < AHEAD_RAD and gap < POLITE_GAP_M) or (off < math.pi / 2 and gap < SIDE_GAP_M)

    def _heading(self) -> float:
        """Return the direction of the present leg, in the sense of walking."""
        leg = self._leg()
        (x0, y0), (x1, y1) = self._points[leg], self._points[leg + 1]
        return math.atan2(self._sense * (y1 - y0), self._sense * (x1 - x0))

    def _turned_yaw(self) -> float:
        most = TURN_RADPS * self._period_s
        missing = wrap_angle(self._heading() - self.pose.yaw_rad)
        return wrap_angle(self.pose.yaw_rad + max(-most, min(most, missing)))

    def _leg(self) -> int:
        return min(bisect.bisect_right(self._ends_m, self._along_m), len(self._legs_m)) - 1

    def _pose_at(self, yaw_rad: float) -> Pose2:
        x, y = self._points[0]
        if self.walks:
            leg = self._leg()
            share = (self._along_m - self._ends_m[leg]) / self._legs_m[leg]
            (x0, y0), (x1, y1) = self._points[leg], self._points[leg + 1]
            x, y = (1 - share) * x0 + share * x1, (1 - share) * y0 + share * y1
        return Pose2(x_m=x, y_m=y, yaw_rad=yaw_rad)


def _gap_m(profile: RobotProfile, robot: Pose2, x_m: float, y_m: float) -> float:
    """Return the distance in metres from a person at a position to the footprint; negative while
    they overlap."""
    x, y = _nearest_of_footprint(profile, robot, x_m, y_m)
    return math.hypot(x - x_m, y - y_m) - BODY_DIAMETER_M / 2


def _nearest_of_footprint(
    profile: RobotProfile, robot: Pose2, x_m: float, y_m: float
) -> tuple[float, float]:
    """Return the point of the footprint nearest to a point, in the map frame."""
    cos, sin = math.cos(robot.yaw_rad), math.sin(robot.yaw_rad)
    dx, dy = x_m - robot.x_m, y_m - robot.y_m
    half_x, half_y = profile.length_m / 2, profile.width_m / 2
    along = max(-half_x, min(half_x, cos * dx + sin * dy))
    across = max(-half_y, min(half_y, -sin * dx + cos * dy))
    return robot.x_m + cos * along - sin * across, robot.y_m + sin * along + cos * across
