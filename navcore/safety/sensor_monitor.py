"""Whether what the sensors say can be true: stamps that go on, a pose the robot can have reached,
pictures that change.

A value with its transition, one for each new frame. It remembers the last frame that could be true;
what cannot follow from it is not believed until the sensors agree with it again, or until the
operator says that the new place is the true one.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from enum import StrEnum

from navcore.errors import BadFrame
from navcore.geometry.transform import wrap_angle
from navcore.robot.frame import Frame, check_frame
from navcore.robot.profile import RobotProfile

SLACK = 1.1
"""A robot may be a little faster than it measures."""
SLACK_M, SLACK_RAD = 0.03, 0.03
"""And odometry comes in steps."""
LONGEST_S = 1.0
"""After this without a picture the gate has stopped the robot: a longer gap does not let it have
gone any further."""
STEADY = 3
"""A pose that has jumped is believed again when it is back, and has gone on steadily for so many
frames."""
EVERY_PX = 13
"""Every so manieth pixel is compared: a camera that works never repeats them all, for the noise in
it."""


class SensorFault(StrEnum):
    """Why a frame is not believed."""

    STAMP = "stamp"
    POSE = "pose"


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """How far the robot can have gone."""

    m: float
    """Along the floor."""
    rad: float
    """Turned."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SensorMonitor:
    """What is known of the sensors after some frames; none yet, as it is made."""

    newest: Frame | None = None
    """The last frame that came in."""
    trusted: Frame | None = None
    """The last one that could be true, with a pose."""
    fresh_ns: int | None = None
    """Capture time of the first frame that showed what the newest shows; None before the first."""
    doubt: SensorFault | None = None
    """Why the newest is not believed; None when it is."""
    why: str = ""
    """The same for the operator, with figures."""
    malformed: str = ""
    """What is wrong with the newest frame itself, whatever came before it; empty when nothing is.
    """
    reach: Way = Way(m=0.0, rad=0.0)
    """While the pose is in doubt: how far from the trusted one it can be by now."""
    steady: int = 0
    """For how many frames a pose in doubt has gone on without a jump."""
    depth: bytes = b""
    """Some pixels of the newest depth, to compare with."""
    rgb: bytes = b""
    """The same of the colours."""

    @property
    def repeats(self) -> bool:
        """Whether the newest frame shows, bit for bit, what an earlier one showed."""
        return self.newest is not None and self.newest.stamp_ns != self.fresh_ns

    @property
    def newest_is_trusted(self) -> bool:
        """Whether the newest frame can be true: well formed, where and when the robot can be."""
        return self.newest is not None and self.doubt is None and not self.malformed

    def after(self, frame: Frame, profile: RobotProfile) -> SensorMonitor:
        """With one more frame; the same one again changes nothing."""
        if frame is self.newest:
            return self
        if self.newest is None:
            return self._believe(frame)
        last_ns = self.newest.stamp_ns if self.trusted is None else self.trusted.stamp_ns
        if frame.stamp_ns <= last_ns:
            back_s = (last_ns - frame.stamp_ns) / 1e9
            why = f"The camera's clock does not go on: a picture is dated {back_s:.3f} s back from the one before it, or like it."
            doubted = (
                (self.doubt, self.why)
                if self.doubt is SensorFault.POSE
                else (SensorFault.STAMP, why)
            )
            return dataclasses.replace(
                self._shown(frame), doubt=doubted[0], why=doubted[1], steady=0
            )
        if self.trusted is None or not _is_somewhere(frame):
            # Without a pose there is none to doubt: the frame is refused for that.
            return (
                self._believe(frame)
                if self.doubt is not SensorFault.POSE
                else dataclasses.replace(self._shown(frame), steady=0)
            )
        if self.doubt is SensorFault.POSE:
            return self._still_in_doubt(self.newest, self.trusted, frame, profile)
        reach = _reach(self.trusted, frame, profile)
        if not _jumped(self.trusted, frame, reach):
            return self._believe(frame)
        why = _told(self.trusted, frame, reach)
        return dataclasses.replace(
            self._shown(frame), doubt=SensorFault.POSE, why=why, reach=reach, steady=0
        )

    def _shown(self, frame: Frame) -> SensorMonitor:
        """The same, but for what the newest frame shows."""
        depth, rgb = (
            pixels.reshape(-1)[::EVERY_PX].tobytes() for pixels in (frame.depth_m, frame.rgb)
        )
        same = self.newest is not None and (depth == self.depth or rgb == self.rgb)
        fresh_ns = self.fresh_ns if same else frame.stamp_ns
        return dataclasses.replace(
            self, newest=frame, fresh_ns=fresh_ns, malformed=_malformed(frame), depth=depth, rgb=rgb
        )

    def _believe(self, frame: Frame) -> SensorMonitor:
        trusted = frame if _is_somewhere(frame) else self.trusted
        return dataclasses.replace(
            self._shown(frame), trusted=trusted, doubt=None, why="", steady=0
        )

    def _still_in_doubt(
        self, before: Frame, trusted: Frame, frame: Frame, profile: RobotProfile
    ) -> SensorMonitor:
        """Meanwhile the robot has gone as far as it measured, which is nothing once it stands."""
        gap_s = _gap_s(before, frame)
        speed = min(max(abs(before.twist.v_mps), abs(frame.twist.v_mps)), profile.max_speed_mps)
        rate = min(
            max(abs(before.twist.w_radps), abs(frame.twist.w_radps)), profile.max_yaw_rate_radps
        )
        reach = Way(
            m=self.reach.m + SLACK * speed * gap_s, rad=self.reach.rad + SLACK * rate * gap_s
        )
        jumps = not _is_somewhere(before) or _jumped(before, frame, _reach(before, frame, profile))
        steady = 0 if jumps else self.steady + 1
        if steady >= STEADY and not _jumped(trusted, frame, reach):
            return self._believe(frame)
        return dataclasses.replace(self._shown(frame), reach=reach, steady=steady)


def _reach(before: Frame, after: Frame, profile: RobotProfile) -> Way:
    """How far the robot can have gone between two frames.

    At most as fast as it measured at either end, faster by what it can accelerate and brake again
    meanwhile.
    """
    gap_s, v, w = (
        _gap_s(before, after),
        (before.twist.v_mps, after.twist.v_mps),
        (before.twist.w_radps, after.twist.w_radps),
    )
    return Way(
        m=SLACK_M + _most(v, profile.max_accel_mps2, profile.max_speed_mps, gap_s),
        rad=SLACK_RAD
        + _most(w, 2 * profile.max_yaw_accel_radps2, 2 * profile.max_yaw_rate_radps, gap_s),
    )


def _most(measured: tuple[float, float], acceleration: float, limit: float, gap_s: float) -> float:
    return SLACK * gap_s * min(max(map(abs, measured)) + acceleration * gap_s / 2, SLACK * limit)


def _jumped(before: Frame, after: Frame, reach: Way) -> bool:
    moved_m, turned_rad = _moved(before, after)
    return moved_m > reach.m or turned_rad > reach.rad


def _told(before: Frame, after: Frame, reach: Way) -> str:
    (moved_m, turned_rad), gap_s = _moved(before, after), _gap_s(before, after)
    if moved_m > reach.m:
        what = f"{moved_m:.2f} m in {gap_s:.2f} s, at most {reach.m:.2f} m are possible"
    else:
        what = f"{math.degrees(turned_rad):.0f}° in {gap_s:.2f} s, at most {math.degrees(reach.rad):.0f}° are possible"
    return f"Odometry has jumped by {what}; the robot stands until it jumps back, or until a reset accepts its place."


def _moved(before: Frame, after: Frame) -> tuple[float, float]:
    moved_m = before.pose.distance_to(after.pose.x_m, after.pose.y_m)
    return moved_m, abs(wrap_angle(after.pose.yaw_rad - before.pose.yaw_rad))


def _gap_s(before: Frame, after: Frame) -> float:
    return min(max((after.stamp_ns - before.stamp_ns) / 1e9, 0.0), LONGEST_S)


def _malformed(frame: Frame) -> str:
    try:
        check_frame(frame)
    except BadFrame as error:
        return str(error)
    return ""


def _is_somewhere(frame: Frame) -> bool:
    pose, twist = frame.pose, frame.twist
    return all(map(math.isfinite, (pose.x_m, pose.y_m, pose.yaw_rad, twist.v_mps, twist.w_radps)))
