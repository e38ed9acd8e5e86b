"""A robot of four wheels steered by their speeds: its body in the physics engine, and the driver
that makes wheel speeds of a velocity.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pybullet

from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.robot.profile import RobotProfile
from sim.models.ground import FLAT, Ground
from sim.robot.tyres import Tyres, grip

YAW_GAIN = 1.0
"""Wheel yaw rate added per missing yaw rate."""
YAW_GAIN_INTEGRAL_PER_S = 8.0
"""The same per missing angle; it takes up the slip that remains."""
LARGEST_CORRECTION_RADPS = 1.5
"""The integral part is held within this, so that a blocked robot does not spin when it comes free.
"""
COMMAND_TIMEOUT_NS = 250_000_000
"""The driver forgets a velocity after this, as the real one does."""

GRAVITY_MPS2 = 9.81


@dataclass(frozen=True, slots=True, kw_only=True)
class Chassis:
    """What the physics engine must know of a platform beyond its profile."""

    urdf: Callable[[], Path]
    """Its model; wheels turn about their y axis."""
    wheels: tuple[int, int, int, int]
    """Joints of the wheels: front left, front right, rear left, rear right."""
    wheel_radius_m: float
    """Of all four."""
    track_m: float
    """Between the middles of the left and the right wheels."""
    wheel_torque_nm: float
    """Enough to reach the profile's acceleration and to drag the wheels sideways in a turn."""
    grip_height_m: float
    """Where the tyres' forces act: near the centre of mass, so that they do not rock the body."""
    tyres: Tyres
    """How they hold the floor."""


class Driver:
    """The motor controller: forgets commands, ramps, and holds the commanded yaw rate with the
    gyro."""

    def __init__(self, period_s: float, profile: RobotProfile, chassis: Chassis) -> None:
        self._period_s, self._profile, self._chassis = period_s, profile, chassis
        self._asked, self._asked_ns = STANDSTILL, -COMMAND_TIMEOUT_NS
        self._v_mps = self._w_radps = self._integral_radps = 0.0

    def ask(self, twist: Twist, now_ns: int) -> None:
        """Take a velocity, clipped to what the platform can do; one that is no number means zero."""
        most = self._profile
        self._asked = Twist(
            v_mps=_clip(twist.v_mps, most.max_speed_mps),
            w_radps=_clip(twist.w_radps, most.max_yaw_rate_radps),
        )
        self._asked_ns = now_ns

    def wheel_speeds(self, now_ns: int, gyro_radps: float) -> tuple[float, float]:
        """(left, right) in rad/s for the next physics step."""
        asked, most = (
            self._asked if now_ns - self._asked_ns < COMMAND_TIMEOUT_NS else STANDSTILL,
            self._profile,
        )
        self._v_mps += _clip(asked.v_mps - self._v_mps, most.max_accel_mps2 * self._period_s)
        self._w_radps += _clip(
            asked.w_radps - self._w_radps, most.max_yaw_accel_radps2 * self._period_s
        )
        if self._v_mps == 0 and self._w_radps == 0:
            self._integral_radps = 0.0
            return (0.0, 0.0)
        missing = self._w_radps - gyro_radps
        grown = self._integral_radps + YAW_GAIN_INTEGRAL_PER_S * missing * self._period_s
        self._integral_radps = _clip(grown, LARGEST_CORRECTION_RADPS)
        turn = (
            (self._w_radps + YAW_GAIN * missing + self._integral_radps) * self._chassis.track_m / 2
        )
        return (
            (self._v_mps - turn) / self._chassis.wheel_radius_m,
            (self._v_mps + turn) / self._chassis.wheel_radius_m,
        )


class SkidSteer:
    """The robot's body in the physics engine."""

    def __init__(self, client: int, start: Pose2, chassis: Chassis, ground: Ground = FLAT) -> None:
        self._client, self._chassis, self._ground = client, chassis, ground
        turn = pybullet.getQuaternionFromEuler(ground.attitude(start))
        place = [start.x_m, start.y_m, ground.height_m(start.x_m, start.y_m)]
        self.body: int = pybullet.loadURDF(str(chassis.urdf()), place, turn, physicsClientId=client)
        parts = range(-1, pybullet.getNumJoints(self.body, physicsClientId=client))
        self._weight_n = GRAVITY_MPS2 * sum(
            pybullet.getDynamicsInfo(self.body, i, physicsClientId=client)[0] for i in parts
        )
        for wheel in chassis.wheels:
            # The tyre model is what holds the wheels to the floor, see `sim.tyres`.
            pybullet.changeDynamics(self.body, wheel, lateralFriction=0.0, physicsClientId=client)

    def drive(self, left_radps: float, right_radps: float) -> None:
        """Set the motors, and let the tyres grip, for the next physics step."""
        pybullet.setJointMotorControlArray(
            self.body,
            self._chassis.wheels,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[left_radps, right_radps, left_radps, right_radps],
            forces=[self._chassis.wheel_torque_nm] * 4,
            physicsClientId=self._client,
        )
        pose, speeds, track_m = self.pose(), self._wheels(1), self._chassis.track_m
        motion = self._motion(pose)
        ahead, left = self._ground.rise(pose)
        uphill = (self._weight_n / 2 * ahead, self._weight_n / 2 * left)
        for side, force in zip(
            (1, -1), grip(motion, *speeds, track_m, self._chassis.tyres, uphill), strict=True
        ):
            self._push(pose, force, side * track_m / 2)

    def rolled_m(self) -> tuple[float, float]:
        """(left, right) way that the wheels of each side have rolled since ever."""
        return self._wheels(0)

    def pose(self) -> Pose2:
        """T_map_base, true."""
        (x, y, _), (qx, qy, qz, qw) = pybullet.getBasePositionAndOrientation(
            self.body, physicsClientId=self._client
        )
        return Pose2(
            x_m=x, y_m=y, yaw_rad=math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
        )

    def velocity(self, pose: Pose2) -> Twist:
        """True velocity along the robot's heading, and about z."""
        along, _, yaw_rate = self._motion(pose)
        return Twist(v_mps=along, w_radps=yaw_rate)

    def rolling(self) -> Twist:
        """Velocity that the wheels roll with: none while they are held, even if somebody pushes the
        robot."""
        left, right = self._wheels(1)
        return Twist(v_mps=(left + right) / 2, w_radps=(right - left) / self._chassis.track_m)

    def _motion(self, pose: Pose2) -> tuple[float, float, float]:
        """Speed forward, speed to the left, yaw rate."""
        (vx, vy, _), (_, _, yaw_rate) = pybullet.getBaseVelocity(
            self.body, physicsClientId=self._client
        )
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        return (vx * cos + vy * sin, vy * cos - vx * sin, yaw_rate)

    def _wheels(self, which: int) -> tuple[float, float]:
        """(left, right) mean angle (`which` 0) or rate (1) of the wheels of each side, as way along
        their rim."""
        states = pybullet.getJointStates(
            self.body, self._chassis.wheels, physicsClientId=self._client
        )
        values, radius_m = [state[which] for state in states], self._chassis.wheel_radius_m
        return ((values[0] + values[2]) / 2 * radius_m, (values[1] + values[3]) / 2 * radius_m)

    def _push(self, pose: Pose2, force: tuple[float, float], left_m: float) -> None:
        """Apply a force (forward, left) of the tyres at `left_m` from the middle."""
        height_m = self._ground.height_m(pose.x_m, pose.y_m) + self._chassis.grip_height_m
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        pybullet.applyExternalForce(
            self.body,
            -1,
            [cos * force[0] - sin * force[1], sin * force[0] + cos * force[1], 0.0],
            [pose.x_m - sin * left_m, pose.y_m + cos * left_m, height_m],
            pybullet.WORLD_FRAME,
            physicsClientId=self._client,
        )


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value)) if math.isfinite(value) else 0.0
