"""A skid-steered robot of four wheels: its body in the physics engine, and the motor controller
that turns a velocity into wheel speeds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.robot.profile import RobotProfile
from sim.bullet import pybullet
from sim.models.ground import FLAT, Ground
from sim.robot.tyres import Tyres, tyre_forces

YAW_GAIN = 1.0
"""Proportional gain of the yaw controller: rad/s of wheel yaw rate per rad/s of yaw rate error."""
YAW_GAIN_INTEGRAL_PER_S = 8.0
"""Integral gain of the yaw controller; it compensates the remaining slip."""
LARGEST_CORRECTION_RADPS = 1.5
"""Bound of the integral part, so that a blocked robot does not spin when it comes free."""
COMMAND_TIMEOUT_NS = 250_000_000
"""Age at which a commanded velocity expires, as on the real robot."""

GRAVITY_MPS2 = 9.81

_OTHER, _FORCE = 2, 9
"""Elements of a contact point of the engine: the other body, and the force between both."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chassis:
    """The properties of a platform that the physics engine needs beyond its profile."""

    urdf: Callable[[], Path]
    """Function that returns the URDF file; wheels turn about their y axis."""
    wheels: tuple[int, int, int, int]
    """Joints of the wheels: front left, front right, rear left, rear right."""
    wheel_radius_m: float
    """Radius of all four wheels."""
    track_m: float
    """Distance between the middles of the left and the right wheels."""
    foot_m: float
    """Distance of the wheels from the middle of the body, mean of that along x and along y: where
    the height of the ground counts."""
    wheel_torque_nm: float
    """Largest motor torque of a wheel: enough for the acceleration of the profile and for dragging
    the wheels sideways in a turn."""
    grip_height_m: float
    """Height at which the tyre forces act: near the centre of mass, so that they do not rock the
    body."""
    tyres: Tyres
    """Tyre model."""


class Driver:
    """The motor controller: lets commands expire, limits acceleration, and holds the commanded yaw
    rate with the gyro."""

    def __init__(self, period_s: float, profile: RobotProfile, chassis: Chassis) -> None:
        self._period_s, self._profile, self._chassis = period_s, profile, chassis
        self._commanded, self._commanded_ns = STANDSTILL, -COMMAND_TIMEOUT_NS
        self._v_mps = self._w_radps = self._integral_radps = 0.0

    def command(self, twist: Twist, now_ns: int) -> None:
        """Accept a velocity, clipped to the limits of the platform; a component that is not finite
        counts as zero."""
        limits = self._profile
        self._commanded = Twist(
            v_mps=_clip(twist.v_mps, limits.max_speed_mps),
            w_radps=_clip(twist.w_radps, limits.max_yaw_rate_radps),
        )
        self._commanded_ns = now_ns

    def wheel_speeds(self, now_ns: int, gyro_radps: float) -> tuple[float, float]:
        """Return the (left, right) wheel speeds in rad/s for the next physics step."""
        target, limits = (
            self._commanded if now_ns - self._commanded_ns < COMMAND_TIMEOUT_NS else STANDSTILL,
            self._profile,
        )
        self._v_mps += _clip(target.v_mps - self._v_mps, limits.max_accel_mps2 * self._period_s)
        self._w_radps += _clip(
            target.w_radps - self._w_radps, limits.max_yaw_accel_radps2 * self._period_s
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
        position = [start.x_m, start.y_m, ground.standing_m(start)]
        self.body: int = pybullet.loadURDF(
            str(chassis.urdf()), position, turn, physicsClientId=client
        )
        parts = range(-1, pybullet.getNumJoints(self.body, physicsClientId=client))
        self._weight_n = GRAVITY_MPS2 * sum(
            pybullet.getDynamicsInfo(self.body, i, physicsClientId=client)[0] for i in parts
        )
        self.gradient = ground.gradient(start)
        """Slope of the ground ahead and to the left at the last step, rise per metre."""
        for wheel in chassis.wheels:
            # The tyre model holds the wheels to the floor instead, see `sim.robot.tyres`.
            pybullet.changeDynamics(self.body, wheel, lateralFriction=0.0, physicsClientId=client)

    def drive(self, left_radps: float, right_radps: float, pose: Pose2) -> None:
        """Set the motor speeds and apply the tyre forces for the next physics step; `pose` is the
        present one."""
        pybullet.setJointMotorControlArray(
            self.body,
            self._chassis.wheels,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[left_radps, right_radps, left_radps, right_radps],
            forces=[self._chassis.wheel_torque_nm] * 4,
            physicsClientId=self._client,
        )
        speeds, track_m = self._wheel_states(1), self._chassis.track_m
        motion = self._motion(pose)
        ahead, left = self.gradient = self._ground.gradient(pose)
        uphill = (self._weight_n / 2 * ahead, self._weight_n / 2 * left)
        for side, force in zip(
            (1, -1), tyre_forces(motion, *speeds, track_m, self._chassis.tyres, uphill), strict=True
        ):
            self._apply_force(pose, force, side * track_m / 2)

    def put(self, pose: Pose2) -> None:
        """Move the body to another pose, as high above the ground as now, and stop it; the wheels
        keep their angles."""
        here = self.pose()
        (_, _, z_m), _ = pybullet.getBasePositionAndOrientation(
            self.body, physicsClientId=self._client
        )
        above_m = z_m - self._ground.standing_m(here)
        pybullet.resetBasePositionAndOrientation(
            self.body,
            [pose.x_m, pose.y_m, self._ground.standing_m(pose) + above_m],
            pybullet.getQuaternionFromEuler(self._ground.attitude(pose)),
            physicsClientId=self._client,
        )
        pybullet.resetBaseVelocity(
            self.body, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], physicsClientId=self._client
        )

    def rolled_m(self) -> tuple[float, float]:
        """Return the (left, right) distance in metres that the wheels of each side have rolled
        since the start."""
        return self._wheel_states(0)

    def pose(self) -> Pose2:
        """Return the true T_map_base."""
        return pose_of(self._client, self.body)

    def tilt_rad(self) -> float:
        """Return the angle between the upright axis of the body and the vertical."""
        _, (x, y, _, _) = pybullet.getBasePositionAndOrientation(
            self.body, physicsClientId=self._client
        )
        return math.acos(max(-1.0, 1 - 2 * (x * x + y * y)))

    def velocity(self, pose: Pose2) -> Twist:
        """Return the true velocity along the heading of the robot, and about z."""
        along, _, yaw_rate = self._motion(pose)
        return Twist(v_mps=along, w_radps=yaw_rate)

    def rolling(self) -> Twist:
        """Return the velocity at which the wheels roll: zero while they are held, even if a person
        pushes the robot."""
        left, right = self._wheel_states(1)
        return Twist(v_mps=(left + right) / 2, w_radps=(right - left) / self._chassis.track_m)

    def pushed(self) -> set[int]:
        """Return the numbers of the bodies that the robot pushes, or drives over."""
        contacts = pybullet.getContactPoints(self.body, physicsClientId=self._client)
        # The engine keeps points up to 2 cm apart, without a force.
        return {contact[_OTHER] for contact in contacts if contact[_FORCE] > 0.0}

    def _motion(self, pose: Pose2) -> tuple[float, float, float]:
        """Return speed forward, speed to the left, and yaw rate."""
        (vx, vy, _), (_, _, yaw_rate) = pybullet.getBaseVelocity(
            self.body, physicsClientId=self._client
        )
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        return (vx * cos + vy * sin, vy * cos - vx * sin, yaw_rate)

    def _wheel_states(self, which: int) -> tuple[float, float]:
        """Return the (left, right) mean joint angle (`which` 0) or rate (1) of the wheels of each
        side, as distance along their rim."""
        states = pybullet.getJointStates(
            self.body, self._chassis.wheels, physicsClientId=self._client
        )
        values, radius_m = [state[which] for state in states], self._chassis.wheel_radius_m
        return ((values[0] + values[2]) / 2 * radius_m, (values[1] + values[3]) / 2 * radius_m)

    def _apply_force(self, pose: Pose2, force: tuple[float, float], left_m: float) -> None:
        """Apply a tyre force (forward, left) in newtons at `left_m` from the middle."""
        height_m = self._ground.standing_m(pose) + self._chassis.grip_height_m
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        pybullet.applyExternalForce(
            self.body,
            -1,
            [cos * force[0] - sin * force[1], sin * force[0] + cos * force[1], 0.0],
            [pose.x_m - sin * left_m, pose.y_m + cos * left_m, height_m],
            pybullet.WORLD_FRAME,
            physicsClientId=self._client,
        )


def pose_of(client: int, body: int) -> Pose2:
    """Return the true T_map_body in the plane of a body in the physics engine."""
    (x_m, y_m, _), (x, y, z, w) = pybullet.getBasePositionAndOrientation(
        body, physicsClientId=client
    )
    yaw_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value)) if math.isfinite(value) else 0.0
