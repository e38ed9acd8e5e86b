"""The safety gate: the last word before the wheels, independent of everything above it.

A pure function of facts and the newest command. It never moves the robot: it passes a command on, weakens it, or sends zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from navcore.robot import STANDSTILL, Command, RobotProfile, Twist

COMMAND_LIFE_NS = 250_000_000
FRAME_LIFE_NS = 500_000_000
LONGEST_PERIOD_S = 0.1
"""A gate that was not asked for longer than this allows no more acceleration than over this."""


class Cause(StrEnum):
    """Why the robot does not move. The order is that of severity: the first that holds is shown, the rest are listed."""

    EMERGENCY_STOP = "emergency_stop"
    STALE_FRAME = "stale_frame"
    BAD_FRAME = "bad_frame"
    BAD_COMMAND = "bad_command"
    PLANNER_FAILED = "planner_failed"
    STALE_COMMAND = "stale_command"
    IN_ZONE = "in_zone"
    NO_PATH = "no_path"
    BOXED_IN = "boxed_in"
    PAUSED = "paused"


_SEVERITY = {cause: rank for rank, cause in enumerate(Cause)}


@dataclass(frozen=True, slots=True, kw_only=True)
class StopReason:
    """One reason for which the robot does not move."""

    cause: Cause
    """Stable word for programs."""
    text: str
    """A sentence for the operator, with the figures that matter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What the gate judges by, all on the robot's monotonic clock."""

    now_ns: int
    """The present."""
    frame_ns: int | None
    """Capture time of the newest frame that came in; None before the first."""
    stopped_by: str | None
    """Who latched the emergency stop; None when it is not latched."""
    command: Command | None
    """The newest command of the navigator; None when it asks for nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What is sent to the wheels, and why it is not what was asked."""

    twist: Twist
    """Finite and within the platform's limits, whatever came in."""
    reasons: tuple[StopReason, ...]
    """Why it is zero, the most severe first; empty when the command was passed on."""


def guard(facts: Facts, *, sent: Twist, period_s: float, profile: RobotProfile) -> Verdict:
    """Judge the newest command. `sent` is what was sent last, `period_s` before now."""
    reasons = ranked(_objections(facts))
    if reasons or facts.command is None:
        return Verdict(twist=STANDSTILL, reasons=reasons)
    return Verdict(twist=_within_limits(facts.command.twist, sent, period_s, profile), reasons=())


def ranked(reasons: list[StopReason]) -> tuple[StopReason, ...]:
    """The most severe first."""
    return tuple(sorted(reasons, key=lambda reason: _SEVERITY[reason.cause]))


def _objections(facts: Facts) -> list[StopReason]:
    found = []
    if facts.stopped_by is not None:
        text = f"Emergency stop by {facts.stopped_by}; it holds until it is reset."
        found.append(StopReason(cause=Cause.EMERGENCY_STOP, text=text))
    if facts.frame_ns is None:
        found.append(StopReason(cause=Cause.STALE_FRAME, text="The camera has not delivered a picture yet."))
    elif not 0 <= facts.now_ns - facts.frame_ns <= FRAME_LIFE_NS:
        age_s = (facts.now_ns - facts.frame_ns) / 1e9
        text = f"The newest camera picture is {age_s:.2f} s old, at most {FRAME_LIFE_NS / 1e9:g} s are allowed."
        found.append(StopReason(cause=Cause.STALE_FRAME, text=text))
    if facts.command is not None:
        found += _command_objections(facts.command, facts.now_ns)
    return found


def _command_objections(command: Command, now_ns: int) -> list[StopReason]:
    found = []
    if not (math.isfinite(command.twist.v_mps) and math.isfinite(command.twist.w_radps)):
        found.append(StopReason(cause=Cause.BAD_COMMAND, text="The planner asked for a velocity that is not finite."))
    if not 0 <= now_ns - command.stamp_ns <= COMMAND_LIFE_NS:
        age_s = (now_ns - command.stamp_ns) / 1e9
        text = f"The newest command is {age_s:.2f} s old, at most {COMMAND_LIFE_NS / 1e9:g} s are allowed."
        found.append(StopReason(cause=Cause.STALE_COMMAND, text=text))
    return found


def _within_limits(asked: Twist, sent: Twist, period_s: float, profile: RobotProfile) -> Twist:
    period_s = min(max(period_s, 0.0), LONGEST_PERIOD_S)  # a clock that goes back gives no licence to accelerate
    speed = _approach(asked.v_mps, sent.v_mps, profile.max_accel_mps2 * period_s, profile.max_speed_mps)
    # While the speed is still building up the robot turns less as well: it was the curvature that was checked.
    built_up = 1.0 if asked.v_mps == 0.0 else min(max(speed / asked.v_mps, 0.0), 1.0)
    return Twist(
        v_mps=speed,
        w_radps=_approach(
            asked.w_radps * built_up, sent.w_radps, profile.max_yaw_accel_radps2 * period_s, profile.max_yaw_rate_radps
        ),
    )


def _approach(asked: float, sent: float, step: float, limit: float) -> float:
    reached = min(max(asked, sent - step), sent + step)
    return min(max(reached, -limit), limit)
