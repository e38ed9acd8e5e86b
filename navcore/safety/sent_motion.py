"""Where the robot has driven since an image, by the velocities that were sent: what the safety gate
predicts begins where the robot is, not where the camera saw it last."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.config.safety import DEFAULT_SAFETY, GateConfig
from navcore.geometry.kinematics import arc_position
from navcore.geometry.transform import IDENTITY, STANDSTILL, Pose2, Twist
from navcore.robot.driver import Command

LINK_NS = 30_000_000
"""Time from sending a velocity to the wheels, nanoseconds."""
_DEFAULT = DEFAULT_SAFETY.gate


@dataclass(frozen=True, slots=True)
class SentMotion:
    """Velocities sent over the life of an image: a value with its transition, one for each command.

    Each holds until the next one is sent or it expires in the driver.
    """

    commands: tuple[Command, ...] = ()
    """What was sent, dated when it was, the oldest first."""

    @property
    def twist(self) -> Twist:
        """Velocity that was sent last; a standstill before the first."""
        return self.commands[-1].twist if self.commands else STANDSTILL

    def after(self, twist: Twist, now_ns: int, config: GateConfig = _DEFAULT) -> SentMotion:
        """Return the motion after one more velocity, which is sent now; what ended before the
        oldest image that the gate drives by is forgotten, and what a clock that was set back has
        dated later than now."""
        oldest_ns = now_ns - config.frame_life_ns - config.command_life_ns - LINK_NS
        kept = [one for one in self.commands if oldest_ns <= one.stamp_ns <= now_ns]
        return SentMotion((*kept, Command(twist=twist, stamp_ns=now_ns)))

    def since(self, then_ns: int, now_ns: int, config: GateConfig = _DEFAULT) -> Pose2:
        """Return T_then_now of the base frame, from a time in nanoseconds until the wheels get what
        is sent now."""
        pose = IDENTITY
        ends_ns = [*(one.stamp_ns for one in self.commands[1:]), now_ns]
        for command, end_ns in zip(self.commands, ends_ns[: len(self.commands)], strict=True):
            end_ns = min(end_ns, command.stamp_ns + config.command_life_ns, now_ns)
            time_s = (end_ns - max(command.stamp_ns, then_ns - LINK_NS)) / 1e9
            if time_s > 0.0:
                v_mps, w_radps = float(command.twist.v_mps), float(command.twist.w_radps)
                x_m, y_m = arc_position(v_mps, w_radps, time_s)
                pose = pose @ Pose2(x_m=x_m, y_m=y_m, yaw_rad=w_radps * time_s)
        return pose
