"""The first metres from a place prove it, refute it, or show that it is beside."""

from __future__ import annotations

import dataclasses
import math
from typing import cast

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.geometry.transform import IDENTITY, Pose2, wrap_angle
from navcore.localisation.estimate import LocalisationState
from navcore.localisation.localisation import Localisation
from navcore.localisation.relocalisation.place_fit import PlaceFit, doubt_of
from navcore.localisation.relocalisation.place_map import PlaceMap
from navcore.localisation.relocalisation.relocalisation import (
    PlaceProposal,
    RelocalisationState,
    Relocaliser,
    SearchResult,
)
from navcore.localisation.start_check import Probation
from navcore.localisation.tasks import PrepareSearch
from navcore.localisation.tracking.localiser import Localiser
from navcore.mapping.points.pose_ids import PoseIds
from navcore.robot.profile import HUSKY
from tests.navcore.localisation.plan_worlds import office
from tests.navcore.localisation.starts import ROUTE, RULES, WORLD, fit, search_result, started
from tests.navcore.localisation.tracking.test_localiser import frame_at


def verdict_after(
    metres: float,
    given: PlaceFit | None,
    *others: PlaceFit,
    mirrored: tuple[PlaceFit, ...] = (),
) -> bool | None:
    """Verdict after searches that all say the same, each half a metre."""
    result = search_result(given, *others, mirrored=mirrored)
    way = [Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0) for x_m in np.arange(0.5, metres + 0.1, 0.5)]
    return verdict_on(way, result)


def verdict_on(way: list[Pose2], result: SearchResult) -> bool | None:
    """Verdict on a way by odometry from its origin, after each pose of which a search says the
    same."""
    probation, before = Probation(RULES, RelocalisationConfig()), IDENTITY
    verdict = probation.after(0.0, before)
    for pose in way:
        turn_rad = abs(wrap_angle(pose.yaw_rad - before.yaw_rad))
        verdict = probation.after(before.distance_to(pose.x_m, pose.y_m) + turn_rad / 2, pose)
        probation.take(result)
        before = pose
    return probation.after(0.0, before) if verdict is None else verdict


def test_what_was_seen_on_the_first_metres_has_to_fit_and_nothing_may_speak_against_it() -> None:
    assert verdict_after(RULES.probation_m - 0.5, fit()) is None
    assert verdict_after(RULES.probation_m, fit()) is True
    assert verdict_after(1.5, fit(clear=0.2)) is False


def test_strokes_to_and_fro_and_turns_on_the_spot_confirm_no_place_however_long() -> None:
    """They show what was seen before; a turn and some way beside it show a small room."""

    def at(x_m: float, yaw_rad: float) -> Pose2:
        return Pose2(x_m=x_m, y_m=0.0, yaw_rad=wrap_angle(yaw_rad))

    strokes = [at(0.2 * (-1) ** k, 0.3 * (-1) ** k) for k in range(200)]
    turns = [at(0.0, 0.5 * k) for k in range(200)]
    assert verdict_on(strokes, search_result(fit())) is None
    assert verdict_on(turns, search_result(fit())) is None
    out = [at(0.5 * k, 0.0) for k in range(4)]
    back = [at(1.5 - 0.5 * k, math.pi) for k in range(4)]
    assert verdict_on([*out, *back], search_result(fit())) is None
    assert verdict_on([*turns, at(0.5, 0.0), at(1.0, 0.0)], search_result(fit())) is True


def test_nor_does_odometry_that_jumps() -> None:
    robot, scan, before = started()
    jumped = frame_at(Pose2(x_m=2.0 * RULES.probation_m, y_m=0.0, yaw_rad=0.0) @ ROUTE[40], 10)
    robot.accept_jump(before, jumped)
    for k in range(2):
        robot.follow(dataclasses.replace(jumped, stamp_ns=jumped.stamp_ns + k), scan)
        robot.take(search_result(fit()))
    assert robot.is_on_trial


def test_a_place_at_which_much_is_new_stays_open_unless_others_fit_as_well() -> None:
    """A robot that drives into a room that is not on the map."""
    new = fit(0.45, share=0.2)
    assert verdict_after(50.0, new) is None
    assert verdict_after(50.0, new, fit(0.2, x_m=9.0)) is None
    assert verdict_after(RULES.unfit_m - 0.5, new, fit(0.44, x_m=9.0)) is None
    assert verdict_after(RULES.unfit_m + 1.0, new, fit(0.44, x_m=9.0)) is False
    assert verdict_after(RULES.unfit_m + 1.0, new, mirrored=(fit(0.44),)) is False
    assert verdict_after(1.5, fit(0.45, share=0.2, clear=0.2)) is False


def test_rivals_that_come_and_go_count_as_long_as_little_fits() -> None:
    new, rival = fit(0.45, share=0.2), fit(0.44, x_m=9.0)

    def verdict(fits_between: bool) -> bool | None:
        probation, found = Probation(RULES, RelocalisationConfig()), None
        for step in range(round(3 * RULES.unfit_m / 0.5)):
            at = Pose2(x_m=0.5 * (step + 1), y_m=0.0, yaw_rad=0.0)
            found = probation.after(0.5, at) if found is None else found
            between = search_result(fit() if fits_between else new)
            probation.take(between if step % 2 else search_result(new, rival))
            if step < 2:
                assert probation.is_new == (not (fits_between and step % 2))
        return found

    assert verdict(fits_between=False) is False
    assert verdict(fits_between=True) is True


def test_lines_of_sight_across_surfaces_refute_a_place_by_the_evidence_alone() -> None:
    """A table that the map has seen from one side is crossed from the other side."""
    under_a_table = fit(0.8, walls=0.2)
    assert verdict_after(RULES.probation_m, under_a_table) is True
    assert verdict_after(1.5, fit(0.5, walls=0.2)) is False
    assert doubt_of([under_a_table], RelocalisationConfig())  # a search does not believe it


def test_a_place_that_another_one_or_the_mirrored_scans_fit_better_was_wrong() -> None:
    assert verdict_after(1.5, fit(0.6), fit(0.8, x_m=9.0)) is False
    assert verdict_after(1.5, fit(0.6), mirrored=(fit(0.8, x_m=9.0),)) is False
    assert verdict_after(9.0, fit(0.6), fit(0.8, x_m=9.0, clear=0.2)) is True


def test_a_place_that_fits_like_another_or_of_which_too_little_is_seen_stays_open() -> None:
    assert verdict_after(50.0, fit(), fit(x_m=9.0)) is None
    assert verdict_after(50.0, None) is None


@pytest.mark.parametrize(("clear", "known"), [(0.2, False), (0.0, True)])
def test_a_place_that_a_search_has_found_is_given_up_when_the_next_metres_contradict_it(
    monkeypatch: pytest.MonkeyPatch, clear: float, known: bool
) -> None:
    rng, ids = np.random.default_rng(1), PoseIds(0.25, 10.0)
    maker = Localiser(ids)
    for k, pose in enumerate(ROUTE):
        estimate = maker.follow(frame_at(pose, k), WORLD.scan(pose, rng))
    ids.freeze()
    localisation = Localisation(ids, LocalisationConfig(), HUSKY.depth_sensor)
    localisation.load(maker.keyframes, kept=dataclasses.replace(estimate, T_driven_base=ROUTE[-1]))
    scan = WORLD.scan(ROUTE[-1], rng)
    localisation.follow(frame_at(ROUTE[-1], 0), scan)
    localisation.search(0)
    localisation.follow(frame_at(ROUTE[-1], 1), scan)
    task = localisation.next_task()
    assert isinstance(task, PrepareSearch)
    tables = task.run(lambda: False)
    assert tables is not None
    localisation.take(tables)
    found = PlaceProposal(
        state=RelocalisationState.ACCEPTED,
        reason="",
        T_map_odom=estimate.T_map_odom,
        covariance=0.01 * np.eye(3),
    )
    with monkeypatch.context() as patched:
        patched.setattr(Relocaliser, "observe", lambda self, *_: setattr(self, "proposal", found))
        localisation.follow(frame_at(ROUTE[-1], 2), scan)
    assert localisation.follow(frame_at(ROUTE[-1], 3), scan).is_known
    for _ in range(RULES.doubts):
        localisation.take(search_result(fit(clear=clear)))
    assert localisation.follow(frame_at(ROUTE[-1], 4), scan).is_known is known


@pytest.mark.parametrize(
    ("beside", "unmoved", "is_corrected"),
    [
        (fit(0.9, x_m=0.4, sigma_m=0.05), fit(0.6), True),
        (fit(0.9, x_m=0.4, sigma_m=0.05), fit(0.85), False),
        (fit(0.9, x_m=0.4, sigma_m=0.5), fit(0.6), False),
        (fit(0.9, x_m=0.4, sigma_m=0.05, clear=0.1), fit(0.2), False),
        (fit(0.9, x_m=0.4, sigma_m=0.05, share=0.6), fit(0.6), False),
    ],
)
def test_a_start_that_the_next_metres_show_to_be_beside_its_place_is_corrected(
    beside: PlaceFit, unmoved: PlaceFit, is_corrected: bool
) -> None:
    """Only where they fit clearly better there, and say where along a corridor that is."""
    localisation, scan, before = started()
    localisation.take(search_result(beside, unmoved=unmoved))
    after = localisation.follow(frame_at(ROUTE[40], 10), scan)
    shift = after.place_correction
    assert (shift is not None) is is_corrected
    if shift is not None:
        there = beside.T_map_base @ ROUTE[40]
        assert shift.shift_m == pytest.approx(
            before.T_map_base.distance_to(there.x_m, there.y_m), abs=0.05
        )


NEAR = fit(0.9, x_m=1.2, sigma_m=0.05)


@pytest.mark.parametrize(
    ("searches", "is_corrected"),
    [
        ([(NEAR,), (NEAR,)], True),
        ([(NEAR,), (fit(0.9, x_m=-1.2, sigma_m=0.05),)], False),
        ([(NEAR, fit(0.88, x_m=9.0)), (NEAR,)], False),
        ([(fit(0.9, x_m=9.0, sigma_m=0.05),)] * 2, False),
        ([(fit(0.9, x_m=1.2, sigma_m=0.5),)] * 2, False),
        ([(fit(0.9, x_m=1.2, sigma_m=0.05, yaw_deg=40.0),)] * 2, False),
        ([(fit(0.6, x_m=1.2, sigma_m=0.05, share=0.6),)] * 2, False),
        ([(fit(0.6, x_m=1.2, sigma_m=0.05),)] * 2, False),
    ],
    ids=[
        "alone",
        "elsewhere next",
        "with a rival",
        "far away",
        "along a corridor",
        "turned",
        "too little fits",
        "not closely",
    ],
)
def test_a_refuted_start_is_beside_its_place_where_the_searches_find_that_one_alone(
    searches: list[tuple[PlaceFit, ...]], is_corrected: bool
) -> None:
    """Farther than a fit from the place that was given reaches; otherwise the robot is lost."""
    localisation, scan, _ = started()
    for found in searches:
        localisation.take(search_result(fit(0.3), *found))
    after = localisation.follow(frame_at(ROUTE[40], 10), scan)
    assert after.is_known is is_corrected
    if is_corrected:
        assert after.place_correction is not None
        assert after.place_correction.shift_m == pytest.approx(1.2, abs=0.05)


def test_while_a_correction_waits_for_standstill_the_place_that_it_leads_to_is_checked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else what has been corrected is refuted once more, and the robot is lost."""
    localisation, scan, _ = started()
    for _ in range(2):
        localisation.take(search_result(fit(0.3), NEAR))
    for number in (10, 11):
        after = localisation.follow(frame_at(ROUTE[number + 33], number), scan)
    pending = localisation.tracker.pending
    assert pending is not None and pending.distance_to(
        after.T_map_base.x_m, after.T_map_base.y_m
    ) == pytest.approx(1.2, abs=0.05)
    asked: list[Pose2] = []
    monkeypatch.setattr(
        localisation._search, "next_task", lambda _, given, last: asked.append(given)
    )
    localisation.next_task()
    (given,) = asked
    there = given @ localisation._driven.pose
    assert there.distance_to(pending.x_m, pending.y_m) < 0.01


def accepted_elsewhere(robot: Localisation) -> None:
    """Let the search beside a place on trial have found another one."""
    robot._search._relocaliser = Relocaliser(cast(PlaceMap, None), RelocalisationConfig())
    robot._search._relocaliser.proposal = PlaceProposal(
        state=RelocalisationState.ACCEPTED,
        reason="",
        T_map_odom=Pose2(x_m=3.0, y_m=0.0, yaw_rad=0.0),
        covariance=0.01 * np.eye(3),
    )


def test_what_was_found_on_trial_does_not_place_a_robot_that_is_lost_after_it() -> None:
    localisation, _, _ = started()
    accepted_elsewhere(localisation)
    localisation._begin_search(may_be_there=False)
    assert localisation._search._relocaliser is not None
    assert localisation._search._relocaliser.proposal.state is not RelocalisationState.ACCEPTED
    assert localisation.is_on_trial


@pytest.mark.parametrize("again", [False, True])
def test_look_round_begins_without_what_was_seen_before(
    monkeypatch: pytest.MonkeyPatch, again: bool
) -> None:
    """The robot may have been carried since; an answer about what was seen there tells nothing,
    either, nor does it when the operator asks twice."""
    localisation, _, _ = started()
    accepted_elsewhere(localisation)
    late = search_result(fit(0.9))
    localisation._search._asked = late.task
    for _ in range(1 + again):
        localisation.search(0)
    assert localisation._search._relocaliser is None
    assert not localisation.is_on_trial
    accepted_elsewhere(localisation)
    taken: list[object] = []
    monkeypatch.setattr(Relocaliser, "take", lambda _, result: taken.append(result))
    localisation.take(late)
    assert not taken


def test_a_robot_that_is_carried_away_on_trial_is_not_looked_for_with_what_it_saw_before() -> None:
    localisation, _, _ = started()
    accepted_elsewhere(localisation)
    rng = np.random.default_rng(4)
    for k in range(10, 60):
        elsewhere = office(7).scan(Pose2(x_m=3.0, y_m=3.0, yaw_rad=2.5), rng)
        estimate = localisation.follow(frame_at(ROUTE[40], k), elsewhere)
    assert estimate.state is LocalisationState.LOST
    assert localisation._search._relocaliser is None


def test_a_lost_robot_whose_odometry_jumps_is_not_placed_by_what_was_found_before() -> None:
    localisation, scan, before = started()
    localisation.search(0)
    accepted_elsewhere(localisation)
    late = search_result(fit(0.9))
    localisation._search._asked = late.task
    jumped = frame_at(Pose2(x_m=3.0, y_m=0.0, yaw_rad=0.0) @ ROUTE[40], 20)
    localisation.accept_jump(before, jumped)
    localisation.take(late)
    assert localisation.follow(jumped, scan).state is LocalisationState.LOST
    assert localisation._search._relocaliser is None


def test_an_answer_about_the_place_before_says_nothing_of_the_one_that_was_found() -> None:
    for is_of_the_place_before in (True, False):
        localisation, _, _ = started()
        asked = search_result(fit(0.2), fit(0.9, x_m=9.0))
        localisation._search._asked = asked.task
        if is_of_the_place_before:
            localisation._prove()
        assert localisation._probation is not None
        for _ in range(RULES.doubts):
            localisation.take(asked)
        verdict = localisation._probation.after(0.0, IDENTITY)
        assert verdict is (None if is_of_the_place_before else False)


def test_nor_where_the_mirrored_scans_fit_as_well() -> None:
    probation = Probation(RULES, RelocalisationConfig())
    for mirrored in ((), (fit(0.9),)):
        for _ in range(RULES.doubts):
            probation.take(search_result(fit(0.3), NEAR, mirrored=mirrored))
        assert (probation.correction is None) is bool(mirrored)
        probation = Probation(RULES, RelocalisationConfig())
