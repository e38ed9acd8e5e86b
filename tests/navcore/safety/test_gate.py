"""The gate: for any input the output is finite, within limits, and zero whenever it must be."""

from __future__ import annotations

import itertools
import math
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.safety import DEFAULT_SAFETY
from navcore.geometry.transform import IDENTITY, STANDSTILL, Twist
from navcore.mission.zone import Zone
from navcore.robot.driver import Command
from navcore.robot.profile import HUSKY
from navcore.safety.gate import (
    Cause,
    GateDecision,
    GateInput,
    StopReason,
    gate,
    ranked,
)
from navcore.safety.keep_out_monitor import KeepOuts
from tests.navcore.laws import law

NOW = 10_000_000_000
COMMAND_LIFE_NS = DEFAULT_SAFETY.gate.command_life_ns
FRAME_LIFE_NS = DEFAULT_SAFETY.gate.frame_life_ns
numbers = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(-3, 3),
    st.sampled_from(
        [math.nan, math.inf, -math.inf, sys.float_info.max, -sys.float_info.max, 5e-324, -0.0]
    ),
)
twists = st.builds(lambda v, w: Twist(v_mps=v, w_radps=w), numbers, numbers)
sane = st.builds(
    lambda v, w: Twist(v_mps=v, w_radps=w),
    st.floats(-HUSKY.max_speed_mps, HUSKY.max_speed_mps),
    st.floats(-HUSKY.max_yaw_rate_radps, HUSKY.max_yaw_rate_radps),
)
edges = [0, 1, COMMAND_LIFE_NS, COMMAND_LIFE_NS + 1, FRAME_LIFE_NS, FRAME_LIFE_NS + 1, -1]
stamps = st.one_of(
    st.integers(-(2**70), 2**70), st.sampled_from(edges).map(lambda age: NOW - age), st.just(NOW)
)
facts = st.builds(
    GateInput,
    now_ns=st.just(NOW),
    frame_ns=st.none() | stamps,
    stopped_by=st.none() | st.just("ann"),
    command=st.none() | st.builds(Command, twist=st.one_of(twists, sane), stamp_ns=stamps),
)


def must_stand(given_facts: GateInput) -> bool:
    """Return whether the robot must stand, by the requirements and not by the gate."""
    command, frame_ns = given_facts.command, given_facts.frame_ns
    if command is None or frame_ns is None or given_facts.stopped_by is not None:
        return True
    if not (math.isfinite(command.twist.v_mps) and math.isfinite(command.twist.w_radps)):
        return True
    return not (
        NOW - 500_000_000 <= frame_ns <= NOW and NOW - 250_000_000 <= command.stamp_ns <= NOW
    )


def assert_safe(decision: GateDecision) -> None:
    assert math.isfinite(decision.twist.v_mps)
    assert math.isfinite(decision.twist.w_radps)
    assert abs(decision.twist.v_mps) <= HUSKY.max_speed_mps
    assert abs(decision.twist.w_radps) <= HUSKY.max_yaw_rate_radps


@law(600)
@given(facts, twists, numbers)
def test_what_is_sent_is_finite_and_within_limits_for_any_input(
    given_facts: GateInput, sent: Twist, period_s: float
) -> None:
    assert_safe(gate(given_facts, sent=sent, period_s=period_s, profile=HUSKY))


@law(600)
@given(facts, sane, st.floats(0, 1))
def test_the_robot_stands_whenever_it_must_and_a_reason_is_named(
    given_facts: GateInput, sent: Twist, period_s: float
) -> None:
    decision = gate(given_facts, sent=sent, period_s=period_s, profile=HUSKY)
    if must_stand(given_facts):
        assert decision.twist == STANDSTILL
    if given_facts.command is not None:
        assert bool(decision.reasons) == must_stand(given_facts)


fresh = st.builds(
    lambda twist, age: GateInput(
        now_ns=NOW,
        frame_ns=NOW - age,
        stopped_by=None,
        command=Command(twist=twist, stamp_ns=NOW - age),
    ),
    st.one_of(sane, twists).filter(lambda t: math.isfinite(t.v_mps) and math.isfinite(t.w_radps)),
    st.integers(0, COMMAND_LIFE_NS),
)


@law(400)
@given(fresh, sane, st.floats(0, 0.5))
def test_a_command_passed_on_lies_between_the_last_and_the_asked_and_within_acceleration(
    given_facts: GateInput, sent: Twist, period_s: float
) -> None:
    assert given_facts.command is not None
    asked, out = (
        given_facts.command.twist,
        gate(given_facts, sent=sent, period_s=period_s, profile=HUSKY).twist,
    )
    assert abs(out.v_mps - sent.v_mps) <= HUSKY.max_accel_mps2 * period_s + 1e-12
    assert abs(out.w_radps - sent.w_radps) <= HUSKY.max_yaw_accel_radps2 * period_s + 1e-12
    assert min(sent.v_mps, asked.v_mps) <= out.v_mps <= max(sent.v_mps, asked.v_mps)
    # Turning may be weakened in proportion while the speed builds up, never strengthened.
    assert (
        min(sent.w_radps, asked.w_radps, 0.0)
        <= out.w_radps
        <= max(sent.w_radps, asked.w_radps, 0.0)
    )


def test_a_clock_that_goes_back_makes_no_motion_that_was_not_commanded() -> None:
    ask = GateInput(
        now_ns=NOW,
        frame_ns=NOW,
        stopped_by=None,
        command=Command(twist=Twist(v_mps=0.5, w_radps=0), stamp_ns=NOW),
    )
    assert gate(ask, sent=STANDSTILL, period_s=-0.1, profile=HUSKY).twist.v_mps >= 0.0


@law(100)
@given(sane)
def test_a_good_command_is_reached_unchanged(asked: Twist) -> None:
    """Control: a gate that always stands would pass every law above."""
    sent = STANDSTILL
    for _ in range(20):
        command = Command(twist=asked, stamp_ns=NOW)
        sent = gate(
            GateInput(now_ns=NOW, frame_ns=NOW, stopped_by=None, command=command),
            sent=sent,
            period_s=0.05,
            profile=HUSKY,
        ).twist
    assert sent == asked


@pytest.mark.parametrize(
    ("frame_age", "command_age", "causes"),
    [
        (FRAME_LIFE_NS, COMMAND_LIFE_NS, []),
        (FRAME_LIFE_NS + 1, 0, [Cause.STALE_FRAME]),
        (0, COMMAND_LIFE_NS + 1, [Cause.STALE_COMMAND]),
        (-1, 0, [Cause.STALE_FRAME]),
        (0, -1, [Cause.STALE_COMMAND]),
        (FRAME_LIFE_NS + 1, COMMAND_LIFE_NS + 1, [Cause.STALE_FRAME, Cause.STALE_COMMAND]),
    ],
)
def test_frames_and_commands_live_exactly_as_long_as_stated(
    frame_age: int, command_age: int, causes: list[Cause]
) -> None:
    command = Command(twist=Twist(v_mps=0.1, w_radps=0.0), stamp_ns=NOW - command_age)
    given_facts = GateInput(now_ns=NOW, frame_ns=NOW - frame_age, stopped_by=None, command=command)
    decision = gate(given_facts, sent=STANDSTILL, period_s=0.1, profile=HUSKY)
    assert [reason.cause for reason in decision.reasons] == causes
    assert (decision.twist == STANDSTILL) == bool(causes)


def test_everything_wrong_at_once_is_listed_the_most_severe_first() -> None:
    command = Command(twist=Twist(v_mps=math.nan, w_radps=0.0), stamp_ns=0)
    decision = gate(
        GateInput(now_ns=NOW, frame_ns=None, stopped_by="ann", command=command),
        sent=STANDSTILL,
        period_s=0.05,
        profile=HUSKY,
    )
    assert [reason.cause for reason in decision.reasons] == [
        Cause.EMERGENCY_STOP,
        Cause.STALE_FRAME,
        Cause.BAD_COMMAND,
        Cause.STALE_COMMAND,
    ]
    assert "ann" in decision.reasons[0].text


def test_any_order_of_reasons_is_ranked_the_same() -> None:
    reasons = [
        StopReason(cause=cause, text=cause)
        for cause in (Cause.PAUSED, Cause.NO_PATH, Cause.EMERGENCY_STOP, Cause.BAD_FRAME)
    ]
    expected = ["emergency_stop", "bad_frame", "no_path", "paused"]
    for order in itertools.permutations(reasons):
        assert [reason.text for reason in ranked(list(order))] == expected


def test_beside_an_area_a_command_above_the_limits_of_the_platform_is_that_of_the_limits() -> None:
    ahead = ((0.75, -2.0), (2.0, -2.0), (2.0, 2.0), (0.75, 2.0))
    zones = (Zone(id="z", name="z", polygon=ahead),)
    sent = []
    for v_mps in (HUSKY.max_speed_mps, 5 * HUSKY.max_speed_mps):
        asked = Command(twist=Twist(v_mps=v_mps, w_radps=0.0), stamp_ns=NOW)
        given_facts = GateInput(
            now_ns=NOW,
            frame_ns=NOW,
            stopped_by=None,
            command=asked,
            keep_outs=KeepOuts(pose=IDENTITY, zones=zones),
        )
        sent.append(gate(given_facts, sent=STANDSTILL, period_s=0.1, profile=HUSKY).twist)
    assert sent[0] == sent[1] and 0.0 < sent[0].v_mps < HUSKY.max_speed_mps
