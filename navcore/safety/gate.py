"""The safety gate: the last word before the wheels, independent of everything above it.

A pure function of facts and the newest command. It never moves the robot: it passes a command on,
weakens it, or sends zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

from navcore.geometry.transform import STANDSTILL, Twist
from navcore.robot.driver import Command
from navcore.robot.profile import RobotProfile
from navcore.safety.collision_monitor import (
    CREEP_MPS,
    HORIZON_S,
    NO_POINTS,
    NearPoints,
    allowed_share,
    time_to_contact,
)
from navcore.safety.sensor_monitor import SensorFault, SensorMonitor

COMMAND_LIFE_NS = 250_000_000
FRAME_LIFE_NS = 500_000_000
BLOCKED_NS = 2_000_000_000
"""Wheels that are commanded for so long and do not turn are held by something."""
COMMANDED_MPS, TURNING_SHARE = 0.05, 0.1
"""Faster than this something must move, and by this share of it at least; at the rim of the circle
that the body sweeps."""
LONGEST_PERIOD_S = 0.1
"""A gate that was not asked for longer than this allows no more acceleration than over this."""


class Cause(StrEnum):
    """Why the robot does not move. The order is that of severity: the first that holds is shown,
    the rest are listed."""

    EMERGENCY_STOP = "emergency_stop"
    CONTACT_IMMINENT = "contact_imminent"
    BEWARE_AHEAD = "beware_ahead"
    STALE_FRAME = "stale_frame"
    BAD_FRAME = "bad_frame"
    STUCK_CAMERA = "stuck_camera"
    BAD_STAMP = "bad_stamp"
    POSE_JUMP = "pose_jump"
    WHEELS_BLOCKED = "wheels_blocked"
    BAD_COMMAND = "bad_command"
    PLANNER_FAILED = "planner_failed"
    STALE_COMMAND = "stale_command"
    IN_ZONE = "in_zone"
    NO_PATH = "no_path"
    BOXED_IN = "boxed_in"
    YIELDING = "yielding"
    PAUSED = "paused"


_SEVERITY = {cause: rank for rank, cause in enumerate(Cause)}
_DOUBTS = {SensorFault.STAMP: Cause.BAD_STAMP, SensorFault.POSE: Cause.POSE_JUMP}


@dataclass(frozen=True, slots=True, kw_only=True)
class StopReason:
    """One reason for which the robot does not move."""

    cause: Cause
    """Stable word for programs."""
    text: str
    """A sentence for the operator, with the figures that matter."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GateInput:
    """What the gate judges by, all on the robot's monotonic clock; what is left out is not known to
    be wrong."""

    now_ns: int
    """The present."""
    frame_ns: int | None
    """Capture time of the newest frame that came in; None before the first."""
    stopped_by: str | None
    """Who latched the emergency stop; None when it is not latched."""
    command: Command | None
    """The newest command of the navigator; None when it asks for nothing."""
    senses: SensorMonitor = field(default_factory=SensorMonitor)
    """Whether the newest frame can be true."""
    near: NearPoints = field(default_factory=lambda: NO_POINTS)
    """(N, 2) what it shows to run into, base frame."""
    pushing_ns: int | None = None
    """Since when the wheels have been commanded in vain; None when they turn, or need not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GateDecision:
    """What is sent to the wheels, and why it is not what was asked."""

    twist: Twist
    """Finite and within the platform's limits, whatever came in."""
    reasons: tuple[StopReason, ...]
    """Why it is zero, the most severe first; empty when the command was passed on."""


def gate(facts: GateInput, *, sent: Twist, period_s: float, profile: RobotProfile) -> GateDecision:
    """Judge the newest command. `sent` is what was sent last, `period_s` before now."""
    objections = _objections(facts)
    asked = STANDSTILL if facts.command is None or objections else facts.command.twist
    contact_s = time_to_contact(facts.near, asked, profile)
    slowed = _slowed(asked, contact_s, facts, profile)
    if slowed == STANDSTILL and asked != STANDSTILL:
        objections.append(_contact(asked, contact_s))
    if objections or facts.command is None:
        return GateDecision(twist=STANDSTILL, reasons=ranked(objections))
    return GateDecision(twist=_within_limits(slowed, sent, period_s, profile), reasons=())


def pushes_in_vain(sent: Twist, measured: Twist, profile: RobotProfile) -> bool:
    """Whether the wheels were told to turn and do (nearly) not."""
    asked_mps = _fastest_point(sent, profile)
    return (
        asked_mps > COMMANDED_MPS and _fastest_point(measured, profile) < TURNING_SHARE * asked_mps
    )


def ranked(reasons: list[StopReason]) -> tuple[StopReason, ...]:
    """The most severe first."""
    return tuple(sorted(reasons, key=lambda reason: _SEVERITY[reason.cause]))


def _objections(facts: GateInput) -> list[StopReason]:
    found = []
    if facts.stopped_by is not None:
        text = f"Emergency stop by {facts.stopped_by}; it holds until it is reset."
        found.append(StopReason(cause=Cause.EMERGENCY_STOP, text=text))
    found += _sensor_objections(facts)
    if facts.pushing_ns is not None and facts.now_ns - facts.pushing_ns >= BLOCKED_NS:
        text = f"The wheels were commanded for {BLOCKED_NS / 1e9:g} s and did not turn; free the robot, then pause and resume."
        found.append(StopReason(cause=Cause.WHEELS_BLOCKED, text=text))
    if facts.command is not None:
        found += _command_objections(facts.command, facts.now_ns)
    return found


def _sensor_objections(facts: GateInput) -> list[StopReason]:
    found, senses = [], facts.senses
    if facts.frame_ns is None:
        found.append(
            StopReason(cause=Cause.STALE_FRAME, text="The camera has not delivered a picture yet.")
        )
    elif not 0 <= facts.now_ns - facts.frame_ns <= FRAME_LIFE_NS:
        age_s = (facts.now_ns - facts.frame_ns) / 1e9
        text = f"The newest camera picture is {age_s:.2f} s old, at most {FRAME_LIFE_NS / 1e9:g} s are allowed."
        found.append(StopReason(cause=Cause.STALE_FRAME, text=text))
    elif (
        senses.fresh_ns is not None
        and senses.repeats
        and facts.now_ns - senses.fresh_ns > FRAME_LIFE_NS
    ):
        age_s = (facts.now_ns - senses.fresh_ns) / 1e9
        text = f"The camera has shown the same picture for {age_s:.2f} s, at most {FRAME_LIFE_NS / 1e9:g} s are allowed."
        found.append(StopReason(cause=Cause.STUCK_CAMERA, text=text))
    if senses.malformed:
        found.append(
            StopReason(
                cause=Cause.BAD_FRAME, text=f"The camera's picture is refused: {senses.malformed}."
            )
        )
    if senses.doubt is not None:
        found.append(StopReason(cause=_DOUBTS[senses.doubt], text=senses.why))
    return found


def _command_objections(command: Command, now_ns: int) -> list[StopReason]:
    found = []
    if not (math.isfinite(command.twist.v_mps) and math.isfinite(command.twist.w_radps)):
        found.append(
            StopReason(
                cause=Cause.BAD_COMMAND, text="The planner asked for a velocity that is not finite."
            )
        )
    if not 0 <= now_ns - command.stamp_ns <= COMMAND_LIFE_NS:
        age_s = (now_ns - command.stamp_ns) / 1e9
        text = f"The newest command is {age_s:.2f} s old, at most {COMMAND_LIFE_NS / 1e9:g} s are allowed."
        found.append(StopReason(cause=Cause.STALE_COMMAND, text=text))
    return found


def _slowed(asked: Twist, contact_s: float, facts: GateInput, profile: RobotProfile) -> Twist:
    """The same motion, no faster than it can be stopped before contact; a standstill when that is
    hardly any motion."""
    if not contact_s <= HORIZON_S:
        return asked
    age_s = (facts.now_ns - facts.frame_ns) / 1e9 if facts.frame_ns is not None else 0.0
    share = allowed_share(contact_s, asked, frame_age_s=age_s, profile=profile)
    if share == 1.0:
        return asked
    slowed = Twist(v_mps=share * asked.v_mps, w_radps=share * asked.w_radps)
    return STANDSTILL if _fastest_point(slowed, profile) < CREEP_MPS else slowed


def _contact(asked: Twist, contact_s: float) -> StopReason:
    way = (
        f"{abs(asked.v_mps) * contact_s:.2f} m ahead"
        if abs(asked.v_mps) > CREEP_MPS
        else "in the way of the turn"
    )
    return StopReason(
        cause=Cause.CONTACT_IMMINENT,
        text=f"The camera sees something {way}, {contact_s:.2f} s before contact: too near to drive on.",
    )


def _fastest_point(twist: Twist, profile: RobotProfile) -> float:
    return abs(twist.v_mps) + abs(twist.w_radps) * profile.circumscribed_radius_m


def _within_limits(asked: Twist, sent: Twist, period_s: float, profile: RobotProfile) -> Twist:
    period_s = min(
        max(period_s, 0.0), LONGEST_PERIOD_S
    )  # a clock that goes back gives no licence to accelerate
    speed = _approach(
        asked.v_mps, sent.v_mps, profile.max_accel_mps2 * period_s, profile.max_speed_mps
    )
    # While the speed is still building up the robot turns less as well: it was the curvature that
    # was checked.
    built_up = 1.0 if asked.v_mps == 0.0 else min(max(speed / asked.v_mps, 0.0), 1.0)
    return Twist(
        v_mps=speed,
        w_radps=_approach(
            asked.w_radps * built_up,
            sent.w_radps,
            profile.max_yaw_accel_radps2 * period_s,
            profile.max_yaw_rate_radps,
        ),
    )


def _approach(asked: float, sent: float, step: float, limit: float) -> float:
    reached = min(max(asked, sent - step), sent + step)
    return min(max(reached, -limit), limit)
