"""Kalman filter of the robot's pose in the map and of the constant errors of its odometry."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.localisation import OdometryConfig
from navcore.geometry.transform import Matrix, Pose2, wrap_angle
from navcore.localisation.tracking.odometry_model import (
    LENGTH_SCALE,
    STATES,
    YAW,
    OdometryStep,
    initial_covariance,
    predict,
)

_DEFAULT = OdometryConfig()
_LEAST = np.diag([1e-4, 1e-4, 1e-5]) ** 2
"""Least covariance of a pose, so that it can be inverted."""
_BOTH_WAYS = 0.05
"""Least ratio of the information along the two axes of a scan that tells lengths."""


class PoseFilter:
    """State x, y, yaw, gyro bias, length scale and gyro scale with its covariance.

    A match against the robot's own new map moves the mean, but makes the pose no more certain: that
    map errs as the robot did. A second covariance, of the pose within that map, weighs such a
    match. What it tells of lengths is true all the same, wherever the map lies: the scans move by
    as much as the robot.
    """

    def __init__(self, pose: Pose2, config: OdometryConfig = _DEFAULT) -> None:
        self._config = config
        self._state = np.zeros(STATES)
        self._state[:3] = (pose.x_m, pose.y_m, pose.yaw_rad)
        self._covariance = initial_covariance(config)
        self._within = self._covariance

    @property
    def pose(self) -> Pose2:
        """T_map_base."""
        x, y, yaw = (float(value) for value in self._state[:3])
        return Pose2(x_m=x, y_m=y, yaw_rad=yaw)

    @property
    def covariance(self) -> Matrix:
        """(3, 3) covariance of the pose, in map axes."""
        return np.asarray(self._covariance[:3, :3] + _LEAST)

    @property
    def covariance_within(self) -> Matrix:
        """(3, 3) covariance of the pose within the robot's own new map, in map axes."""
        return np.asarray(self._within[:3, :3] + _LEAST)

    @property
    def odometry_errors(self) -> Matrix:
        """(3,) gyro bias in rad/s, relative errors of lengths and of turns."""
        return np.asarray(self._state[3:].copy())

    def predict(self, step: OdometryStep) -> None:
        """Move by a step of odometry."""
        before = self._state
        self._state, self._covariance = predict(before, self._covariance, step, self._config)
        _, self._within = predict(before, self._within, step, self._config)

    def place(self, pose: Pose2, covariance: Matrix) -> None:
        """Set the pose; what was learnt about odometry stays."""
        self._state[:3] = (pose.x_m, pose.y_m, pose.yaw_rad)
        spread = self._covariance.copy()
        spread[:3], spread[:, :3] = 0.0, 0.0
        spread[:3, :3] = covariance
        self._covariance = self._within = spread

    def move(self, motion: Pose2) -> None:
        """Move rigidly with the map: T_new_old."""
        pose = motion @ self.pose
        turn = np.eye(STATES)
        cos, sin = math.cos(motion.yaw_rad), math.sin(motion.yaw_rad)
        turn[:2, :2] = ((cos, -sin), (sin, cos))
        self._state[:3] = (pose.x_m, pose.y_m, pose.yaw_rad)
        self._covariance = turn @ self._covariance @ turn.T
        self._within = turn @ self._within @ turn.T

    def fuse_match(
        self, matched: Pose2, information: Matrix, floor: Matrix, *, absolute: bool
    ) -> None:
        """Fuse a match whose expectation was the pose of this filter, with its covariance if the
        match is `absolute`, else with that within the robot's own map.

        `matched` is the most probable pose, `information` (3, 3) that of the scan alone as it was
        weighed against the expectation, and `floor` (3, 3) an error of the map which no number of
        points makes smaller.
        """
        spread = self._covariance if absolute else self._within
        before = spread[:3, :3] + _LEAST
        prior = np.linalg.inv(before)
        # With z the pose by the scan alone: (prior + information) · (matched − pose)
        # = information · (z − pose); the floor is then added to the covariance of z.
        shift = difference(matched, self.pose)
        pull = np.linalg.solve(np.eye(3) + information @ floor, (prior + information) @ shift)
        weakened = np.linalg.solve(np.eye(3) + information @ floor, information)
        posterior = np.asarray(np.linalg.inv(prior + (weakened + weakened.T) / 2), dtype=np.float64)
        # What the new pose says about the other states, too.
        cross = np.linalg.solve(before, spread[:3]).T
        self._state = self._state + cross @ (posterior @ pull)
        self._state[YAW] = wrap_angle(self._state[YAW])
        known = spread[LENGTH_SCALE, LENGTH_SCALE]
        spread = spread - cross @ (before - posterior) @ cross.T
        self._within = (spread + spread.T) / 2
        if absolute:
            self._covariance = self._within
        elif _tells_both_ways(information):
            self._learn_lengths(known, self._within[LENGTH_SCALE, LENGTH_SCALE])

    def _learn_lengths(self, before: float, after: float) -> None:
        """Make the pose as certain as a better known scale makes it: a match has reduced the
        variance of the scale from `before` to `after`. Scans err alike, so the scale becomes no
        more certain than `length_floor`."""
        known, floor = self._covariance[LENGTH_SCALE, LENGTH_SCALE], self._config.length_floor**2
        if known <= floor or after >= before:
            return
        error = max(before * after / (before - after), known * floor / (known - floor))
        column = self._covariance[:, LENGTH_SCALE]
        self._covariance = self._covariance - np.outer(column, column) / (known + error)

    def fuse_position(self, residual: Matrix, rows: Matrix, covariance: Matrix) -> None:
        """Fuse a measurement of the pose: (M,) difference from the expected one, (M, 3) its
        derivatives by x, y and yaw, and its (M, M) covariance."""
        full = np.zeros((len(rows), STATES))
        full[:, :3] = rows
        spread = full @ self._covariance @ full.T + covariance
        gain = np.linalg.solve(spread, full @ self._covariance).T
        self._state = self._state + gain @ residual
        self._state[YAW] = wrap_angle(self._state[YAW])
        keep = np.eye(STATES) - gain @ full
        self._covariance = keep @ self._covariance @ keep.T + gain @ covariance @ gain.T
        self._within = self._covariance


def _tells_both_ways(information: Matrix) -> bool:
    """Return whether a scan tells the position in every direction: between bare walls it does
    not."""
    least, most = np.linalg.eigvalsh(information[:2, :2])
    return bool(least > _BOTH_WAYS * most)


def difference(pose: Pose2, other: Pose2) -> Matrix:
    """Return (3,) x, y and yaw of a pose minus those of another."""
    return np.array(
        [pose.x_m - other.x_m, pose.y_m - other.y_m, wrap_angle(pose.yaw_rad - other.yaw_rad)]
    )
