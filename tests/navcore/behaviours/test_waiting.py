"""The robot waits for people at one place for so long, and then goes by where they are."""

from __future__ import annotations

from navcore.behaviours.waiting import WaitingTimer
from navcore.config.behaviours import WaitingConfig
from navcore.control.motion import ControllerState, Motion
from navcore.control.social import PEOPLE_CONFIG
from navcore.geometry.transform import STANDSTILL, Pose2, Twist

YIELDS = Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
DRIVES = Motion(twist=Twist(v_mps=0.5, w_radps=0.0), outcome=ControllerState.FOLLOW)
TICK_S = 0.1

RULES = WaitingConfig()


def after(
    patience: WaitingTimer,
    seconds: float,
    motion: Motion = YIELDS,
    x_m: float = 0.0,
    tick_s: float = TICK_S,
) -> WaitingTimer:
    """After so many more seconds at one place."""
    for _ in range(round(seconds / tick_s)):
        patience = patience.after(
            motion, Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0), patience.now_ns + round(tick_s * 1e9)
        )
    return patience


def test_it_is_over_after_so_long_in_all_at_one_place() -> None:
    assert not after(WaitingTimer(), PEOPLE_CONFIG.patience_s - 0.5).is_over(PEOPLE_CONFIG)
    waited = after(
        after(WaitingTimer(), PEOPLE_CONFIG.patience_s / 2), 5.0, DRIVES, x_m=0.3 * RULES.position_m
    )
    assert not waited.is_over(PEOPLE_CONFIG)
    assert after(waited, PEOPLE_CONFIG.patience_s / 2 + 0.5, x_m=0.5 * RULES.position_m).is_over(
        PEOPLE_CONFIG
    )


def test_it_stays_over_until_the_robot_has_come_away() -> None:
    over = after(WaitingTimer(), PEOPLE_CONFIG.patience_s + 1.0)
    assert after(over, 5.0, DRIVES, x_m=0.9 * RULES.position_m).is_over(PEOPLE_CONFIG)
    gone = after(over, 1.0, DRIVES, x_m=1.1 * RULES.position_m)
    assert not gone.is_over(PEOPLE_CONFIG) and gone.waited_s == 0.0


def test_time_without_pictures_is_no_waiting() -> None:
    assert after(WaitingTimer(), 60.0, tick_s=5.0).waited_s <= 12 * RULES.max_gap_s


def test_it_has_just_ended_for_a_moment_after_the_wait() -> None:
    assert not after(WaitingTimer(), 5.0, DRIVES).has_just_ended(PEOPLE_CONFIG)
    waited = after(WaitingTimer(), 3.0)
    assert waited.has_just_ended(PEOPLE_CONFIG)
    assert after(waited, PEOPLE_CONFIG.cautious_s - 0.2, DRIVES).has_just_ended(PEOPLE_CONFIG)
    assert not after(waited, PEOPLE_CONFIG.cautious_s + 0.2, DRIVES).has_just_ended(PEOPLE_CONFIG)
