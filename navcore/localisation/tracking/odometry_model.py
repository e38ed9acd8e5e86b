"""Growth of uncertainty by odometry: noise that grows with distance, turn and time, and the errors
that stay the same for minutes, which are part of the state: bias and scale of the gyro, scale of
lengths. So uncertainty grows in proportion to the distance, and a robot that is located, or that
measures its motion by scans, learns them. What scans measure has an error of scale of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navcore.config.localisation.localisation import DEGPH, OdometryConfig
from navcore.geometry.arrays import Floats
from navcore.geometry.transform import IDENTITY, Matrix, Pose2, wrap_angle
from navcore.localisation.graph.edges import in_parent_axes

X, Y, YAW, GYRO_BIAS, LENGTH_SCALE, GYRO_SCALE, SCAN_SCALE = range(7)
"""Elements of the state: pose in metres and radians, bias in rad/s, relative errors."""
STATES = 7
"""Number of elements."""
ERRORS = slice(GYRO_BIAS, SCAN_SCALE)
"""Elements that are the constant errors of odometry."""
LEAST = np.diag([1e-4, 1e-4, 1e-5]) ** 2
"""Least (3, 3) covariance of a pose or a motion, so that it can be inverted."""
FRAME_LIFE_S = 0.5
"""Longest time in seconds before a frame that it may tell of: of a longer gap, as while the lens
was covered, it shows the end alone."""
_DEFAULT = OdometryConfig()


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryStep:
    """What odometry measured between two frames."""

    along_m: float
    """Distance forwards in metres, along the mean of the two headings."""
    aside_m: float
    """Distance to the left in metres."""
    turn_rad: float
    """Turn in radians."""
    duration_s: float
    """Time between the frames in seconds."""

    @classmethod
    def between(
        cls, before: Pose2, after: Pose2, duration_s: float, *, pitch_rad: float = 0.0
    ) -> OdometryStep:
        """Return the step from one pose in odometry's frame to another; wheels measure distance
        along a slope, of which the pitch leaves the horizontal part."""
        move = before.inverse() @ after
        cos, sin = math.cos(move.yaw_rad / 2), math.sin(move.yaw_rad / 2)
        return cls(
            along_m=math.cos(pitch_rad) * (cos * move.x_m + sin * move.y_m),
            aside_m=-sin * move.x_m + cos * move.y_m,
            turn_rad=move.yaw_rad,
            duration_s=max(duration_s, 0.0),
        )

    @property
    def distance_m(self) -> float:
        """Distance in metres."""
        return math.hypot(self.along_m, self.aside_m)

    @property
    def seen_s(self) -> float:
        """The part of the duration in seconds that the frame after the step may tell of."""
        return min(self.duration_s, FRAME_LIFE_S)

    @property
    def seen_m(self) -> float:
        """The same of its distance in metres."""
        return self.distance_m * self.seen_s / self.duration_s if self.duration_s else 0.0

    def is_standing(self, config: OdometryConfig = _DEFAULT) -> bool:
        """Return whether the robot stood, as far as odometry can tell: a slow mean over a gap may
        be a motion that has ended."""
        return (
            self.duration_s > 0.0
            and self.distance_m <= config.standing_mps * self.seen_s
            and abs(self.turn_rad) <= config.standing_radps * self.seen_s
        )


class DrivenOdometry:
    """Odometry that stays while the robot stands, as its pose in the map does: the gyro drifts on,
    by a degree in less than a minute."""

    def __init__(self, config: OdometryConfig = _DEFAULT) -> None:
        self._config = config
        self._last: tuple[Pose2, int] | None = None
        self.pose = IDENTITY
        """T_driven_base at the newest frame; the first has it where odometry has it."""
        self.travel: Floats = np.zeros(3)
        """What was driven so far, as `travel_of` a step tells it, (3,)."""

    def follow(self, T_odom_base: Pose2, stamp_ns: int) -> None:
        """Go on to a frame's pose by odometry; without a motion if the robot stood."""
        if self._last is None:
            self.pose = T_odom_base
        else:
            before, then_ns = self._last
            step = OdometryStep.between(before, T_odom_base, (stamp_ns - then_ns) / 1e9)
            if not step.is_standing(self._config):
                self.pose = self.pose @ before.inverse() @ T_odom_base
                self.travel = self.travel + travel_of(step, self._config)
        self._last = T_odom_base, stamp_ns


def initial_covariance(config: OdometryConfig = _DEFAULT) -> Matrix:
    """Return the (7, 7) covariance of a state whose pose is exact."""
    return np.diag(
        [
            0.0,
            0.0,
            0.0,
            (config.gyro_bias_degph * DEGPH) ** 2,
            config.length_scale**2,
            config.gyro_scale**2,
            config.length_floor**2,
        ]
    )


def predict(
    state: Matrix, covariance: Matrix, step: OdometryStep, config: OdometryConfig = _DEFAULT
) -> tuple[Matrix, Matrix]:
    """Return the (N,) state and its (N, N) covariance after a step; elements beyond those of this
    module stay as they are. At standstill the pose stays.
    """
    grown = covariance.copy()
    grown[GYRO_BIAS, GYRO_BIAS] += _bias_growth(step, config)
    if step.is_standing(config):
        return state, grown
    after, jacobian = _moved(state, step)
    grown = jacobian @ grown @ jacobian.T
    grown[:3, :3] += _noise(step, _mean_heading(state, step), config)
    return after, (grown + grown.T) / 2


class OdometryMotion:
    """A motion by odometry, with the noise of its measurement and its derivative by the constant
    errors, which are taken to be zero."""

    def __init__(self, pose: Pose2, config: OdometryConfig = _DEFAULT) -> None:
        """`pose`: the exact one at which it begins."""
        self._config = config
        self._state = np.zeros(STATES)
        self._state[:3] = (pose.x_m, pose.y_m, pose.yaw_rad)
        self._noise, self._by_errors = LEAST, np.zeros((3, 3))

    def advance(self, step: OdometryStep) -> None:
        """Go on by a step. At standstill the pose stays."""
        if step.is_standing(self._config):
            return
        noise = _noise(step, _mean_heading(self._state, step), self._config)
        self._state, jacobian = _moved(self._state, step)
        by_pose = jacobian[:3, :3]
        self._noise = by_pose @ self._noise @ by_pose.T + noise
        self._by_errors = by_pose @ self._by_errors + jacobian[:3, ERRORS]

    def push(self, motion: Pose2, covariance: Matrix) -> None:
        """Go on by a motion without odometry, T_before_after, with its (3, 3) covariance in the
        frame after it."""
        x, y, yaw = self._state[:3].tolist()
        after = Pose2(x_m=x, y_m=y, yaw_rad=yaw) @ motion
        swing = np.eye(3)
        swing[:2, YAW] = y - after.y_m, after.x_m - x
        self._state[:3] = (after.x_m, after.y_m, after.yaw_rad)
        self._noise = swing @ self._noise @ swing.T + in_parent_axes(after, covariance)
        self._by_errors = swing @ self._by_errors

    def to(self, offset: Pose2) -> tuple[Pose2, Matrix, Matrix]:
        """Return the pose of the frame in which the robot is at `offset`, the (3, 3) covariance of
        the noise there, and the (3, 3) derivative by the constant errors, both along its axes."""
        x, y, yaw = self._state[:3].tolist()
        pose = Pose2(x_m=x, y_m=y, yaw_rad=yaw) @ offset.inverse()
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        swing = np.eye(3)
        swing[:2, YAW] = y - pose.y_m, pose.x_m - x
        into = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ swing
        return pose, into @ self._noise @ into.T, into @ self._by_errors


def travel_of(step: OdometryStep, config: OdometryConfig = _DEFAULT) -> Floats:
    """Return distance in metres, turn in radians and duration in seconds of a step, (3,); the sum
    over steps is a travel. Zero at standstill."""
    if step.is_standing(config):
        return np.zeros(3)
    return np.array([step.distance_m, abs(step.turn_rad), step.duration_s])


def travel_variance(travel: Floats, away_m: Floats, config: OdometryConfig = _DEFAULT) -> Floats:
    """Return bounds of the variance, in any direction, of the position relative to the robot of
    what was last seen before a travel and is away now; (N,) in square metres.

    Noise adds up its variances, constant errors themselves; an error of heading swings all of the
    distance. `travel` is (N, 3), `away_m` (N,) in metres.
    """
    distance_m, turn_rad, _ = travel.T
    slip = config.slip_m**2 * distance_m + config.turn_slip_m**2 * turn_rad
    scale = (config.length_scale * distance_m) ** 2
    swing = _heading_variance(travel, config) * (distance_m + away_m) ** 2
    return np.asarray(slip + scale + swing)


def travel_covariance(travel: Floats, config: OdometryConfig = _DEFAULT) -> Matrix:
    """Return a bound of the (3, 3) covariance by which a (3,) travel makes a pose more uncertain,
    wherever it has led: x and y in metres, yaw in radians."""
    position = float(travel_variance(travel[None], np.zeros(1), config)[0])
    return np.diag([position, position, float(_heading_variance(travel, config))])


def _heading_variance(travel: Floats, config: OdometryConfig) -> Floats:
    """Return the variance of the heading after travels (..., 3) in square radians."""
    _, turn_rad, duration_s = travel.T
    noise = math.radians(config.gyro_noise_deg) ** 2 * duration_s
    bias = (config.gyro_bias_degph * DEGPH * duration_s) ** 2
    return np.asarray(noise + bias + (config.gyro_scale * turn_rad) ** 2)


def _turn(state: Matrix, step: OdometryStep) -> float:
    """Return the turn of a step in radians without the constant errors."""
    return float((1.0 - state[GYRO_SCALE]) * step.turn_rad - state[GYRO_BIAS] * step.duration_s)


def _mean_heading(state: Matrix, step: OdometryStep) -> float:
    """Return the heading in radians in the middle of a step."""
    return float(state[YAW]) + _turn(state, step) / 2


def _moved(state: Matrix, step: OdometryStep) -> tuple[Matrix, Matrix]:
    """Return the (N,) state after a step and its (N, N) derivative by the state before."""
    length, turn, heading = (
        1.0 - state[LENGTH_SCALE],
        _turn(state, step),
        _mean_heading(state, step),
    )
    cos, sin = math.cos(heading), math.sin(heading)
    along, aside = length * step.along_m, length * step.aside_m
    dx, dy = cos * along - sin * aside, sin * along + cos * aside
    after = state.copy()
    after[:3] += (dx, dy, turn)
    after[YAW] = wrap_angle(after[YAW])
    jacobian = np.eye(len(state))
    jacobian[X, YAW], jacobian[Y, YAW] = -dy, dx
    for element, by_turn in ((GYRO_BIAS, -step.duration_s), (GYRO_SCALE, -step.turn_rad)):
        jacobian[YAW, element] = by_turn
        jacobian[X, element], jacobian[Y, element] = -dy * by_turn / 2, dx * by_turn / 2
    jacobian[X, LENGTH_SCALE] = -(cos * step.along_m - sin * step.aside_m)
    jacobian[Y, LENGTH_SCALE] = -(sin * step.along_m + cos * step.aside_m)
    return after, jacobian


def _noise(step: OdometryStep, heading_rad: float, config: OdometryConfig) -> Matrix:
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    by_turn = config.turn_slip_m**2 * abs(step.turn_rad)
    along = config.slip_m**2 * step.distance_m + by_turn
    aside = config.aside_m**2 * step.distance_m + by_turn
    yaw = math.radians(config.gyro_noise_deg) ** 2 * step.duration_s
    cross = cos * sin * (along - aside)
    return np.array(
        [
            [cos * cos * along + sin * sin * aside, cross, 0.0],
            [cross, sin * sin * along + cos * cos * aside, 0.0],
            [0.0, 0.0, yaw],
        ]
    )


def _bias_growth(step: OdometryStep, config: OdometryConfig) -> float:
    return (config.gyro_bias_drift_degph * DEGPH) ** 2 / 3600 * step.duration_s
