"""Plausibility of frames: stamps that advance, poses that the robot can have reached, images that
change.

A value with its transition, one for each new frame. It remembers the last frame that was plausible;
what cannot follow from it is not trusted until the sensors agree with it again, or until the
operator confirms the new pose.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from enum import StrEnum

from navcore.config.safety import DEFAULT_SAFETY, SensorMonitorConfig
from navcore.errors import BadFrame
from navcore.geometry.transform import wrap_angle
from navcore.robot.frame import Frame, check_frame
from navcore.robot.profile import RobotProfile

_DEFAULT = DEFAULT_SAFETY.sensors


class SensorFault(StrEnum):
    """Why a frame is not trusted."""

    STAMP = "stamp"
    """Dated as the one before, or just before it; the next frame may be right."""
    CLOCK = "clock"
    """Dated long before the one that preceded it: the clock was set back, or began again."""
    FUTURE = "future"
    """Dated later than the present time."""
    POSE = "pose"
    """The robot cannot have got there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Displacement:
    """A distance and a turn."""

    distance_m: float
    """Distance along the floor in metres."""
    turn_rad: float
    """Change of heading in radians."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SensorMonitor:
    """State of the sensors after some frames; as it is made, after none."""

    newest: Frame | None = None
    """Last frame; None before the first."""
    trusted: Frame | None = None
    """Last frame that was plausible and had a pose; None before the first."""
    unchanged_since_ns: int | None = None
    """Capture time in nanoseconds of the first frame with the image of the newest; None before the
    first."""
    fault: SensorFault | None = None
    """Why the newest frame is not trusted; None when it is."""
    fault_text: str = ""
    """Description of the fault for the operator, with figures; empty without one."""
    malformed: str = ""
    """What is wrong with the newest frame itself, whatever came before it; empty when nothing is.
    """
    reach: Displacement = Displacement(distance_m=0.0, turn_rad=0.0)
    """While the pose is not trusted: how far the robot can be from the trusted one by now."""
    steady: int = 0
    """Number of frames for which a pose that is not trusted has advanced without a jump."""
    depth_sample: bytes = b""
    """Some depths of the newest frame, to compare the next with."""
    rgb_sample: bytes = b""
    """Some colours of the newest frame, to compare the next with."""

    @property
    def repeats(self) -> bool:
        """Whether the newest frame shows, bit for bit, the image of an earlier one."""
        return self.newest is not None and self.newest.stamp_ns != self.unchanged_since_ns

    @property
    def awaits_reset(self) -> bool:
        """Whether a reset lets the robot go on, which may otherwise stand for long. While stamps
        begin again, as after a restart of the robot's driver, no pose is compared: odometry may
        have begun again as well."""
        return self.fault in (SensorFault.CLOCK, SensorFault.POSE)

    @property
    def newest_is_trusted(self) -> bool:
        """Whether the newest frame is plausible: well formed, with a possible stamp and pose."""
        return self.newest is not None and self.fault is None and not self.malformed

    def after(
        self,
        frame: Frame,
        profile: RobotProfile,
        config: SensorMonitorConfig = _DEFAULT,
        *,
        now_ns: int | None = None,
    ) -> SensorMonitor:
        """Return the state after one more frame; the same frame again changes nothing.

        `now_ns`: time of the robot's clock in nanoseconds, by which frames are dated. One from the
        future is not taken: all that follow would seem to be older.
        """
        if frame is self.newest:
            return self
        ahead_s = 0.0 if now_ns is None else (frame.stamp_ns - now_ns) / 1e9
        if ahead_s > config.ahead_s:
            return self._refuse_future(ahead_s)
        if self.newest is None:
            return self._trust(frame, config)
        last_ns = self.newest.stamp_ns if self.trusted is None else self.trusted.stamp_ns
        if frame.stamp_ns <= last_ns:
            return self._doubt_stamp(frame, (last_ns - frame.stamp_ns) / 1e9, config)
        if self.trusted is None or not _has_pose(frame):
            # Without a pose there is none to doubt: the frame is refused for that.
            if self.fault is not SensorFault.POSE:
                return self._trust(frame, config)
            return dataclasses.replace(self._show(frame, config), steady=0)
        if self.fault is SensorFault.POSE:
            return self._check_again(self.newest, self.trusted, frame, profile, config)
        reach = _reach(self.trusted, frame, profile, config)
        if not _jumped(self.trusted, frame, reach):
            return self._trust(frame, config)
        return dataclasses.replace(
            self._show(frame, config),
            fault=SensorFault.POSE,
            fault_text=_jump_text(self.trusted, frame, reach, config),
            reach=reach,
            steady=0,
        )

    def _show(self, frame: Frame, config: SensorMonitorConfig) -> SensorMonitor:
        """Return the state with the image of one more frame, and everything else as before."""
        depth, rgb = (
            pixels.reshape(-1)[:: config.sample_px].tobytes()
            for pixels in (frame.depth_m, frame.rgb)
        )
        same = self.newest is not None and (depth == self.depth_sample or rgb == self.rgb_sample)
        return dataclasses.replace(
            self,
            newest=frame,
            unchanged_since_ns=self.unchanged_since_ns if same else frame.stamp_ns,
            malformed=_malformed(frame),
            depth_sample=depth,
            rgb_sample=rgb,
        )

    def _trust(self, frame: Frame, config: SensorMonitorConfig) -> SensorMonitor:
        trusted = frame if _has_pose(frame) else self.trusted
        return dataclasses.replace(
            self._show(frame, config), trusted=trusted, fault=None, fault_text="", steady=0
        )

    def _refuse_future(self, ahead_s: float) -> SensorMonitor:
        """Return the state after a frame that is dated later than the present time; a pose that is
        not trusted remains the fault."""
        if self.fault is SensorFault.POSE:
            return self
        text = (
            f"The camera's clock is wrong: an image is dated {ahead_s:.3f} s in the future; the "
            "robot stands until an image is dated correctly."
        )
        return dataclasses.replace(self, fault=SensorFault.FUTURE, fault_text=text)

    def _doubt_stamp(
        self, frame: Frame, back_s: float, config: SensorMonitorConfig
    ) -> SensorMonitor:
        """Return the state after a frame that is not newer than the last; a pose that is not
        trusted remains the fault."""
        shown = dataclasses.replace(self._show(frame, config), steady=0)
        if self.fault is SensorFault.POSE:
            return shown
        is_set_back = back_s > config.max_gap_s or self.fault is SensorFault.CLOCK
        text = (
            "The camera's clock was set back: an image is dated "
            f"{back_s:.3f} s before the one that preceded it; the robot stands until it advances, "
            "or until a reset accepts it."
            if is_set_back
            else "The camera's clock does not advance: an image is dated "
            f"{back_s:.3f} s before the one that preceded it, or the same; the robot stands until "
            "it advances."
        )
        fault = SensorFault.CLOCK if is_set_back else SensorFault.STAMP
        return dataclasses.replace(shown, fault=fault, fault_text=text)

    def _check_again(
        self,
        before: Frame,
        trusted: Frame,
        frame: Frame,
        profile: RobotProfile,
        config: SensorMonitorConfig,
    ) -> SensorMonitor:
        """Return the state after one more frame while the pose is not trusted; meanwhile the robot
        has gone as far as it measured, which is nothing once it stands."""
        gap_s = _gap_s(before, frame, config)
        speed = min(max(abs(before.twist.v_mps), abs(frame.twist.v_mps)), profile.max_speed_mps)
        rate = min(
            max(abs(before.twist.w_radps), abs(frame.twist.w_radps)), profile.max_yaw_rate_radps
        )
        reach = Displacement(
            distance_m=self.reach.distance_m + config.speed_factor * speed * gap_s,
            turn_rad=self.reach.turn_rad + config.speed_factor * rate * gap_s,
        )
        jumps = not _has_pose(before) or _jumped(
            before, frame, _reach(before, frame, profile, config)
        )
        steady = 0 if jumps else self.steady + 1
        if steady >= config.steady_frames and not _jumped(trusted, frame, reach):
            return self._trust(frame, config)
        return dataclasses.replace(self._show(frame, config), reach=reach, steady=steady)


def _reach(
    before: Frame, after: Frame, profile: RobotProfile, config: SensorMonitorConfig
) -> Displacement:
    """Return how far the robot can have gone between two frames: at most as fast as it measured at
    either end, faster by what it can accelerate and brake again meanwhile."""
    gap_s = _gap_s(before, after, config)
    speed_mps = max(map(abs, (before.twist.v_mps, after.twist.v_mps)))
    rate_radps = max(map(abs, (before.twist.w_radps, after.twist.w_radps)))
    slack = config.speed_factor

    def farthest(measured: float, acceleration: float, limit: float) -> float:
        return slack * gap_s * min(measured + acceleration * gap_s / 2, slack * limit)

    return Displacement(
        distance_m=config.distance_tolerance_m
        + farthest(speed_mps, profile.max_accel_mps2, profile.max_speed_mps),
        turn_rad=config.turn_tolerance_rad
        + farthest(rate_radps, 2 * profile.max_yaw_accel_radps2, 2 * profile.max_yaw_rate_radps),
    )


def _jumped(before: Frame, after: Frame, reach: Displacement) -> bool:
    """Return whether the robot cannot have gone from one frame to the other."""
    moved = _displacement(before, after)
    return moved.distance_m > reach.distance_m or moved.turn_rad > reach.turn_rad


def _jump_text(
    before: Frame, after: Frame, reach: Displacement, config: SensorMonitorConfig
) -> str:
    moved, gap_s = _displacement(before, after), _gap_s(before, after, config)
    if moved.distance_m > reach.distance_m:
        jump, limit = f"{moved.distance_m:.2f} m", f"{reach.distance_m:.2f} m"
    else:
        jump = f"{math.degrees(moved.turn_rad):.0f}°"
        limit = f"{math.degrees(reach.turn_rad):.0f}°"
    return (
        f"Odometry has jumped by {jump} in {gap_s:.2f} s, at most {limit} are possible; the robot "
        "stands until it jumps back, or until a reset accepts its position."
    )


def _displacement(before: Frame, after: Frame) -> Displacement:
    return Displacement(
        distance_m=before.pose.distance_to(after.pose.x_m, after.pose.y_m),
        turn_rad=abs(wrap_angle(after.pose.yaw_rad - before.pose.yaw_rad)),
    )


def _gap_s(before: Frame, after: Frame, config: SensorMonitorConfig) -> float:
    return min(max((after.stamp_ns - before.stamp_ns) / 1e9, 0.0), config.max_gap_s)


def _malformed(frame: Frame) -> str:
    try:
        check_frame(frame)
    except BadFrame as error:
        return str(error)
    return ""


def _has_pose(frame: Frame) -> bool:
    pose, twist = frame.pose, frame.twist
    return all(map(math.isfinite, (pose.x_m, pose.y_m, pose.yaw_rad, twist.v_mps, twist.w_radps)))
