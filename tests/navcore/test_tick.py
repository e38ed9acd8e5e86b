"""A tick of the whole navigation: from a frame to a path and a motion."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from navcore.control.controller import Controller, ControlTask
from navcore.control.motion import ControllerState, Motion
from navcore.costmap.costmap import Costmap
from navcore.errors import BadFrame
from navcore.geometry.transform import Pose2
from navcore.grid.cell_mask import CellMask
from navcore.grid.nearest import nearest_free
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.localisation import Localisation
from navcore.localisation.map_correction import AppliedCorrection
from navcore.planning.path import NoPath, Path, Reason
from navcore.robot.frame import Frame
from navcore.stages import Stages
from tests.navcore.scene import SPEC, Box, Paint, picture
from tests.navcore.ticks import ACROSS, NAN, OPEN, SECOND, navigator, order

RED_PATCH = Paint(x=(1.6, 2.4), y=(-0.5, 0.5))


def test_the_path_leads_around_a_red_floor_and_across_it_once_the_class_is_off() -> None:
    loop = navigator()
    around = loop.tick(picture(RED_PATCH), order()).route
    across = loop.tick(picture(RED_PATCH), order(enabled=False)).route
    assert around is not None
    assert across is not None
    assert isinstance(around.outcome, Path)
    assert isinstance(across.outcome, Path)
    assert across.outcome.length == 40.0
    assert around.outcome.length > 42.0
    assert np.abs(around.points[:, 1]).max() > 0.8


def test_a_tick_that_refuses_its_frame_has_changed_nothing() -> None:
    loop = navigator()
    with pytest.raises(BadFrame):
        loop.tick(NAN, order())
    assert loop.map.version == 0
    assert not loop.map.explored.seen.bools.any()


def test_corrections_before_ticks_that_fail_are_told_by_the_next_result(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    start, fails = pose(), iter((True, True, False, False))

    def control(controller: Controller, task: ControlTask) -> Motion:
        if next(fails):
            raise RuntimeError
        return Controller.control(controller, task)

    loop = navigator(Stages(control=control))
    corrections = iter((shifted((start,), 0.4), shifted((pose(0.4), pose(1.0)), 0.2), None, None))
    monkeypatch.setattr(loop._correction, "apply", lambda *_: next(corrections))
    for _ in range(2):
        with pytest.raises(RuntimeError):
            loop.tick(OPEN, order())
    told = loop.tick(OPEN, order()).correction
    assert told is not None and told.loops == 2
    assert told.before == (start, pose(1.0))
    assert told.after == (pose(0.4 + 0.2), pose(1.2)) and told.motion.x_m == pytest.approx(0.6)
    assert loop.tick(OPEN, order()).correction is None


def pose(x_m: float = 0.0) -> Pose2:
    return Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)


def shifted(poses: tuple[Pose2, ...], x_m: float) -> AppliedCorrection:
    return AppliedCorrection(
        before=poses,
        after=tuple(pose(one.x_m + x_m) for one in poses),
        motion=pose(x_m),
        loops=1,
    )


def test_without_a_goal_the_robot_looks_and_stands() -> None:
    decision = navigator().tick(picture(Box(x=(2, 3), y=(-1, 1), z=(0, 1))), order(None))
    assert decision.route is None
    assert decision.motion.outcome is ControllerState.IDLE
    assert decision.occupancy.grid.geometric.any()


def test_the_result_has_the_obstacles_that_the_motion_keeps_from() -> None:
    decision = navigator().tick(picture(Box(x=(2, 3), y=(-1, 1), z=(0, 1))), order(zones=(ACROSS,)))
    standing, forbidden = decision.obstacles
    assert standing[:, 0].min() == pytest.approx(2.0, abs=0.15)
    # With the growth of the zone, as the safety gate keeps out of it.
    assert 1.2 < forbidden[:, 0].min() < 1.55


def test_a_goal_in_a_zone_is_blocked_and_the_path_ends_exactly_at_a_free_one() -> None:
    loop = navigator()
    blocked = loop.tick(OPEN, order((1.75, 0.0), zones=(ACROSS,))).route
    assert blocked is not None
    assert blocked.outcome == NoPath(reason=Reason.GOAL_BLOCKED)
    free = loop.tick(OPEN, order((1.234, 0.567))).route
    assert free is not None
    assert free.points[-1].tolist() == free.waypoints[-1].tolist() == [1.234, 0.567]


def test_planning_a_preview_changes_neither_map_nor_route() -> None:
    loop = navigator()
    decision = loop.tick(OPEN, order())
    everything = np.ones((SPEC.rows, SPEC.cols), dtype=np.bool_)
    walled = Costmap.of(decision.occupancy.grid, everything, version=-1)
    assert loop.preview(walled, OPEN.pose, (3.0, 0.0)).outcome == NoPath(
        reason=Reason.START_BLOCKED
    )
    again = loop.tick(OPEN, order())
    assert again.route is decision.route
    assert again.occupancy is decision.occupancy


def test_a_start_inside_the_inflation_is_moved_to_the_nearest_free_cell_within_reach() -> None:
    blocked = np.zeros((20, 20), dtype=np.bool_)
    blocked[5:12, 5:12] = True
    assert nearest_free(CellMask.of(~blocked), (3, 3), 0.0) == (3, 3)
    assert nearest_free(CellMask.of(~blocked), (8, 6), 2.0) == (8, 4)
    assert nearest_free(CellMask.of(~blocked), (8, 8), 3.9) is None
    assert nearest_free(CellMask.of(~blocked), (8, 8), 4.0) in {(4, 8), (8, 4), (12, 8), (8, 12)}
    assert nearest_free(CellMask.of(~blocked), (-1, 30), 4.0) == (-1, 30)


@pytest.mark.parametrize("correction", [pose(0.05), Pose2(x_m=5.0, y_m=-2.0, yaw_rad=1.5)])
def test_the_driven_path_is_behind_the_robot_after_a_correction_of_its_place(
    correction: Pose2,
) -> None:
    applied = [pose(0.0)]

    def localise(localisation: Localisation, frame: Frame, *seen: Any) -> LocalisationEstimate:
        found = Localisation.update(localisation, frame, *seen)
        at = applied[0] @ frame.pose
        return dataclasses.replace(found, T_map_odom=applied[0], T_map_base=at)

    loop = navigator(Stages(localise=localise))
    for number in range(3):
        frame = picture(pose=pose(0.3 * number), stamp_ns=(number + 1) * SECOND)
        loop.tick(frame, order())
    loop.behaviour = dataclasses.replace(loop.behaviour, closed=(ACROSS,))
    applied[0] = correction
    loop.tick(picture(pose=pose(0.9), stamp_ns=4 * SECOND), order())
    behind = (correction @ pose(0.9)).from_parent(loop.behaviour.trail[1:])
    np.testing.assert_allclose(behind, [(-0.3, 0.0), (-0.6, 0.0), (-0.9, 0.0)], atol=1e-9)
    assert loop.behaviour.closed == (() if correction.x_m > 1.0 else (ACROSS,))


@pytest.mark.parametrize("was_known", [True, False])
def test_after_a_push_the_driven_path_lies_where_it_was_and_after_a_lost_place_there_is_none(
    was_known: bool,
) -> None:
    changes: list[dict[str, Any]] = [{}]

    def localise(localisation: Localisation, frame: Frame, *seen: Any) -> LocalisationEstimate:
        return dataclasses.replace(Localisation.update(localisation, frame, *seen), **changes[0])

    loop = navigator(Stages(localise=localise))
    for number in range(3):
        loop.tick(picture(pose=pose(0.3 * number), stamp_ns=(number + 1) * SECOND), order())
    driven = loop.behaviour.trail
    if not was_known:
        changes[0] = {"state": LocalisationState.LOST}
        loop.tick(picture(pose=pose(0.6), stamp_ns=3 * SECOND + 1), order())
    aside = Pose2(x_m=0.0, y_m=0.4, yaw_rad=0.0)
    changes[0] = {"T_map_odom": aside, "T_map_base": aside @ pose(0.6)}
    changes[0] |= {"pushed_m": 0.4} if was_known else {}
    loop.tick(picture(pose=pose(0.6), stamp_ns=4 * SECOND), order())
    rest = loop.behaviour.trail[1:]
    np.testing.assert_allclose(rest, driven if was_known else np.empty((0, 2)), atol=1e-9)
