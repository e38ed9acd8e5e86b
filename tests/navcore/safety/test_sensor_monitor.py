"""What the sensors say is believed as long as it can be true, and not again before they agree."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.robot.driver import Command
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import BLOCKED_NS, Cause, GateInput, gate, pushes_in_vain
from navcore.safety.sensor_monitor import STEADY, SensorFault, SensorMonitor
from tests.navcore.laws import law
from tests.navcore.scene import picture

BASE = picture()
PERIOD_NS = 100_000_000
TENTH = 0.1


def shot(
    number: int, x_m: float = 0.0, yaw_rad: float = 0.0, v_mps: float = 0.0, w_radps: float = 0.0
) -> Frame:
    """The picture with this number, ten a second, each with a noise of its own."""
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
    senses = SensorMonitor()
    for frame in frames:
        senses = senses.after(frame, HUSKY)
    return senses


def causes(senses: SensorMonitor, now_ns: int) -> list[Cause]:
    assert senses.newest is not None
    facts = GateInput(
        now_ns=now_ns, frame_ns=senses.newest.stamp_ns, stopped_by=None, command=None, senses=senses
    )
    return [
        reason.cause
        for reason in gate(facts, sent=STANDSTILL, period_s=0.05, profile=HUSKY).reasons
    ]


@law(200)
@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-6.0, 6.0)), min_size=1, max_size=30))
def test_a_robot_that_drives_within_its_limits_is_never_doubted(
    changes: list[tuple[float, float]],
) -> None:
    """Control of every refusal below: no false alarm, however it accelerates."""
    v = w = x = yaw = 0.0
    senses = after(shot(0))
    for number, (a, alpha) in enumerate(changes, 1):
        before_v, before_w = v, w
        v, w = (
            float(np.clip(v + a * TENTH, -1.0, 1.0)),
            float(np.clip(w + alpha * TENTH, -2.0, 2.0)),
        )
        x, yaw = x + (before_v + v) / 2 * TENTH, yaw + (before_w + w) / 2 * TENTH
        senses = senses.after(shot(number, x, yaw, v, w), HUSKY)
        assert senses.doubt is None
        assert not senses.repeats


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
def test_a_pose_that_the_robot_cannot_have_reached_is_not_believed_and_told(jumped: Frame) -> None:
    senses = after(shot(0), shot(1), jumped)
    assert senses.doubt is SensorFault.POSE
    assert causes(senses, jumped.stamp_ns) == [Cause.POSE_JUMP]
    assert "jumped by" in senses.why


def test_a_pose_that_has_jumped_is_not_believed_however_long_it_stays_there() -> None:
    senses = after(shot(0), shot(1), *(shot(number, x_m=0.5) for number in range(2, 100)))
    assert senses.doubt is SensorFault.POSE
    assert causes(senses, 99 * PERIOD_NS) == [
        Cause.POSE_JUMP
    ]  # and the camera, which works, is not blamed


def test_a_pose_that_jumps_back_is_believed_after_it_has_been_steady() -> None:
    away = [shot(0), shot(1), shot(2, x_m=0.5), shot(3, x_m=0.5)]
    back = [shot(number) for number in range(4, 5 + STEADY)]
    assert after(*away, *back[:-1]).doubt is SensorFault.POSE
    assert after(*away, *back).doubt is None


def test_an_odometry_of_nonsense_is_not_believed_when_it_passes_by() -> None:
    noise = np.random.default_rng(5)
    nonsense = [
        shot(n, *(float(number) for number in noise.uniform(-3, 3, 4))) for n in range(2, 200)
    ]
    senses, believed = after(shot(0), shot(1)), 0
    for frame in nonsense:
        senses = senses.after(frame, HUSKY)
        believed += senses.doubt is None
    assert believed == 0


@pytest.mark.parametrize("stamp_ns", [PERIOD_NS, 0, -5])
def test_a_clock_that_stands_or_goes_back_is_not_believed_until_it_goes_on(stamp_ns: int) -> None:
    senses = after(shot(0), shot(1), dataclasses.replace(shot(2), stamp_ns=stamp_ns))
    assert senses.doubt is SensorFault.STAMP
    assert Cause.BAD_STAMP in causes(senses, PERIOD_NS)
    assert senses.after(shot(3), HUSKY).doubt is None


@pytest.mark.parametrize("repeated", ["depth_m", "rgb"])
def test_a_camera_that_repeats_itself_is_noticed_and_named_when_half_a_second_has_gone(
    repeated: str,
) -> None:
    first = shot(1)
    same = [
        dataclasses.replace(shot(number), **{repeated: getattr(first, repeated)})
        for number in range(2, 9)
    ]
    senses = after(shot(0), first, *same[:5])
    assert senses.repeats
    assert causes(senses, 6 * PERIOD_NS) == []
    assert causes(senses, 6 * PERIOD_NS + 1) == [Cause.STUCK_CAMERA]
    assert not senses.after(shot(9), HUSKY).repeats


def test_the_same_frame_again_is_no_new_frame() -> None:
    frame = shot(1)
    senses = after(shot(0), frame)
    assert senses.after(frame, HUSKY) is senses


def test_a_frame_without_a_pose_is_left_to_be_refused_and_hides_no_jump() -> None:
    nowhere = dataclasses.replace(shot(2), pose=Pose2(x_m=math.nan, y_m=0.0, yaw_rad=0.0))
    assert after(shot(0), shot(1), nowhere).doubt is None
    assert after(shot(0), shot(1), nowhere, shot(3, x_m=3.0)).doubt is SensorFault.POSE


@pytest.mark.parametrize(
    ("sent", "measured", "in_vain"),
    [
        (Twist(v_mps=0.5, w_radps=0.0), STANDSTILL, True),
        (Twist(v_mps=0.5, w_radps=0.0), Twist(v_mps=0.3, w_radps=0.0), False),
        (Twist(v_mps=0.0, w_radps=0.5), Twist(v_mps=0.0, w_radps=0.01), True),
        (Twist(v_mps=-0.2, w_radps=0.0), Twist(v_mps=-0.2, w_radps=0.0), False),
        (Twist(v_mps=0.03, w_radps=0.0), STANDSTILL, False),
        (STANDSTILL, STANDSTILL, False),
    ],
)
def test_wheels_push_in_vain_when_they_are_told_to_turn_and_do_not(
    sent: Twist, measured: Twist, in_vain: bool
) -> None:
    assert pushes_in_vain(sent, measured, HUSKY) is in_vain


@pytest.mark.parametrize(
    ("since_ns", "expected"),
    [(BLOCKED_NS, [Cause.WHEELS_BLOCKED]), (BLOCKED_NS - 1, []), (None, [])],
)
def test_wheels_that_push_in_vain_for_2_s_are_stopped(
    since_ns: int | None, expected: list[Cause]
) -> None:
    command = Command(twist=Twist(v_mps=0.5, w_radps=0.0), stamp_ns=BLOCKED_NS)
    facts = GateInput(
        now_ns=BLOCKED_NS,
        frame_ns=BLOCKED_NS,
        stopped_by=None,
        command=command,
        pushing_ns=None if since_ns is None else BLOCKED_NS - since_ns,
    )
    verdict = gate(facts, sent=STANDSTILL, period_s=0.05, profile=HUSKY)
    assert [reason.cause for reason in verdict.reasons] == expected
    assert (verdict.twist == STANDSTILL) == bool(expected)
