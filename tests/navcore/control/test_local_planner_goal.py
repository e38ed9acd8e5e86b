"""At the goal the robot arrives and takes the heading asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navcore.config.control import LocalPlannerConfig
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.transform import STANDSTILL
from navcore.robot.profile import HUSKY
from tests.navcore.control.planning import ORIGIN, decide, ring, simulated, stands


@pytest.mark.parametrize(("distance", "arrived"), [(0.0, True), (0.11, True), (0.13, False)])
def test_the_robot_has_arrived_when_the_goal_is_near_and_not_before(
    distance: float, arrived: bool
) -> None:
    motion = decide(path=np.array([[0.0, 0.0], [distance, 0.0]]))
    assert stands(motion, ControllerState.ARRIVED) == arrived


@pytest.mark.parametrize(
    ("behind_m", "nearly_m", "arrived"), [(0.2, 0.25, True), (0.3, 0.25, False), (0.2, 0.0, False)]
)
def test_for_the_last_hand_width_the_robot_does_not_manoeuvre(
    behind_m: float, nearly_m: float, arrived: bool
) -> None:
    x = np.arange(-2.0, 2.0, 0.1)
    corridor = np.vstack([np.column_stack([x, np.full(len(x), side)]) for side in (-0.55, 0.55)])
    motion = decide(
        geometric=corridor,
        path=np.array([[0.0, 0.0], [-behind_m, 0.0]]),
        local=LocalPlannerConfig(nearly_m=nearly_m),
    )
    assert motion.outcome in (
        (ControllerState.ARRIVED,) if arrived else (ControllerState.MANOEUVRE, ControllerState.BACK)
    )
    assert (motion.twist == STANDSTILL) is arrived
    in_the_open = decide(
        path=np.array([[0.0, 0.0], [-behind_m, 0.0]]), local=LocalPlannerConfig(nearly_m=nearly_m)
    )
    assert in_the_open.outcome is ControllerState.TURN


def test_at_the_goal_the_robot_turns_in_place_to_the_heading_asked_for_and_has_arrived_then() -> (
    None
):
    here = np.array([[0.05, 0.0]])
    for yaw_rad in (1.5, -1.5):
        motion = decide(path=here, goal_yaw_rad=yaw_rad)
        assert (
            motion.outcome is ControllerState.ALIGN
            and motion.twist.v_mps == 0.0
            and motion.twist.w_radps * yaw_rad > 0
        )
    assert stands(decide(path=here, goal_yaw_rad=0.05), ControllerState.ARRIVED)
    assert decide(goal_yaw_rad=1.5).outcome is ControllerState.FOLLOW


def test_a_robot_that_skids_off_the_goal_while_it_turns_goes_on_turning_but_not_from_anywhere() -> (
    None
):
    aligning = Motion(twist=STANDSTILL, outcome=ControllerState.ALIGN)
    for distance, turns in ((0.2, True), (0.3, False)):
        motion = decide(path=np.array([[distance, 0.0]]), previous=aligning, goal_yaw_rad=1.5)
        assert (motion.outcome is ControllerState.ALIGN) == turns
    assert (
        decide(path=np.array([[0.0, 0.0], [0.2, 0.0]]), goal_yaw_rad=1.5).outcome
        is ControllerState.FOLLOW
    )


def test_a_blocked_turn_to_the_heading_is_boxed_in_and_a_zone_under_the_body_has_priority() -> None:
    here = np.array([[0.05, 0.0]])
    assert stands(
        decide(path=here, geometric=ring(0.55, 0.4), goal_yaw_rad=1.5), ControllerState.BLOCKED
    )
    assert stands(
        decide(path=here, forbidden=np.array([[0.2, 0.0]]), goal_yaw_rad=1.5),
        ControllerState.IN_ZONE,
    )


def test_a_turn_to_the_heading_over_unseen_cells_begins_with_a_look_at_them() -> None:
    here = np.array([[0.05, 0.0]])
    beside = np.array([[x, -0.5] for x in np.arange(-0.3, 0.31, 0.05)])
    assert decide(path=here, goal_yaw_rad=1.5).outcome is ControllerState.ALIGN
    pose, motion = ORIGIN, decide(path=here, unseen=beside, goal_yaw_rad=1.5)
    for _ in range(300):
        if motion.manoeuvre is None:
            break
        pose = simulated(motion.twist, pose)[20]
        motion = decide(
            path=here,
            unseen=pose.from_parent(beside),
            goal_yaw_rad=1.5,
            pose=pose,
            previous=motion,
        )
    to_cells = pose.from_parent(beside)
    bearings = np.abs(np.arctan2(to_cells[:, 1], to_cells[:, 0]))
    assert to_cells[:, 0].min() > HUSKY.length_m / 2
    assert bearings.max() < math.radians(43.5)  # the cells are in view
