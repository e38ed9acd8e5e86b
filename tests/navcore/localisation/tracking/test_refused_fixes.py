"""Fixes that contradict the estimate: outliers do nothing, and those that agree for seconds win."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Matrix, Pose2
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.graph.pose_graph import OptimisedGraph
from navcore.localisation.localisation import Localisation
from navcore.localisation.loops.loop_closer import LoopCloser
from navcore.localisation.loops.loop_closure import LoopCandidates, LoopClosures
from navcore.localisation.tracking.refused_fixes import RefusedFixes
from navcore.mapping.points.pose_ids import PoseIds
from navcore.robot.fix import FixSource, PositionFix
from navcore.robot.profile import HUSKY
from tests.navcore.localisation.plan_worlds import PlanWorld
from tests.navcore.localisation.starts import ROUTE, WORLD, started
from tests.navcore.localisation.tracking.test_localiser import PERIOD_S, frame_at

CONFIG = LocalisationConfig()
EMPTY = PlanWorld([(90.0, 90.0, 91.0, 91.0)]).scan(IDENTITY, np.random.default_rng(1))
RTK_S = 30.0
"""Time for which the errors of RTK stay alike."""
PUSHED = 20
"""Frame before which the robot is pushed aside."""
Fixes = Callable[[int, Pose2], list[PositionFix]]


def fix(k: int, at: Pose2, sigma_m: float = 0.02, **about: object) -> PositionFix:
    """What a receiver or a tag says of a pose in frame k."""
    whole = PositionFix(
        stamp_ns=round(k * PERIOD_S * 1e9),
        x_m=at.x_m,
        y_m=at.y_m,
        covariance=sigma_m**2 * np.eye(2),
        source=FixSource.GNSS,
    )
    return dataclasses.replace(whole, **about)  # type: ignore[arg-type]


def rtk(k: int, at: Pose2) -> list[PositionFix]:
    return [fix(k, at, correlation_s=RTK_S)]


def tag(k: int, at: Pose2, sigma_m: float = 0.02) -> PositionFix:
    covariance = np.diag([sigma_m, sigma_m, 0.02]) ** 2
    return fix(k, at, source=FixSource.TAG, yaw_rad=at.yaw_rad, covariance=covariance)


def drive(
    fixes: Fixes, *, push_m: float = 0.0, seconds: float = 12.0, config: LocalisationConfig = CONFIG
) -> tuple[Localisation, list[LocalisationEstimate], list[float]]:
    """Estimates and errors in metres of a robot that is pushed aside, unnoticed by its wheels; it
    drives on unless a correction waits for it to stand."""
    localisation = Localisation(PoseIds(0.25, 10.0), config, HUSKY.depth_sensor)
    estimates, errors, along_m = [], [], 0.0
    for k in range(PUSHED + round(seconds / PERIOD_S)):
        along_m += 0.0 if localisation.waits_for_standstill else 0.1
        odometry = Pose2(x_m=along_m, y_m=0.0, yaw_rad=0.0)
        true = Pose2(x_m=along_m, y_m=push_m if k >= PUSHED else 0.0, yaw_rad=0.0)
        frame = dataclasses.replace(frame_at(odometry, k), fixes=tuple(fixes(k, true)))
        estimates.append(localisation.follow(frame, EMPTY))
        errors.append(estimates[-1].T_map_base.distance_to(true.x_m, true.y_m))
    return localisation, estimates, errors


def wrong_m(errors: list[float]) -> float:
    """Seconds for which the position was wrong by more than 15 cm."""
    return PERIOD_S * sum(error > 0.15 for error in errors)


@pytest.mark.parametrize("push_m", [0.3, 0.7, 1.1, 5.0])
def test_fixes_with_shared_errors_win_after_seconds_whatever_the_push(push_m: float) -> None:
    _, estimates, errors = drive(rtk, push_m=push_m)
    assert wrong_m(errors) < 4.5 and errors[-1] < 0.1
    told = [one.place_correction for one in estimates if one.place_correction is not None]
    assert [one.source for one in told] == [FixSource.GNSS]
    assert told[0].shift_m == pytest.approx(push_m, abs=0.1)
    stubborn = dataclasses.replace(CONFIG.tracking, refused_s=60.0)
    _, _, errors = drive(rtk, push_m=push_m, config=dataclasses.replace(CONFIG, tracking=stubborn))
    assert wrong_m(errors) > (4.9 if push_m < 0.75 else 11.0)


def test_meanwhile_the_estimate_is_as_uncertain_as_they_are_far(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def least_sigma_m() -> float:
        _, estimates, errors = drive(rtk, push_m=1.1, seconds=3.0)
        doubted = range(PUSHED + 4, PUSHED + 14)
        assert min(errors[k] for k in doubted) > 1.0
        return min(estimates[k].sigma_m for k in doubted)

    assert least_sigma_m() > 1.0
    monkeypatch.setattr(RefusedFixes, "offset", lambda *_: np.zeros(2))
    assert least_sigma_m() < 0.1


def test_reflected_signals_that_have_stopped_say_nothing_more() -> None:
    """A few that agree, and seconds later one more."""

    def reflected(k: int, at: Pose2) -> list[PositionFix]:
        is_wrong = PUSHED <= k < PUSHED + 4 or k == PUSHED + 40
        return rtk(k, Pose2(x_m=at.x_m, y_m=at.y_m + 8.0, yaw_rad=0.0)) if is_wrong else []

    _, estimates, errors = drive(reflected, seconds=10.0)
    assert estimates[PUSHED + 4].sigma_m > 7.0
    assert max(one.sigma_m for one in estimates[PUSHED + 20 :]) < 0.2
    assert max(errors) < 0.1 and not any(one.place_correction for one in estimates)


def test_a_wild_fix_now_and_then_does_nothing_and_keeps_no_right_ones_out() -> None:
    def with_wild(k: int, at: Pose2) -> list[PositionFix]:
        return rtk(k, Pose2(x_m=at.x_m + 4.0 * (k % 8 == 5), y_m=at.y_m, yaw_rad=0.0))

    _, estimates, errors = drive(with_wild)
    assert max(errors) < 0.05 and not any(one.place_correction for one in estimates)
    _, _, errors = drive(with_wild, push_m=1.1)
    assert wrong_m(errors) < 5.0 and errors[-1] < 0.1


def test_reflected_signals_carry_the_robot_no_farther_than_they_are_wrong_and_it_returns() -> None:
    def reflected(k: int, at: Pose2) -> list[PositionFix]:
        wrong = 1.5 if 20 <= k < 60 else 0.0
        return rtk(k, Pose2(x_m=at.x_m, y_m=at.y_m + wrong, yaw_rad=0.0))

    _, estimates, errors = drive(reflected, seconds=16.0)
    assert max(errors) < 1.6 and errors[-1] < 0.1
    assert sum(one.place_correction is not None for one in estimates) == 2
    # Those that last for less than `refused_s` change nothing.
    _, _, errors = drive(lambda k, at: reflected(k, at) if k < 34 else rtk(k, at), seconds=6.0)
    assert max(errors) < 0.05


def test_a_source_too_uncertain_to_contradict_a_tag_does_not_keep_it_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def tag_and_plain(k: int, at: Pose2) -> list[PositionFix]:
        return [tag(k, at), fix(k, at, 1.5, correlation_s=120.0)]

    _, _, errors = drive(tag_and_plain, push_m=1.1)
    assert errors[-1] < 0.1

    def always(refused: RefusedFixes, residual: Matrix, covariance: Matrix) -> None:
        refused.clear()

    monkeypatch.setattr(RefusedFixes, "confirm", always)
    _, _, errors = drive(tag_and_plain, push_m=1.1)
    assert errors[-1] > 1.0


@pytest.mark.parametrize(("by_tag", "found"), [(True, True), (False, False)])
def test_a_lost_robot_is_placed_by_tags_and_not_by_positions_without_heading(
    by_tag: bool, found: bool
) -> None:
    localisation = Localisation(PoseIds(0.25, 10.0), CONFIG, HUSKY.depth_sensor)
    there = Pose2(x_m=7.0, y_m=-3.0, yaw_rad=2.0)
    for k in range(25):
        seen = () if k == 0 else (tag(k, there),) if by_tag else tuple(rtk(k, there))
        frame = dataclasses.replace(frame_at(IDENTITY, k), fixes=seen)
        estimate = localisation.follow(frame, EMPTY)
        if k == 0:
            localisation.search(frame.stamp_ns)
    assert (estimate.state is not LocalisationState.LOST) is found
    if found:
        away = there.inverse() @ estimate.T_map_base
        assert math.hypot(away.x_m, away.y_m) < 0.05 and abs(away.yaw_rad) < 0.05


def test_fixes_count_after_a_clock_that_was_set_back_was_accepted() -> None:
    localisation, estimates, _ = drive(rtk, seconds=4.0)
    here = estimates[-1].T_map_base
    frame = frame_at(here, 1)
    localisation.accept_jump(estimates[-1], frame)
    before = localisation.follow(frame, EMPTY)
    fixed = dataclasses.replace(frame_at(frame.pose, 2), fixes=tuple(rtk(2, here)))
    assert localisation.follow(fixed, EMPTY).sigma_m < before.sigma_m


def test_after_such_a_correction_loops_of_the_chain_before_are_not_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    restarts: list[LoopCloser] = []
    monkeypatch.setattr(LoopCloser, "restart", lambda chain, known: restarts.append(chain))
    localisation, estimates, _ = drive(rtk, push_m=1.1)
    assert sum(one.place_correction is not None for one in estimates) == len(restarts) == 1
    late = LoopClosures(
        poses={900: IDENTITY},
        loops=(),
        new_loops=(),
        candidates=LoopCandidates(edges=()),
        graph=OptimisedGraph.__new__(OptimisedGraph),
    )
    localisation.take(late)
    assert localisation.closures is None
    monkeypatch.setattr(LoopCloser, "has", lambda chain, closures: True)
    localisation.take(late)
    assert localisation.closures is late


@pytest.mark.parametrize(
    ("seen", "is_lost"),
    [
        (tag(0, ROUTE[40]), False),
        (tag(0, ROUTE[40], 0.2), True),
        (fix(0, ROUTE[40]), True),
        (None, True),
    ],
)
def test_scans_that_contradict_the_map_lose_a_robot_unless_sure_fixes_confirm_its_heading_too(
    seen: PositionFix | None, is_lost: bool
) -> None:
    """A robot that was turned round sees what it does not expect where RTK confirms its place."""
    localisation, _, _ = started()
    here, is_known = ROUTE[40], []
    elsewhere = WORLD.scan(here @ Pose2(x_m=0.5, y_m=0.0, yaw_rad=2.0), np.random.default_rng(3))
    for k in range(11, 60):
        frame = frame_at(here, k)
        if seen is not None:
            frame = dataclasses.replace(
                frame, fixes=(dataclasses.replace(seen, stamp_ns=frame.stamp_ns),)
            )
        is_known.append(localisation.follow(frame, elsewhere).is_known)
    assert is_known[0] and all(is_known) is not is_lost


def test_a_push_that_scans_show_is_followed_although_fixes_without_heading_come_meanwhile() -> None:
    localisation, _, _ = started()
    expected = ROUTE[40]
    turned = expected @ Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.radians(12.0))
    rng = np.random.default_rng(3)
    for k in range(11, 60):
        frame = dataclasses.replace(frame_at(expected, k), fixes=(fix(k, expected),))
        estimate = localisation.follow(frame, WORLD.scan(turned, rng))
    assert estimate.T_map_base.yaw_rad == pytest.approx(turned.yaw_rad, abs=math.radians(2.0))
