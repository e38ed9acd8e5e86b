"""How long the gate holds the robot until it tries another motion."""

from __future__ import annotations

import pytest

from app.runtime.control.held_timer import CONTACT_HELD_NS, HELD_NS, HeldTimer
from navcore.geometry.transform import STANDSTILL
from navcore.safety.gate import Cause, GateDecision, StopReason


def held(*causes: Cause) -> GateDecision:
    reasons = tuple(StopReason(cause=cause, text="") for cause in causes)
    return GateDecision(twist=STANDSTILL, reasons=reasons)


@pytest.mark.parametrize(
    ("cause", "lasts_ns"),
    [(Cause.BEWARE_AHEAD, HELD_NS), (Cause.CONTACT_IMMINENT, CONTACT_HELD_NS)],
)
def test_it_is_over_after_a_time_and_that_before_an_obstacle_is_longer(
    cause: Cause, lasts_ns: int
) -> None:
    timer = HeldTimer().after(held(cause), 5)
    timer = timer.after(held(cause), lasts_ns)
    assert not timer.is_over(lasts_ns + 4)
    assert timer.is_over(lasts_ns + 5)


def test_an_obstacle_meanwhile_begins_the_shorter_time_again_and_not_the_longer() -> None:
    timer = HeldTimer()
    for stamp_ns in range(0, CONTACT_HELD_NS, HELD_NS // 2):
        cause = Cause.CONTACT_IMMINENT if stamp_ns % HELD_NS else Cause.BEWARE_AHEAD
        timer = timer.after(held(cause), stamp_ns)
        assert not timer.is_over(stamp_ns)
    assert timer.is_over(CONTACT_HELD_NS)


@pytest.mark.parametrize("causes", [(), (Cause.PAUSED,), (Cause.BEWARE_AHEAD, Cause.STALE_FRAME)])
def test_a_robot_that_is_free_or_stands_for_another_reason_is_not_held(
    causes: tuple[Cause, ...],
) -> None:
    timer = HeldTimer().after(held(Cause.BEWARE_AHEAD), 0).after(held(*causes), 1)
    assert timer == HeldTimer()
    assert not timer.is_over(10**12)
