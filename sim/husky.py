"""The Husky A200: PyBullet's model of it, its wheels, and the driver that turns a velocity into wheel speeds."""

from __future__ import annotations

import hashlib
import math
import os
import re
import tempfile
from functools import cache
from pathlib import Path

import pybullet
import pybullet_data

from navcore.robot import HUSKY, STANDSTILL, Twist
from navcore.transform import Pose2
from sim.tyres import grip

WHEELS = (2, 3, 4, 5)
"""Joints of the wheels: front left, front right, rear left, rear right."""
WHEEL_RADIUS_M = 0.17775
TRACK_M = 0.5708
WHEEL_TORQUE_NM = 60.0
"""Enough to reach 3 m/s² and to drag the wheels sideways in a turn."""
GRIP_HEIGHT_M = 0.2
"""Where the tyres' forces act: near the centre of mass, so that they do not rock the body."""
YAW_GAIN = 1.0
"""Wheel yaw rate added per missing yaw rate."""
YAW_GAIN_INTEGRAL_PER_S = 8.0
"""The same per missing angle; it takes up the slip that remains."""
LARGEST_CORRECTION_RADPS = 1.5
"""The integral part is held within this, so that a blocked robot does not spin when it comes free."""
COMMAND_TIMEOUT_NS = 250_000_000
"""The driver forgets a velocity after this, as the real one does."""


@cache
def husky_urdf() -> Path:
    """A copy of PyBullet's husky.urdf that any URDF reader loads: no ROS substitutions, absolute mesh paths, and a
    mass for every link. It lies in the system's folder for temporary files under a name made from its content.
    """
    source = Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf"
    text = _readable(source.read_text(encoding="utf-8"), source.parent)
    path = Path(tempfile.gettempdir()) / f"bewarenav-husky-{hashlib.sha256(text.encode()).hexdigest()[:16]}.urdf"
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        handle, draft = tempfile.mkstemp(dir=path.parent, suffix=".urdf")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(draft).replace(path)  # whole or not at all: other processes may be reading it
    return path


def _readable(urdf: str, folder: Path) -> str:
    urdf = re.sub(r"\$\(optenv \w+ ([^)]*)\)", r"\1", urdf)
    urdf = urdf.replace('filename="meshes/', f'filename="{folder.as_posix()}/meshes/')
    urdf = re.sub(r"<gazebo.*?</gazebo>", "", urdf, flags=re.DOTALL)
    urdf = re.sub(r'<link name="(\w+)"\s*/>', r'<link name="\1"></link>', urdf)
    # Bare, it is heavier behind and turns about its rear axle; the load it carries here balances it.
    urdf = urdf.replace('xyz="-0.08748 -0.00085 0.09947"', 'xyz="0 0 0.09947"')
    light = '<inertial><mass value="0.5"/><inertia ixx="0.005" ixy="0" ixz="0" iyy="0.005" iyz="0" izz="0.005"/></inertial>'
    return re.sub(r"<link\b.*?</link>", lambda link: _with_mass(link[0], light), urdf, flags=re.DOTALL)


def _with_mass(link: str, inertial: str) -> str:
    return link if "<inertial>" in link else link.replace("</link>", inertial + "</link>")


class Driver:
    """The motor controller: forgets commands, ramps, and holds the commanded yaw rate with the gyro."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._asked, self._asked_ns = STANDSTILL, -COMMAND_TIMEOUT_NS
        self._v_mps = self._w_radps = self._integral_radps = 0.0

    def ask(self, twist: Twist, now_ns: int) -> None:
        """Take a velocity, clipped to what the platform can do; one that is no number means zero."""
        self._asked = Twist(
            v_mps=_clip(twist.v_mps, HUSKY.max_speed_mps), w_radps=_clip(twist.w_radps, HUSKY.max_yaw_rate_radps)
        )
        self._asked_ns = now_ns

    def wheel_speeds(self, now_ns: int, gyro_radps: float) -> tuple[float, float]:
        """(left, right) in rad/s for the next physics step."""
        asked = self._asked if now_ns - self._asked_ns < COMMAND_TIMEOUT_NS else STANDSTILL
        self._v_mps += _clip(asked.v_mps - self._v_mps, HUSKY.max_accel_mps2 * self._period_s)
        self._w_radps += _clip(asked.w_radps - self._w_radps, HUSKY.max_yaw_accel_radps2 * self._period_s)
        if self._v_mps == 0 and self._w_radps == 0:
            self._integral_radps = 0.0
            return (0.0, 0.0)
        missing = self._w_radps - gyro_radps
        grown = self._integral_radps + YAW_GAIN_INTEGRAL_PER_S * missing * self._period_s
        self._integral_radps = _clip(grown, LARGEST_CORRECTION_RADPS)
        turn = (self._w_radps + YAW_GAIN * missing + self._integral_radps) * TRACK_M / 2
        return ((self._v_mps - turn) / WHEEL_RADIUS_M, (self._v_mps + turn) / WHEEL_RADIUS_M)


class Husky:
    """The robot's body in the physics engine."""

    def __init__(self, client: int, start: Pose2) -> None:
        self._client = client
        turn = pybullet.getQuaternionFromEuler([0.0, 0.0, start.yaw_rad])
        self.body: int = pybullet.loadURDF(str(husky_urdf()), [start.x_m, start.y_m, 0.0], turn, physicsClientId=client)
        for wheel in WHEELS:
            # The tyre model is what holds the wheels to the floor, see `sim.tyres`.
            pybullet.changeDynamics(self.body, wheel, lateralFriction=0.0, physicsClientId=client)

    def drive(self, left_radps: float, right_radps: float) -> None:
        """Set the motors, and let the tyres grip, for the next physics step."""
        pybullet.setJointMotorControlArray(
            self.body,
            WHEELS,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[left_radps, right_radps, left_radps, right_radps],
            forces=[WHEEL_TORQUE_NM] * 4,
            physicsClientId=self._client,
        )
        pose, speeds = self.pose(), self._wheels(1)
        motion = self._motion(pose)
        for side, force in zip((1, -1), grip(motion, *speeds, TRACK_M), strict=True):
            self._push(pose, force, side * TRACK_M / 2)

    def rolled_m(self) -> tuple[float, float]:
        """(left, right) way that the wheels of each side have rolled since ever."""
        return self._wheels(0)

    def pose(self) -> Pose2:
        """T_map_base, true."""
        (x, y, _), (qx, qy, qz, qw) = pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client)
        return Pose2(x_m=x, y_m=y, yaw_rad=math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)))

    def velocity(self, pose: Pose2) -> Twist:
        """True velocity along the robot's heading, and about z."""
        along, _, yaw_rate = self._motion(pose)
        return Twist(v_mps=along, w_radps=yaw_rate)

    def rolling(self) -> Twist:
        """Velocity that the wheels roll with: none while they are held, even if somebody pushes the robot."""
        left, right = self._wheels(1)
        return Twist(v_mps=(left + right) / 2, w_radps=(right - left) / TRACK_M)

    def _motion(self, pose: Pose2) -> tuple[float, float, float]:
        """Speed forward, speed to the left, yaw rate."""
        (vx, vy, _), (_, _, yaw_rate) = pybullet.getBaseVelocity(self.body, physicsClientId=self._client)
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        return (vx * cos + vy * sin, vy * cos - vx * sin, yaw_rate)

    def _wheels(self, which: int) -> tuple[float, float]:
        """(left, right) mean angle (`which` 0) or rate (1) of the wheels of each side, as way along their rim."""
        values = [state[which] for state in pybullet.getJointStates(self.body, WHEELS, physicsClientId=self._client)]
        return ((values[0] + values[2]) / 2 * WHEEL_RADIUS_M, (values[1] + values[3]) / 2 * WHEEL_RADIUS_M)

    def _push(self, pose: Pose2, force: tuple[float, float], left_m: float) -> None:
        """Apply a force (forward, left) of the tyres at `left_m` from the middle."""
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        pybullet.applyExternalForce(
            self.body,
            -1,
            [cos * force[0] - sin * force[1], sin * force[0] + cos * force[1], 0.0],
            [pose.x_m - sin * left_m, pose.y_m + cos * left_m, GRIP_HEIGHT_M],
            pybullet.WORLD_FRAME,
            physicsClientId=self._client,
        )


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value)) if math.isfinite(value) else 0.0
