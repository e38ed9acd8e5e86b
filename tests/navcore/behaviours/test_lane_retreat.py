"""A robot that waits in the lane of a person backs off to where it can turn beside the lane."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.behaviours.lane_retreat import LaneRetreat
from navcore.config.behaviours import LaneConfig, LaneRetreatConfig
from navcore.control.motion import ControllerState, Motion
from navcore.control.people.people_state import PEOPLE_CONFIG
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.robot.profile import HUSKY

WAITS = Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
BACKS = Motion(twist=Twist(v_mps=-0.2, w_radps=0.0), outcome=ControllerState.BACK)
RULES = LaneRetreatConfig()
LANE = np.column_stack([np.linspace(-3.0, 3.0, 31), np.zeros(31)])
"""Where a person walked: along x."""
CLEAR_M = HUSKY.circumscribed_radius_m + PEOPLE_CONFIG.personal_m + LaneConfig().person_radius_m


def came_from(y_m: float, *, length_m: float = 4.0, along: bool = False) -> Points:
    """(N, 2) path driven to (0, y), newest first: from the side, or along the lane."""
    steps = np.arange(0.0, length_m, 0.1)
    x, y = (steps, np.zeros_like(steps)) if along else (np.zeros_like(steps), steps)
    return np.column_stack([x, y + y_m])


def after(
    retreat: LaneRetreat,
    *,
    y_m: float = 0.8,
    t_s: float = 10.0,
    waited_s: float = PEOPLE_CONFIG.lane_s,
    motion: Motion = WAITS,
    trail: Points | None = None,
    walked: Points = LANE,
) -> LaneRetreat:
    return retreat.after(
        motion,
        Pose2(x_m=0.0, y_m=y_m, yaw_rad=-1.5),
        round(t_s * 1e9),
        walked=walked,
        trail=came_from(y_m) if trail is None else trail,
        waited_s=waited_s,
        profile=HUSKY,
        people_config=PEOPLE_CONFIG,
    )


def test_a_robot_that_has_waited_in_a_lane_backs_off_until_it_can_turn_beside_it() -> None:
    retreat = after(LaneRetreat())
    assert retreat.active
    assert after(retreat, y_m=CLEAR_M, motion=BACKS).active
    assert after(retreat, y_m=CLEAR_M + RULES.margin_m + 0.05, motion=BACKS) == LaneRetreat()


@pytest.mark.parametrize(
    "stays",
    [
        {"waited_s": PEOPLE_CONFIG.lane_s - 0.1},
        {"motion": BACKS},
        {"y_m": CLEAR_M + RULES.margin_m + 0.05},
        {"walked": np.empty((0, 2))},
        {"trail": came_from(0.8, along=True)},
        {"trail": came_from(0.8, length_m=0.3)},
        {"y_m": 1.0, "trail": came_from(-1.0) * (1.0, -1.0)},  # across the lane
        {"trail": np.empty((0, 2))},
    ],
)
def test_no_other_robot_does(stays: dict[str, object]) -> None:
    assert not after(LaneRetreat(), **stays).active  # type: ignore[arg-type]


def test_who_stands_in_the_lane_itself_backs_out_of_it_on_either_side() -> None:
    to_and_fro = np.vstack([LANE + np.array([0.0, y_m]) for y_m in (0.45, -0.45)])
    across = came_from(0.0) * (1.0, -1.0)
    retreat = after(LaneRetreat(), y_m=0.0, trail=across, walked=to_and_fro)
    assert retreat.active
    # Once it has begun it goes on, though its way leads past where they walked.
    assert after(
        retreat, y_m=0.95, motion=BACKS, trail=came_from(-0.95) * (1.0, -1.0), walked=LANE
    ).active


def test_a_retreat_that_takes_too_long_is_not_tried_again_at_that_position() -> None:
    retreat = after(LaneRetreat())
    held_up = after(retreat, t_s=10.0 + RULES.longest_s, motion=WAITS)
    assert not held_up.active
    assert not after(held_up, t_s=200.0).active
    elsewhere = after(held_up, y_m=0.8 - RULES.retry_m - 0.05, t_s=200.0)
    assert elsewhere.active


def test_a_retreat_that_something_blocks_ends_after_seconds() -> None:
    """A robot that cannot get back stands in the lane all the same: it goes on as before."""
    blocked = Motion(twist=STANDSTILL, outcome=ControllerState.BLOCKED)
    retreat = after(LaneRetreat())
    for t_s in np.arange(10.1, 9.95 + RULES.blocked_s, 0.1):
        retreat = after(retreat, t_s=float(t_s), motion=blocked)
        assert retreat.active
    freed = after(retreat, t_s=10.0 + RULES.blocked_s, motion=BACKS)
    assert freed.active
    assert after(freed, t_s=10.0 + 1.9 * RULES.blocked_s, motion=blocked).active
    ended = after(retreat, t_s=10.0 + RULES.blocked_s, motion=blocked)
    assert not ended.active and not after(ended, t_s=60.0).active
