"""The robot waits for people at one place for so long, and then goes by where they are."""

from __future__ import annotations

from navcore.behaviours.supervisor import Behaviour
from navcore.behaviours.waiting import WaitingTimer
from navcore.config.behaviours import WaitingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.control.motion import ControllerState, Motion
from navcore.control.people.people_state import PEOPLE_CONFIG
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY
from tests.navcore.scene import picture

YIELDS = Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
BACKS = Motion(twist=Twist(v_mps=-0.2, w_radps=0.0), outcome=ControllerState.BACK)
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


def lost(unseen_s: float, *, walked: bool = True) -> Track:
    """A person who was lost from sight so long ago."""
    return Track(
        id=1,
        x_m=1.0,
        y_m=2.0,
        vx_mps=0.0,
        vy_mps=0.0,
        radius_m=0.3,
        age_s=9.0,
        last_seen_ns=0,
        unseen_s=unseen_s,
        walking_speed_mps=0.8 if walked else 0.0,
    )


def behaving(
    behaviour: Behaviour, x_m: float, seconds: float, motion: Motion, *people: Track
) -> Behaviour:
    """Behaviours after so many more seconds at a position."""
    for _ in range(round(seconds / TICK_S)):
        frame = picture(
            pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0),
            stamp_ns=behaviour.waiting.now_ns + round(TICK_S * 1e9),
        )
        behaviour, _ = behaviour.after(
            motion,
            frame=frame,
            route=None,
            people=people,
            profile=HUSKY,
            config=NavigatorConfig(),
        )
    return behaviour


def is_cautious(behaviour: Behaviour) -> bool:
    return behaviour.waiting.has_just_ended(PEOPLE_CONFIG)


def test_the_robot_is_cautious_after_a_wait_for_a_person_out_of_sight() -> None:
    """However far it had come from where its wait is counted; a person in view changes nothing."""
    driven = behaving(Behaviour(), 0.0, 0.5, DRIVES)
    waited = behaving(driven, 0.95, 3.0, YIELDS, lost(2.0), lost(0.0))
    assert is_cautious(waited)
    on = behaving(waited, 1.1, PEOPLE_CONFIG.cautious_s - 0.2, DRIVES)
    assert on.waiting.at != waited.waiting.at and is_cautious(on)
    assert not is_cautious(behaving(on, 1.5, 0.4, DRIVES))


def test_it_is_not_where_all_were_in_view_or_none_walked_or_it_did_not_wait() -> None:
    for motion, person in (
        (YIELDS, lost(0.1)),
        (YIELDS, lost(5.0, walked=False)),
        (DRIVES, lost(5.0)),
    ):
        assert not is_cautious(behaving(Behaviour(), 0.0, 3.0, motion, person))


def test_it_stays_cautious_while_it_backs_off() -> None:
    """It is still where it waited, and what left its sight there may be about to come back."""
    waited = behaving(Behaviour(), 0.0, 3.0, YIELDS, lost(2.0))
    back = behaving(waited, 0.0, 4.0 * PEOPLE_CONFIG.cautious_s, BACKS)
    assert is_cautious(back)
    assert not is_cautious(behaving(back, 0.0, PEOPLE_CONFIG.cautious_s + 0.2, DRIVES))


def test_a_clock_that_runs_backwards_ends_no_caution() -> None:
    waiting = WaitingTimer(driven_s=0.5, now_ns=10**10)
    on = waiting.after(DRIVES, Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), 0)
    assert on.driven_s == 0.5
