"""Kalman filter of the robot's pose in the map and of the constant errors of its odometry."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.localisation.localisation import OdometryConfig
from navcore.geometry.transform import Matrix, Pose2, growth, wrap_angle
from navcore.localisation.graph.edges import ConstantErrors, in_parent_axes
from navcore.localisation.tracking.odometry_model import (
    ERRORS,
    GYRO_BIAS,
    LEAST,
    LENGTH_SCALE,
    SCAN_SCALE,
    STATES,
    YAW,
    OdometryStep,
    X,
    Y,
    initial_covariance,
    predict,
)

_DEFAULT = OdometryConfig()
_LEAST_ERRORS = np.diag([1e-7, 1e-5, 1e-5]) ** 2
"""Least covariance of the constant errors, so that it can be inverted where none are expected."""
_LEAST_SCALES = 1e-12 * np.eye(2)
"""The same of the scales of lengths."""
_LEARNT_S = 1.0
"""Longest standstill in seconds between two frames of which the bias of the gyro is learnt: in a
longer one the robot may have turned and back, or by as much as the gyro has drifted."""
_REFERENCE = slice(STATES, STATES + 3)
"""Elements of the state that are the pose of the reference."""
_POSES = np.array([X, Y, YAW, STATES, STATES + 1, STATES + 2])
"""Elements that are poses."""
_SCALES = np.array([LENGTH_SCALE, SCAN_SCALE])
"""Elements by which the map errs as a whole."""


class PoseFilter:
    """State x, y, yaw and the constant errors of odometry with its covariance, and an earlier pose,
    the reference, from which scans measure the motion since (stochastic cloning, Roumeliotis and
    Burdick 2002).

    There are three covariances. The first is by motion alone, since the last absolute position: a
    match against the robot's own new map moves the mean, but makes the pose no more certain there,
    since that map errs as the robot did. The second, of the pose within that map, weighs such a
    match. The third is the best: by it the pose is no less certain than the keyframes were whose
    surfaces the scan fits, which is less than by motion where the robot comes back. A motion that
    was measured by scans is true wherever the map lies, but for the error of scale that all scans
    have in common.

    What a motion, or a standstill, tells of the constant errors of odometry says that the robot was
    elsewhere all the way. The map that it has drawn does not move with that, so neither does the
    reference, and the pose only by as much as the motion since then changes: else a robot that
    stands would move away from the walls beside it.

    An absolute measurement moves the estimate, and not what is on the map beside it: the robot is
    as uncertain relative to that as the covariance by motion has shrunk, which is the covariance of
    the correction. `offset` and `moved` add that up.
    """

    def __init__(self, pose: Pose2, config: OdometryConfig = _DEFAULT) -> None:
        self._config = config
        self._state = np.zeros(_REFERENCE.stop)
        self._state[:3] = (pose.x_m, pose.y_m, pose.yaw_rad)
        self._covariance = np.zeros((_REFERENCE.stop, _REFERENCE.stop))
        self._covariance[:STATES, :STATES] = initial_covariance(config)
        self._within = self._covariance.copy()
        self._best = self._covariance.copy()
        self.offset: Matrix = np.zeros((2, 2))
        """(2, 2) covariance of the position in square metres that has to be added to the one by
        motion for its growth to be that of the position relative to where it was."""
        self.moved: Matrix = np.zeros((2, 2))
        """(2, 2) covariance of what the position was moved by so far, otherwise than odometry has
        told."""
        self.refer()

    @property
    def pose(self) -> Pose2:
        """T_map_base."""
        x, y, yaw = (float(value) for value in self._state[:3])
        return Pose2(x_m=x, y_m=y, yaw_rad=yaw)

    @property
    def covariance(self) -> Matrix:
        """(3, 3) covariance of the pose, in map axes."""
        return np.asarray(self._best[:3, :3] + LEAST)

    @property
    def relative(self) -> Matrix:
        """(3, 3) covariance whose growth since an earlier pose bounds that of the pose relative to
        where it was then, in map axes: a fix makes the pose more certain in the map alone."""
        relative = self.covariance
        relative[:2, :2] += self.offset
        return relative

    @property
    def covariance_by_motion(self) -> Matrix:
        """(3, 3) covariance of the pose without what the robot's own new map tells, in map axes."""
        return np.asarray(self._covariance[:3, :3] + LEAST)

    @property
    def covariance_but_scale(self) -> Matrix:
        """(3, 3) covariance of the pose if the scale of lengths were known, in map axes."""
        by_scale = self._by_scale()[:3]
        shared = by_scale @ self._best[np.ix_(_SCALES, _SCALES)] @ by_scale.T
        return np.asarray(self._best[:3, :3] - shared + LEAST)

    @property
    def covariance_within(self) -> Matrix:
        """(3, 3) covariance of the pose within the robot's own new map, in map axes."""
        return np.asarray(self._within[:3, :3] + LEAST)

    @property
    def constant_errors(self) -> ConstantErrors:
        """Constant errors of odometry as far as they are known."""
        return ConstantErrors(
            mean=self._state[ERRORS].copy(),
            covariance=self._covariance[ERRORS, ERRORS] + _LEAST_ERRORS,
        )

    @property
    def motion(self) -> Pose2:
        """T_reference_base as scans would measure it."""
        x, y, yaw = (float(value) for value in self._state[_REFERENCE])
        moved = Pose2(x_m=x, y_m=y, yaw_rad=yaw).inverse() @ self.pose
        scale = 1.0 + float(self._state[SCAN_SCALE])
        return Pose2(x_m=scale * moved.x_m, y_m=scale * moved.y_m, yaw_rad=moved.yaw_rad)

    @property
    def motion_covariance(self) -> Matrix:
        """(3, 3) covariance of `motion` by odometry, along the axes of the reference."""
        rows = self._motion_by_state()
        return np.asarray(rows @ self._covariance @ rows.T + LEAST)

    def refer(self) -> None:
        """Make the present pose the reference."""
        copy = np.eye(len(self._state))
        copy[_REFERENCE] = copy[:3]
        self._state = copy @ self._state
        self._turn(copy)

    def predict(self, step: OdometryStep) -> None:
        """Move by a step of odometry. At standstill the turn that the gyro reports is its bias."""
        before = self._state
        self._state, self._covariance = predict(before, self._covariance, step, self._config)
        _, self._within = predict(before, self._within, step, self._config)
        _, self._best = predict(before, self._best, step, self._config)
        if step.is_standing(self._config) and step.duration_s <= _LEARNT_S:
            bias = np.zeros((1, len(before)))
            bias[0, GYRO_BIAS] = 1.0
            known = step.duration_s / (math.radians(self._config.gyro_noise_deg) ** 2 + 1e-18)
            residual = step.turn_rad / step.duration_s - before[GYRO_BIAS]
            self._learn(np.array([known * residual]), bias, np.array([[known]]))

    def place(self, pose: Pose2, covariance: Matrix, *, with_map: bool = False) -> None:
        """Set the pose, which is the reference as well; what was learnt about odometry stays.
        `with_map`: the map is as certain as the pose."""
        before = self._covariance
        away = np.array([pose.x_m - self.pose.x_m, pose.y_m - self.pose.y_m])
        self._state[:3] = (pose.x_m, pose.y_m, pose.yaw_rad)
        spread = self._covariance.copy()
        spread[:3], spread[:, :3] = 0.0, 0.0
        spread[:3, :3] = covariance
        self._covariance = self._within = self._best = spread
        shrunk, jump = growth(before[:2, :2], spread[:2, :2]), np.outer(away, away)
        if with_map:
            self.offset = self.offset + shrunk
        else:
            self.offset = self.offset + 2.0 * shrunk + jump
            self.moved = self.moved + shrunk + jump
        self.refer()

    def _note_correction(self, before: Matrix) -> None:
        """Note that an absolute measurement has moved the pose, by the covariance of before."""
        shrunk = growth(before[:2, :2], self._covariance[:2, :2])
        self.offset, self.moved = self.offset + 2.0 * shrunk, self.moved + shrunk

    def move(self, motion: Pose2) -> None:
        """Move rigidly with the map: T_new_old; the pose is the reference then."""
        pose = motion @ self.pose
        turn = np.eye(len(self._state))
        cos, sin = math.cos(motion.yaw_rad), math.sin(motion.yaw_rad)
        turn[:2, :2] = ((cos, -sin), (sin, cos))
        self._state[:3] = (pose.x_m, pose.y_m, pose.yaw_rad)
        self._turn(turn)
        self.refer()

    def push(self, motion: Pose2, covariance: Matrix) -> None:
        """Move by what odometry does not tell: `motion` is T_before_after, with its (3, 3)
        covariance in the frame after it. The map stays; the pose is the reference then."""
        before, after = self.pose, self.pose @ motion
        swing = np.eye(len(self._state))
        swing[:2, YAW] = before.y_m - after.y_m, after.x_m - before.x_m
        self._state[:3] = (after.x_m, after.y_m, after.yaw_rad)
        self._turn(swing)
        grown = in_parent_axes(after, covariance)
        for spread in (self._covariance, self._within, self._best):
            spread[:3, :3] += grown
        self.moved = self.moved + grown[:2, :2]
        self.refer()

    def _turn(self, change: Matrix) -> None:
        """Change all covariances as a linear map of the state does."""
        self._covariance = change @ self._covariance @ change.T
        self._within = change @ self._within @ change.T
        self._best = change @ self._best @ change.T

    def fuse_match(
        self, pull: Matrix, information: Matrix, floor: Matrix, *, absolute: bool
    ) -> None:
        """Fuse a match whose expectation was the pose of this filter, with its covariance if the
        match is `absolute`, else with that within the robot's own map.

        `information` (3, 3) is that of the scan alone, `pull` (3,) the information times the
        difference of the pose that the scan tells from this filter's, and `floor` (3, 3) an error
        of the map which no number of points makes smaller.
        """
        spread = self._covariance if absolute else self._within
        before = spread[:3, :3] + LEAST
        prior = np.linalg.inv(before)
        # The floor is added to the covariance of the pose that the scan tells.
        pull = np.asarray(np.linalg.solve(np.eye(3) + information @ floor, pull), dtype=np.float64)
        weakened = np.linalg.solve(np.eye(3) + information @ floor, information)
        posterior = np.asarray(np.linalg.inv(prior + (weakened + weakened.T) / 2), dtype=np.float64)
        # What the new pose says about the other states, too.
        cross = np.linalg.solve(before, spread[:3]).T
        self._state = self._state + cross @ (posterior @ pull)
        self._state[YAW] = wrap_angle(self._state[YAW])
        spread = spread - cross @ (before - posterior) @ cross.T
        self._within = (spread + spread.T) / 2
        if absolute:
            earlier = self._covariance
            self._covariance = self._best = self._within
            self._note_correction(earlier)

    def bound(self, most: Matrix) -> None:
        """Know the pose, but for the scale of lengths, in every direction at least as well as a
        (3, 3) covariance in map axes says: that of the surfaces of the robot's own map which the
        scan fits, and of the match. How often it is repeated makes no difference."""
        variances, own = np.linalg.eigh(self.covariance_but_scale)
        sigmas = np.sqrt(np.maximum(variances, LEAST[YAW, YAW]))
        root, inverse = own * sigmas, (own / sigmas).T
        ratios, axes = np.linalg.eigh(inverse @ most @ inverse.T)
        if ratios[0] >= 1.0:
            return
        factors = np.sqrt(np.clip(ratios, 0.0, 1.0))
        shrink = root @ (axes * factors) @ axes.T @ inverse
        # Reference and pose err alike, so that the motion since stays as certain as it was.
        both = np.kron(np.eye(2), shrink)
        change = np.eye(len(self._state))
        change[np.ix_(_POSES, _POSES)] = both
        change[np.ix_(_POSES, _SCALES)] = (np.eye(6) - both) @ self._by_scale()
        self._best = change @ self._best @ change.T

    def _by_scale(self) -> Matrix:
        """Return the (6, 2) expected change of the poses with the scales."""
        scales = self._best[np.ix_(_SCALES, _SCALES)] + _LEAST_SCALES
        return np.linalg.solve(scales, self._best[np.ix_(_SCALES, _POSES)]).T

    def fuse_motion(
        self, pull: Matrix, information: Matrix, *, gate: float, only_judge: bool = False
    ) -> bool:
        """Fuse the motion since the reference as scans measured it, in axes of the reference:
        (3, 3) `information`, which may be singular, and (3,) `pull`, the information times the
        difference from the `motion` expected. Returns whether it was believed: its squared
        Mahalanobis distance must be at most `gate`. `only_judge` leaves the state as it is."""
        rows = self._motion_by_state()
        spread = rows @ self._covariance @ rows.T
        # residualᵀ · (spread + information⁻¹)⁻¹ · residual, where information may be singular
        residual = np.linalg.pinv(information) @ pull
        if residual @ np.linalg.solve(np.eye(3) + information @ spread, pull) > gate:
            return False
        if not only_judge:
            self._learn(pull, rows, information)
        return True

    def _motion_by_state(self) -> Matrix:
        """Return the (3, N) derivative of `motion` by the state."""
        x, y, yaw = self._state[_REFERENCE]
        cos, sin = math.cos(yaw), math.sin(yaw)
        scale = 1.0 + self._state[SCAN_SCALE]
        dx, dy = self._state[X] - x, self._state[Y] - y
        along, aside = cos * dx + sin * dy, cos * dy - sin * dx
        rows = np.zeros((3, len(self._state)))
        rows[:2, :2] = scale * np.array([[cos, sin], [-sin, cos]])
        rows[2, YAW] = 1.0
        rows[:, _REFERENCE] = -rows[:, :3]
        rows[:2, _REFERENCE.stop - 1] = (scale * aside, -scale * along)
        rows[:2, SCAN_SCALE] = (along, aside)
        return rows

    def _learn(self, pull: Matrix, rows: Matrix, information: Matrix) -> None:
        """Update by a measurement that tells nothing of where the map lies: (M, M) `information`,
        which may be singular, (M,) `pull`, the information times the residual, and (M, N) `rows`,
        its derivative by the state."""
        anchored = self._anchored()
        gain = anchored @ _gain(self._covariance, rows, information)
        self._state = self._state + gain @ pull
        self._state[YAW] = wrap_angle(self._state[YAW])
        self._covariance = _informed(self._covariance, gain, rows, information)
        self._best = _informed(self._best, gain, rows, information)
        gain = anchored @ _gain(self._within, rows, information)
        self._within = _informed(self._within, gain, rows, information)

    def _anchored(self) -> Matrix:
        """Return the (N, N) matrix by which a change of the state leaves the reference in place:
        the pose changes by the motion since then alone."""
        x, y = self._state[_REFERENCE][:2]
        carried = np.eye(3)
        carried[:2, YAW] = y - self._state[Y], self._state[X] - x
        anchored = np.eye(len(self._state))
        anchored[:3, _REFERENCE] = -carried
        anchored[_REFERENCE, _REFERENCE] = 0.0
        return anchored

    def fuse_position(self, residual: Matrix, rows: Matrix, covariance: Matrix) -> None:
        """Fuse a measurement of the pose: (M,) difference from the expected one, (M, 3) its
        derivatives by x, y and yaw, and its (M, M) covariance."""
        full = np.zeros((len(rows), len(self._state)))
        full[:, :3] = rows
        spread = full @ self._covariance @ full.T + covariance
        gain = np.linalg.solve(spread, full @ self._covariance).T
        self._state = self._state + gain @ residual
        self._state[YAW] = wrap_angle(self._state[YAW])
        keep = np.eye(len(self._state)) - gain @ full
        known, before = gain @ covariance @ gain.T, self._covariance
        self._covariance = self._within = keep @ self._covariance @ keep.T + known
        self._best = keep @ self._best @ keep.T + known
        self._note_correction(before)


def _gain(covariance: Matrix, rows: Matrix, information: Matrix) -> Matrix:
    """Return the best (N, M) gain on a residual that is multiplied by its (M, M) information."""
    spread = rows @ covariance @ rows.T
    return np.asarray(covariance @ rows.T @ np.linalg.inv(np.eye(len(rows)) + information @ spread))


def _informed(covariance: Matrix, gain: Matrix, rows: Matrix, information: Matrix) -> Matrix:
    """Return the covariance after an update with any gain, in the form of Joseph."""
    keep = np.eye(len(covariance)) - gain @ information @ rows
    after = keep @ covariance @ keep.T + gain @ information @ gain.T
    return np.asarray((after + after.T) / 2)
