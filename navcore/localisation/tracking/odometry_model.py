"""Growth of uncertainty by odometry: noise that grows with distance, turn and time, and the errors
that stay the same for minutes, which are part of the state: bias and scale of the gyro, scale of
lengths. So uncertainty grows in proportion to the distance, and a robot that is located, or that
measures its motion by scans, learns them. What scans measure has an error of scale of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navcore.config.localisation import DEGPH, OdometryConfig
from navcore.geometry.transform import Matrix, Pose2, wrap_angle

X, Y, YAW, GYRO_BIAS, LENGTH_SCALE, GYRO_SCALE, SCAN_SCALE = range(7)
"""Elements of the state: pose in metres and radians, bias in rad/s, relative errors."""
STATES = 7
"""Number of elements."""
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

    def is_standing(self, config: OdometryConfig = _DEFAULT) -> bool:
        """Return whether the robot stood, as far as odometry can tell."""
        return (
            self.duration_s > 0.0
            and self.distance_m <= config.standing_mps * self.duration_s
            and abs(self.turn_rad) <= config.standing_radps * self.duration_s
        )


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
    module stay as they are.

    At standstill the turn that the gyro reports is its bias, and the pose stays.
    """
    if step.is_standing(config):
        return _at_standstill(state, covariance, step, config)
    length, gyro = 1.0 - state[LENGTH_SCALE], 1.0 - state[GYRO_SCALE]
    turn = gyro * step.turn_rad - state[GYRO_BIAS] * step.duration_s
    heading = state[YAW] + turn / 2
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
    grown = jacobian @ covariance @ jacobian.T
    grown[:3, :3] += _noise(step, cos, sin, config)
    grown[GYRO_BIAS, GYRO_BIAS] += _bias_growth(step, config)
    return after, (grown + grown.T) / 2


def edge_covariance(
    covariance: Matrix, distance_m: float, config: OdometryConfig = _DEFAULT
) -> Matrix:
    """Return the (3, 3) covariance of an odometry edge for the pose graph.

    `covariance` is the (3, 3) of the relative pose and `distance_m` its length. A graph adds the
    variances of edges, while the errors of scale and bias add up themselves: an edge takes its
    share of what they make over `correlated_m`.
    """
    distance = max(distance_m, 0.01)
    return np.asarray(covariance * math.sqrt(max(config.correlated_m / distance, 1.0)))


def _at_standstill(
    state: Matrix, covariance: Matrix, step: OdometryStep, config: OdometryConfig
) -> tuple[Matrix, Matrix]:
    grown = covariance.copy()
    grown[GYRO_BIAS, GYRO_BIAS] += _bias_growth(step, config)
    variance = math.radians(config.gyro_noise_deg) ** 2 / step.duration_s
    gain = grown[:, GYRO_BIAS] / (grown[GYRO_BIAS, GYRO_BIAS] + variance + 1e-18)
    after = state + gain * (step.turn_rad / step.duration_s - state[GYRO_BIAS])
    after[YAW] = wrap_angle(after[YAW])
    grown = grown - np.outer(gain, grown[GYRO_BIAS])
    return after, (grown + grown.T) / 2


def _noise(step: OdometryStep, cos: float, sin: float, config: OdometryConfig) -> Matrix:
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
