"""Safety gate: the last decision before the wheels, independent of everything above it.

A pure function of its input and the newest command. It never moves the robot: it passes a command
on, slows it down, or sends zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

from navcore.config.safety import DEFAULT_SAFETY, GateConfig, SafetyConfig
from navcore.geometry.transform import IDENTITY, STANDSTILL, Pose2, Twist
from navcore.robot.driver import Command
from navcore.robot.profile import RobotProfile
from navcore.safety.collision_monitor import (
    NO_POINTS,
    NearPoints,
    allowed_share,
    braking_s,
    time_to_contact,
)
from navcore.safety.keep_out_monitor import KeepOuts, permitted_share
from navcore.safety.sensor_monitor import SensorFault, SensorMonitor


class Cause(StrEnum):
    """Why the robot does not move, in order of severity: the first that holds is shown, the others
    are listed."""

    EMERGENCY_STOP = "emergency_stop"
    CONTACT_IMMINENT = "contact_imminent"
    BEWARE_AHEAD = "beware_ahead"
    STALE_FRAME = "stale_frame"
    BAD_FRAME = "bad_frame"
    STUCK_CAMERA = "stuck_camera"
    BAD_STAMP = "bad_stamp"
    POSE_JUMP = "pose_jump"
    POSE_UNKNOWN = "pose_unknown"
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
_FAULT_CAUSES = {
    **dict.fromkeys(SensorFault, Cause.BAD_STAMP),
    SensorFault.POSE: Cause.POSE_JUMP,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class StopReason:
    """One reason why the robot does not move."""

    cause: Cause
    """Stable word for programs."""
    text: str
    """Sentence for the operator, with the figures that matter."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GateInput:
    """Everything that the gate decides by; times are those of the robot's monotonic clock, and the
    default of a field means that no fault is known."""

    now_ns: int
    """Present time in nanoseconds."""
    frame_ns: int | None
    """Capture time of the newest frame in nanoseconds; None before the first."""
    stopped_by: str | None
    """Name of the user who latched the emergency stop; None when it is not latched."""
    command: Command | None
    """Newest command of the navigator; None when it asks for nothing."""
    sensors: SensorMonitor = field(default_factory=SensorMonitor)
    """Plausibility of the newest frame."""
    obstacles: NearPoints = field(default_factory=lambda: NO_POINTS)
    """(N, 2) obstacle points in metres of the base frame of the newest frame."""
    moved: Pose2 = IDENTITY
    """Pose of the robot at present in the base frame of the newest frame."""
    keep_outs: KeepOuts = field(default_factory=KeepOuts)
    """Zones and beware cells that the footprint must not enter."""
    blocked_since_ns: int | None = None
    """Time in nanoseconds since which commanded wheels have not turned; None when they turn, or
    need not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GateDecision:
    """Velocity for the wheels, and why it is not the commanded one."""

    twist: Twist
    """Velocity to send: finite and within the limits of the platform, whatever the input."""
    reasons: tuple[StopReason, ...]
    """Why the velocity is zero, the most severe first; empty when the command was passed on."""


def gate(
    facts: GateInput,
    *,
    sent: Twist,
    period_s: float,
    profile: RobotProfile,
    config: SafetyConfig = DEFAULT_SAFETY,
) -> GateDecision:
    """Decide on the newest command. `sent` is the velocity that was sent last, `period_s` seconds
    ago."""
    objections = _objections(facts, config.gate)
    command = None if objections else facts.command
    asked = STANDSTILL if command is None else _reachable(command.twist, profile)
    contact_s = _contact_s(asked, facts, profile, config)
    slowed = _slowed(asked, contact_s, facts, profile, config)
    if slowed == STANDSTILL and asked != STANDSTILL:
        objections.append(_contact_reason(asked, contact_s, config))
    share, area = permitted_share(
        facts.keep_outs,
        slowed,
        profile,
        frame_age_s=_frame_age_s(facts),
        config=config.keep_out,
    )
    if share < 1.0:
        slowed = Twist(v_mps=share * slowed.v_mps, w_radps=share * slowed.w_radps)
    if area and profile.fastest_mps(slowed) < config.collision.creep_mps:
        objections.append(_area_reason(area))
    if objections or facts.command is None:
        return GateDecision(twist=STANDSTILL, reasons=ranked(objections))
    period_s = min(period_s, config.gate.max_period_s)
    twist = _within_limits(slowed, sent, period_s, profile)
    if twist != slowed and (refused := _refused(twist, facts, profile, config)) is not None:
        # From the present velocity to the one that was checked leads an arc that goes elsewhere.
        twist = _within_limits(_along(slowed, twist), sent, period_s, profile)
        if _refused(twist, facts, profile, config) is not None:
            twist = _within_limits(STANDSTILL, sent, period_s, profile)
        if twist == STANDSTILL:
            return GateDecision(twist=twist, reasons=(refused,))
    return GateDecision(twist=twist, reasons=())


def _refused(
    twist: Twist, facts: GateInput, profile: RobotProfile, config: SafetyConfig
) -> StopReason | None:
    """Return why a velocity is too fast, as it would touch something or enter an area; None if it
    is not."""
    contact_s = _contact_s(twist, facts, profile, config)
    if _slowed(twist, contact_s, facts, profile, config) != twist:
        return _contact_reason(twist, contact_s, config)
    share, area = permitted_share(
        facts.keep_outs, twist, profile, frame_age_s=_frame_age_s(facts), config=config.keep_out
    )
    return None if share == 1.0 else _area_reason(area)


def _along(checked: Twist, reached: Twist) -> Twist:
    """Return the velocity on the arc of the one that was checked, no faster than what can be
    reached."""
    shares = [
        min(max(part / whole, 0.0), 1.0)
        for part, whole in (
            (reached.v_mps, checked.v_mps),
            (reached.w_radps, checked.w_radps),
        )
        if whole
    ]
    share = min(shares, default=0.0)
    return Twist(v_mps=share * checked.v_mps, w_radps=share * checked.w_radps)


def _area_reason(area: str) -> StopReason:
    return StopReason(cause=Cause.BEWARE_AHEAD, text=f"Driving on would enter {area}.")


def wheels_blocked(
    sent: Twist, measured: Twist, profile: RobotProfile, config: GateConfig = DEFAULT_SAFETY.gate
) -> bool:
    """Return whether the wheels were commanded to turn and hardly do."""
    asked_mps = profile.fastest_mps(sent)
    return (
        asked_mps > config.commanded_mps
        and profile.fastest_mps(measured) < config.turning_share * asked_mps
    )


def emergency_stop(stopped_by: str) -> StopReason:
    """Return the reason of an emergency stop by an operator or a program of that name."""
    text = f"Emergency stop by {stopped_by}; it holds until it is reset."
    return StopReason(cause=Cause.EMERGENCY_STOP, text=text)


def ranked(reasons: list[StopReason]) -> tuple[StopReason, ...]:
    """Return the reasons, the most severe first."""
    return tuple(sorted(reasons, key=lambda reason: _SEVERITY[reason.cause]))


def _objections(facts: GateInput, config: GateConfig) -> list[StopReason]:
    found = []
    if facts.stopped_by is not None:
        found.append(emergency_stop(facts.stopped_by))
    found += _sensor_objections(facts, config)
    since_ns = facts.blocked_since_ns
    if since_ns is not None and facts.now_ns - since_ns >= config.blocked_ns:
        text = (
            f"The wheels were commanded for {config.blocked_s:g} s and did not turn; free the "
            "robot, then pause and resume."
        )
        found.append(StopReason(cause=Cause.WHEELS_BLOCKED, text=text))
    if facts.command is not None:
        found += _command_objections(facts.command, facts.now_ns, config)
    return found


def _sensor_objections(facts: GateInput, config: GateConfig) -> list[StopReason]:
    found, sensors = [], facts.sensors
    life_ns, limit = config.frame_life_ns, f"at most {config.frame_life_s:g} s are allowed"
    if facts.frame_ns is None:
        text = "Waiting for the next image of the camera."
        found.append(StopReason(cause=Cause.STALE_FRAME, text=text))
    elif not 0 <= facts.now_ns - facts.frame_ns <= life_ns:
        age_s = (facts.now_ns - facts.frame_ns) / 1e9
        text = f"The newest camera image is {age_s:.2f} s old, {limit}."
        found.append(StopReason(cause=Cause.STALE_FRAME, text=text))
    elif (
        sensors.unchanged_since_ns is not None
        and sensors.repeats
        and facts.now_ns - sensors.unchanged_since_ns > life_ns
    ):
        age_s = (facts.now_ns - sensors.unchanged_since_ns) / 1e9
        text = f"The camera has shown the same image for {age_s:.2f} s, {limit}."
        found.append(StopReason(cause=Cause.STUCK_CAMERA, text=text))
    if sensors.malformed:
        text = f"The camera image is refused: {sensors.malformed}."
        found.append(StopReason(cause=Cause.BAD_FRAME, text=text))
    if sensors.fault is not None:
        found.append(StopReason(cause=_FAULT_CAUSES[sensors.fault], text=sensors.fault_text))
    return found


def _command_objections(command: Command, now_ns: int, config: GateConfig) -> list[StopReason]:
    found = []
    if not (math.isfinite(command.twist.v_mps) and math.isfinite(command.twist.w_radps)):
        text = "The planner asked for a velocity that is not finite."
        found.append(StopReason(cause=Cause.BAD_COMMAND, text=text))
    if not 0 <= now_ns - command.stamp_ns <= config.command_life_ns:
        age_s = (now_ns - command.stamp_ns) / 1e9
        text = (
            f"The navigation is late: its newest decision is {age_s:.2f} s old, "
            f"at most {config.command_life_s:g} s are allowed."
        )
        found.append(StopReason(cause=Cause.STALE_COMMAND, text=text))
    return found


def _slowed(
    asked: Twist, contact_s: float, facts: GateInput, profile: RobotProfile, config: SafetyConfig
) -> Twist:
    """Return the same motion, no faster than it can be stopped before contact; a standstill when
    hardly any motion is left."""
    if not contact_s <= config.collision.horizon_s:
        return asked
    share = allowed_share(
        contact_s,
        asked,
        frame_age_s=_frame_age_s(facts),
        profile=profile,
        config=config.collision,
    )
    if share == 1.0:
        return asked
    slowed = Twist(v_mps=share * asked.v_mps, w_radps=share * asked.w_radps)
    return STANDSTILL if profile.fastest_mps(slowed) < config.collision.creep_mps else slowed


def _contact_s(
    twist: Twist, facts: GateInput, profile: RobotProfile, config: SafetyConfig
) -> float:
    return time_to_contact(facts.obstacles, twist, profile, config.collision, start=facts.moved)


def _frame_age_s(facts: GateInput) -> float:
    return 0.0 if facts.frame_ns is None else max(facts.now_ns - facts.frame_ns, 0) / 1e9


def _contact_reason(asked: Twist, contact_s: float, config: SafetyConfig) -> StopReason:
    away_m, where = abs(asked.v_mps) * contact_s, "in the path of the turn"
    if abs(asked.v_mps) > config.collision.creep_mps:
        where = f"{away_m:.2f} m ahead" if asked.v_mps > 0 else f"{away_m:.2f} m behind"
    return StopReason(
        cause=Cause.CONTACT_IMMINENT,
        text=f"There is an obstacle {where}, {contact_s:.2f} s before contact: too near to drive "
        "on.",
    )


def _within_limits(asked: Twist, sent: Twist, period_s: float, profile: RobotProfile) -> Twist:
    """Return the velocity within the platform's speed and, since the last one, acceleration."""
    period_s = max(period_s, 0.0)  # a clock that goes back gives no licence to accelerate
    if asked == STANDSTILL and sent != STANDSTILL:
        # Along the arc that was checked: were each braked by itself, the body would go elsewhere.
        share = max(1.0 - period_s / braking_s(sent, profile), 0.0)
        return Twist(v_mps=share * sent.v_mps, w_radps=share * sent.w_radps)
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


def _reachable(asked: Twist, profile: RobotProfile) -> Twist:
    """Return the velocity within the platform's speed: what the platform drives is checked."""
    v_mps, w_radps = profile.max_speed_mps, profile.max_yaw_rate_radps
    return Twist(
        v_mps=min(max(asked.v_mps, -v_mps), v_mps),
        w_radps=min(max(asked.w_radps, -w_radps), w_radps),
    )


def _approach(asked: float, sent: float, step: float, limit: float) -> float:
    """Return the value nearest to `asked` within a step of `sent` and within the limit."""
    reached = min(max(asked, sent - step), sent + step)
    return min(max(reached, -limit), limit)
