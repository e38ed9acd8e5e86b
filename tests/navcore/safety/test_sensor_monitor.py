"""Frames are trusted as long as they are plausible, and not again before they agree."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.safety import DEFAULT_SAFETY
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.robot.driver import Command
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import Cause, GateInput, gate, wheels_blocked
from navcore.safety.sensor_monitor import SensorFault, SensorMonitor
from tests.navcore.laws import law
from tests.navcore.scene import picture

BASE = picture()
PERIOD_NS = 100_000_000
BLOCKED_NS = DEFAULT_SAFETY.gate.blocked_ns
STEADY = DEFAULT_SAFETY.sensors.steady_frames
TENTH = 0.1


def shot(
    number: int, x_m: float = 0.0, yaw_rad: float = 0.0, v_mps: float = 0.0, w_radps: float = 0.0
) -> Frame:
    """Return the frame with this number, ten a second, each with a noise of its own."""
    noise = np.random.default_rng(number)
    return dataclasses.replace(
        BASE,
        stamp_ns=number * PERIOD_NS,
        depth_m=BASE.depth_m * noise.uniform(0.999, 1.001, BASE.depth_m.shape).astype(np.float32),
        rgb=noise.integers(0, 255, BASE.rgb.shape, dtype=np.uint8),
        pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=yaw_rad),
        twist=Twist(v_mps=v_mps, w_radps=w_radps),
    )


def after(*frames: Frame) -> SensorMonitor:
    monitor = SensorMonitor()
    for frame in frames:
        monitor = monitor.after(frame, HUSKY)
    return monitor


def causes(monitor: SensorMonitor, now_ns: int) -> list[Cause]:
    assert monitor.newest is not None
    facts = GateInput(
        now_ns=now_ns,
        frame_ns=monitor.newest.stamp_ns,
        stopped_by=None,
        command=None,
        sensors=monitor,
    )
    return [
        reason.cause
        for reason in gate(facts, sent=STANDSTILL, period_s=0.05, profile=HUSKY).reasons
    ]


@law(200)
@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-6.0, 6.0)), min_size=1, max_size=30))
def test_a_robot_that_drives_within_its_limits_is_always_trusted(
    changes: list[tuple[float, float]],
) -> None:
    """Control of every refusal below: no false alarm, however it accelerates."""
    v = w = x = yaw = 0.0
    monitor = after(shot(0))
    for number, (a, alpha) in enumerate(changes, 1):
        before_v, before_w = v, w
        v, w = (
            float(np.clip(v + a * TENTH, -1.0, 1.0)),
            float(np.clip(w + alpha * TENTH, -2.0, 2.0)),
        )
        x, yaw = x + (before_v + v) / 2 * TENTH, yaw + (before_w + w) / 2 * TENTH
        monitor = monitor.after(shot(number, x, yaw, v, w), HUSKY)
        assert monitor.fault is None
        assert not monitor.repeats


@pytest.mark.parametrize(
    "jumped",
    [
        shot(2, x_m=0.2),
        shot(2, x_m=-5.0),
        shot(2, yaw_rad=math.pi),
        shot(2, yaw_rad=-0.2),
        shot(2, x_m=0.3, v_mps=1.0),
    ],
)
def test_a_pose_that_the_robot_cannot_have_reached_is_not_trusted_and_reported(
    jumped: Frame,
) -> None:
    monitor = after(shot(0), shot(1), jumped)
    assert monitor.fault is SensorFault.POSE
    assert causes(monitor, jumped.stamp_ns) == [Cause.POSE_JUMP]
    assert "jumped by" in monitor.fault_text


def test_a_pose_that_has_jumped_is_not_trusted_however_long_it_stays() -> None:
    monitor = after(shot(0), shot(1), *(shot(number, x_m=0.5) for number in range(2, 100)))
    assert monitor.fault is SensorFault.POSE
    assert causes(monitor, 99 * PERIOD_NS) == [
        Cause.POSE_JUMP
    ]  # and the camera, which works, is not blamed


def test_a_pose_that_jumps_back_is_trusted_after_it_has_been_steady() -> None:
    away = [shot(0), shot(1), shot(2, x_m=0.5), shot(3, x_m=0.5)]
    back = [shot(number) for number in range(4, 5 + STEADY)]
    assert after(*away, *back[:-1]).fault is SensorFault.POSE
    assert after(*away, *back).fault is None


def test_random_odometry_is_not_trusted_when_it_passes_the_true_pose() -> None:
    noise = np.random.default_rng(5)
    random_frames = [
        shot(n, *(float(number) for number in noise.uniform(-3, 3, 4))) for n in range(2, 200)
    ]
    monitor, trusted = after(shot(0), shot(1)), 0
    for frame in random_frames:
        monitor = monitor.after(frame, HUSKY)
        trusted += monitor.fault is None
    assert trusted == 0


@pytest.mark.parametrize("stamp_ns", [PERIOD_NS, 0, -5])
def test_a_clock_that_stands_or_goes_back_is_not_trusted_until_it_advances(stamp_ns: int) -> None:
    monitor = after(shot(0), shot(1), dataclasses.replace(shot(2), stamp_ns=stamp_ns))
    assert monitor.fault is SensorFault.STAMP and not monitor.awaits_reset
    assert Cause.BAD_STAMP in causes(monitor, PERIOD_NS)
    assert monitor.after(shot(3), HUSKY).fault is None


def test_a_clock_that_was_set_back_may_be_accepted_by_a_reset() -> None:
    monitor = after(shot(20), shot(21), shot(3))
    assert monitor.fault is SensorFault.CLOCK and monitor.awaits_reset
    assert "until a reset accepts it" in monitor.fault_text
    assert monitor.after(shot(20), HUSKY).awaits_reset  # while it catches up, too
    assert monitor.after(shot(22), HUSKY).fault is None


def test_an_image_from_the_future_is_refused_and_those_after_it_are_not() -> None:
    monitor, future = after(shot(0), shot(1)), dataclasses.replace(shot(2), stamp_ns=10**15)
    refused = monitor.after(future, HUSKY, now_ns=2 * PERIOD_NS)
    assert refused.fault is SensorFault.FUTURE and not refused.awaits_reset
    assert not refused.newest_is_trusted
    assert "999999.800 s in the future" in refused.fault_text
    good = refused.after(shot(3), HUSKY, now_ns=3 * PERIOD_NS)
    assert good.newest_is_trusted
    first = SensorMonitor().after(future, HUSKY, now_ns=0)
    assert first.fault is SensorFault.FUTURE
    assert first.after(shot(3), HUSKY, now_ns=3 * PERIOD_NS).newest_is_trusted


@pytest.mark.parametrize("repeated", ["depth_m", "rgb"])
def test_a_camera_that_repeats_its_image_is_noticed_and_named_after_half_a_second(
    repeated: str,
) -> None:
    first = shot(1)
    same = [
        dataclasses.replace(shot(number), **{repeated: getattr(first, repeated)})
        for number in range(2, 9)
    ]
    monitor = after(shot(0), first, *same[:5])
    assert monitor.repeats
    assert causes(monitor, 6 * PERIOD_NS) == []
    assert causes(monitor, 6 * PERIOD_NS + 1) == [Cause.STUCK_CAMERA]
    assert not monitor.after(shot(9), HUSKY).repeats


def test_the_same_frame_again_is_no_new_frame() -> None:
    frame = shot(1)
    monitor = after(shot(0), frame)
    assert monitor.after(frame, HUSKY) is monitor


def test_a_frame_without_a_pose_is_refused_elsewhere_and_hides_no_jump() -> None:
    nowhere = dataclasses.replace(shot(2), pose=Pose2(x_m=math.nan, y_m=0.0, yaw_rad=0.0))
    assert after(shot(0), shot(1), nowhere).fault is None
    assert after(shot(0), shot(1), nowhere, shot(3, x_m=3.0)).fault is SensorFault.POSE


@pytest.mark.parametrize(
    ("sent", "measured", "blocked"),
    [
        (Twist(v_mps=0.5, w_radps=0.0), STANDSTILL, True),
        (Twist(v_mps=0.5, w_radps=0.0), Twist(v_mps=0.3, w_radps=0.0), False),
        (Twist(v_mps=0.0, w_radps=0.5), Twist(v_mps=0.0, w_radps=0.01), True),
        (Twist(v_mps=-0.2, w_radps=0.0), Twist(v_mps=-0.2, w_radps=0.0), False),
        (Twist(v_mps=0.03, w_radps=0.0), STANDSTILL, False),
        (STANDSTILL, STANDSTILL, False),
    ],
)
def test_wheels_are_blocked_when_they_are_commanded_to_turn_and_do_not(
    sent: Twist, measured: Twist, blocked: bool
) -> None:
    assert wheels_blocked(sent, measured, HUSKY) is blocked


@pytest.mark.parametrize(
    ("since_ns", "expected"),
    [(BLOCKED_NS, [Cause.WHEELS_BLOCKED]), (BLOCKED_NS - 1, []), (None, [])],
)
def test_wheels_that_are_blocked_for_2_s_are_stopped(
    since_ns: int | None, expected: list[Cause]
) -> None:
    command = Command(twist=Twist(v_mps=0.5, w_radps=0.0), stamp_ns=BLOCKED_NS)
    facts = GateInput(
        now_ns=BLOCKED_NS,
        frame_ns=BLOCKED_NS,
        stopped_by=None,
        command=command,
        blocked_since_ns=None if since_ns is None else BLOCKED_NS - since_ns,
    )
    verdict = gate(facts, sent=STANDSTILL, period_s=0.05, profile=HUSKY)
    assert [reason.cause for reason in verdict.reasons] == expected
    assert (verdict.twist == STANDSTILL) == bool(expected)
