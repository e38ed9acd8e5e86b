"""Confirmation of the place at which the robot starts in a saved map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import cast

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig, StartConfig
from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.localisation import Localisation
from navcore.localisation.relocalisation.place_fit import PlaceFit, doubt_of
from navcore.localisation.relocalisation.place_map import PlaceMap
from navcore.localisation.relocalisation.relocalisation import (
    PlaceProposal,
    RelocalisationState,
    Relocaliser,
    SearchResult,
    SearchTask,
)
from navcore.localisation.relocalisation.submap import Submap
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.start_check import Probation, StartCheck
from navcore.localisation.tasks import PrepareSearch, SearchPlaces
from navcore.localisation.tracking.localiser import Localiser
from navcore.mapping.points.pose_ids import PoseIds
from tests.navcore.localisation.plan_worlds import drive, office, room_doors
from tests.navcore.localisation.tracking.test_localiser import frame_at

RULES = StartConfig()
MANY, FEW = RULES.telling_points, RULES.telling_points - 1
WORLD = office(3)
ROUTE = drive([(1.5, 0.0), (9.0, 0.0)])


def verdict_of(share: float | None, points: int, *, may_be_elsewhere: bool = False) -> bool | None:
    """Verdict on frames that are all alike, for as long as it takes."""
    check = StartCheck(RULES, RelocalisationConfig())
    verdicts = (
        check.after(share, points, k * 200_000_000, may_be_elsewhere=may_be_elsewhere)
        for k in range(60)
    )
    return next((verdict for verdict in verdicts if verdict is not None), None)


def test_what_fits_is_believed_and_what_does_not_or_is_nowhere_on_the_map_is_not() -> None:
    assert verdict_of(0.9, MANY) is True
    assert verdict_of(0.5, MANY) is False
    assert verdict_of(None, MANY) is False
    assert verdict_of(None, FEW) is True


def test_where_too_little_is_in_view_a_robot_that_may_be_elsewhere_is_believed_nowhere() -> None:
    assert verdict_of(None, FEW, may_be_elsewhere=True) is None
    assert verdict_of(0.9, FEW, may_be_elsewhere=True) is True
    assert verdict_of(0.5, FEW, may_be_elsewhere=True) is False


def verdicts_while_searching(result: SearchResult | None) -> list[bool | None]:
    """Verdicts on frames, five a second, that fit while the map is searched; the result comes after
    two seconds."""
    check, verdicts = StartCheck(RULES, RelocalisationConfig()), []
    for k in range(25):
        if k == 10 and result is not None:
            check.take(result)
        verdicts.append(
            check.after(0.9, MANY, k * 200_000_000, may_be_elsewhere=False, is_searching=True)
        )
    return verdicts


def test_a_start_is_not_believed_where_the_map_fits_clearly_better_elsewhere() -> None:
    """And until the search has told, for at most `decide_s`."""
    better = verdicts_while_searching(search_result(fit(0.6), fit(0.8, x_m=9.0)))
    alike = verdicts_while_searching(search_result(fit(0.8), fit(0.8, x_m=9.0)))
    assert better[:10] == alike[:10] == [None] * 10
    assert (better[10], alike[10]) == (False, True)
    few = verdicts_while_searching(search_result(fit(0.6), fit(0.8, x_m=9.0), count=FEW))
    assert few[10] is True
    late = verdicts_while_searching(None)
    assert late.index(True) == round(RULES.decide_s / 0.2)
    assert verdict_of(0.9, MANY) is True  # without a search


def test_an_answer_about_the_place_that_was_checked_before_says_nothing_of_the_next() -> None:
    """A search of a large map may take longer than a place is checked."""
    ids, keyframes = kept_map()
    localisation = Localisation(ids, LocalisationConfig())
    localisation.load(keyframes, STOOD)
    late = search_result(fit(0.2), fit(0.9, x_m=9.0))
    localisation.follow(frame_at(ROUTE[0], 0), WORLD.scan(ROUTE[0], np.random.default_rng(0)))
    localisation.take(late)
    for k in range(1, 20):
        estimate = localisation.follow(
            frame_at(ROUTE[0], k), WORLD.scan(ROUTE[0], np.random.default_rng(k))
        )
    assert estimate.is_known
    assert estimate.T_map_base.distance_to(ROUTE[0].x_m, ROUTE[0].y_m) < 0.1


DOOR_M, SIDE, DEPTH_M = room_doors(3)[1]
INTO_ROOM = drive([(1.5, 0.0), (DOOR_M, 0.0), (DOOR_M, SIDE * (DEPTH_M - 0.5))])
STOOD = Pose2(x_m=DOOR_M, y_m=SIDE * 0.8, yaw_rad=SIDE * np.pi / 2)
"""Where the robot of these tests stood at the end of the session before: before a room."""


@pytest.mark.parametrize(
    ("last", "state", "places"),
    [
        (STOOD, LocalisationState.AMBIGUOUS, 2),
        (ROUTE[0] @ Pose2(x_m=0.2, y_m=0.1, yaw_rad=0.1), LocalisationState.DEAD_RECKONING, 0),
        (None, LocalisationState.DEAD_RECKONING, 0),
    ],
)
def test_in_the_dark_only_a_robot_that_stood_elsewhere_is_unsure_and_says_first_that_it_looks(
    last: Pose2 | None, state: LocalisationState, places: int
) -> None:
    found = list(switched_on_in_the_dark(last, 25))
    assert [one.state for one in found[:15]] == [LocalisationState.CHECKING] * 15
    assert (found[-1].state, len(found[-1].candidates)) == (state, places)


def test_a_robot_that_is_driven_out_of_the_dark_knows_its_place_where_it_stood() -> None:
    """The control of the last place: it has moved with the robot since."""
    way = [ROUTE[0] @ Pose2(x_m=0.1 * k, y_m=0.0, yaw_rad=0.0) for k in range(11)]
    found = list(switched_on_in_the_dark(STOOD, 20, then=[*way, *[way[-1]] * 30]))[-1]
    there = STOOD @ Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0)
    assert found.is_known
    assert found.T_map_base.distance_to(there.x_m, there.y_m) < 0.1


def switched_on_in_the_dark(
    last: Pose2 | None, frames: int, then: list[Pose2] | None = None
) -> Iterator[LocalisationEstimate]:
    """Estimates of a robot that sees nothing for some frames, then drives a way by its odometry
    from where it stood."""
    rng, (ids, keyframes) = np.random.default_rng(2), kept_map()
    localisation = Localisation(ids, LocalisationConfig())
    localisation.load(keyframes, last)
    dark = WORLD.scan(ROUTE[0], rng)
    dark = dark.part(np.zeros(len(dark), dtype=np.bool_))
    for k in range(frames):
        yield localisation.follow(frame_at(ROUTE[0], k), dark)
    for k, pose in enumerate(then or []):
        true = STOOD @ ROUTE[0].inverse() @ pose
        yield localisation.follow(frame_at(pose, frames + k), WORLD.scan(true, rng))


def kept_map() -> tuple[PoseIds, tuple[Keyframe, ...]]:
    """The map of the route, and its poses."""
    rng, ids = np.random.default_rng(1), PoseIds(0.25, 10.0)
    maker = Localiser(ids)
    for k, pose in enumerate(INTO_ROOM):
        maker.follow(frame_at(pose, k), WORLD.scan(pose, rng))
    ids.freeze()
    return ids, maker.keyframes


def fit(
    score: float = 0.8,
    *,
    x_m: float = 0.0,
    yaw_deg: float = 0.0,
    share: float = 0.9,
    clear: float = 0.0,
    walls: float = 0.0,
    sigma_m: float = 1.0,
) -> PlaceFit:
    return PlaceFit(
        T_map_base=Pose2(x_m=x_m, y_m=0.0, yaw_rad=np.radians(yaw_deg)),
        covariance=sigma_m**2 * np.eye(3),
        evidence=score - 3.0 * clear - walls,
        score=score,
        fit_share=share,
        through_walls_share=walls,
        contradicted_share=clear,
    )


def verdict_after(
    metres: float,
    given: PlaceFit | None,
    *others: PlaceFit,
    mirrored: tuple[PlaceFit, ...] = (),
) -> bool | None:
    """Verdict after searches that all say the same, each half a metre."""
    result = search_result(given, *others, mirrored=mirrored)
    probation, verdict = Probation(RULES, RelocalisationConfig()), None
    for _ in range(round(metres / 0.5)):
        verdict = probation.after(0.5)
        probation.take(result)
    return probation.after(0.0) if verdict is None else verdict


def search_result(
    given: PlaceFit | None,
    *others: PlaceFit,
    mirrored: tuple[PlaceFit, ...] = (),
    unmoved: PlaceFit | None = None,
    count: int = MANY,
) -> SearchResult:
    seen = Submap(
        points=np.zeros((count, 2)),
        normals=np.zeros((count, 2)),
        origins=np.zeros((count, 2)),
        T_odom_base=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0),
    )
    task = SearchTask(everything=seen, recent=seen, newest=None)
    found = (*others, *(() if given is None else (given,)))
    return SearchResult(
        task=task,
        everything=found,
        newest=(),
        again=None,
        mirrored=mirrored,
        given=given,
        moved=given,
        unmoved=unmoved,
    )


def test_what_was_seen_on_the_first_metres_has_to_fit_and_nothing_may_speak_against_it() -> None:
    assert verdict_after(RULES.probation_m - 0.5, fit()) is None
    assert verdict_after(RULES.probation_m, fit()) is True
    assert verdict_after(1.5, fit(clear=0.2)) is False


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
            found = probation.after(0.5) if found is None else found
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


def kept_where_the_map_shows_nothing() -> int:
    """Number of surfaces that a robot keeps which stands far from everything on its map."""
    rng, ids = np.random.default_rng(1), PoseIds(0.25, 10.0)
    maker, far = Localiser(ids), Pose2(x_m=500.0, y_m=0.0, yaw_rad=0.0)
    for k, pose in enumerate(ROUTE):
        maker.follow(frame_at(far @ pose, k), WORLD.scan(pose, rng))
    ids.freeze()
    localisation = Localisation(ids, LocalisationConfig())
    localisation.load(maker.keyframes)
    for k in range(10):
        localisation.follow(frame_at(ROUTE[40], k), WORLD.scan(ROUTE[40], rng))
    return len(localisation.tracker.own_map)


def test_what_is_seen_before_the_place_is_confirmed_is_not_kept_and_confirms_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert kept_where_the_map_shows_nothing() == 0
    always = property(lambda _: True, lambda _, value: None)
    monkeypatch.setattr(Localiser, "is_confirmed", always, raising=False)
    assert kept_where_the_map_shows_nothing() > 0


def test_a_map_in_use_before_knows_the_robot_still_and_without_that_it_is_lost() -> None:
    rng, ids = np.random.default_rng(1), PoseIds(0.25, 10.0)
    maker = Localiser(ids)
    for k, pose in enumerate(ROUTE):
        estimate = maker.follow(frame_at(pose, k), WORLD.scan(pose, rng))
    ids.freeze()
    # The robot stands where the map shows nothing: it looks back along the corridor.
    there = Pose2(x_m=ROUTE[0].x_m - 9.0, y_m=0.0, yaw_rad=np.pi)
    scan = office(7).scan(Pose2(x_m=3.0, y_m=0.0, yaw_rad=0.0), rng)
    estimate = dataclasses.replace(estimate, T_driven_base=ROUTE[-1])
    for kept, known in ((estimate, True), (None, False)):
        localisation = Localisation(ids, LocalisationConfig())
        localisation.load(maker.keyframes, kept=kept)
        for k in range(25):
            found = localisation.follow(frame_at(there, k), scan)
        assert found.is_known is known


@pytest.mark.parametrize(("clear", "known"), [(0.2, False), (0.0, True)])
def test_a_place_that_a_search_has_found_is_given_up_when_the_next_metres_contradict_it(
    monkeypatch: pytest.MonkeyPatch, clear: float, known: bool
) -> None:
    rng, ids = np.random.default_rng(1), PoseIds(0.25, 10.0)
    maker = Localiser(ids)
    for k, pose in enumerate(ROUTE):
        estimate = maker.follow(frame_at(pose, k), WORLD.scan(pose, rng))
    ids.freeze()
    localisation = Localisation(ids, LocalisationConfig())
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


def started(last: Pose2 | None = None) -> tuple[Localisation, Scan, LocalisationEstimate]:
    """A robot whose place in the kept map the first looks have confirmed, its scan there, and the
    newest estimate."""
    ids, keyframes = kept_map()
    localisation = Localisation(ids, LocalisationConfig())
    localisation.load(keyframes, last)
    scan = WORLD.scan(ROUTE[40], np.random.default_rng(2))
    for k in range(10):
        before = localisation.follow(frame_at(ROUTE[40], k), scan)
    assert before.is_known
    return localisation, scan, before


@pytest.mark.parametrize("last", [STOOD, ROUTE[40], None], ids=["elsewhere", "there", "unknown"])
def test_a_start_that_its_first_metres_refute_is_looked_for_where_the_robot_stood_last(
    last: Pose2 | None,
) -> None:
    """The first looks were alike at both places."""
    localisation, _, _ = started(last)
    for _ in range(RULES.doubts):
        localisation.take(search_result(fit(clear=0.2)))
    scans = (WORLD.scan(STOOD, np.random.default_rng(k)) for k in range(11, 35))
    found = [localisation.follow(frame_at(ROUTE[40], k), one) for k, one in enumerate(scans, 11)]
    if last is not STOOD:
        assert found[0].state is LocalisationState.LOST
        return
    assert found[0].state is LocalisationState.CHECKING
    assert found[-1].is_known
    assert found[-1].T_map_base.distance_to(STOOD.x_m, STOOD.y_m) < 0.1


def test_a_robot_that_is_lost_on_its_first_metres_is_looked_for_where_it_stood_last() -> None:
    localisation, _, _ = started(STOOD)
    for k in range(11, 60):
        scan = WORLD.scan(STOOD, np.random.default_rng(k))
        estimate = localisation.follow(frame_at(ROUTE[40], k), scan)
    assert estimate.is_known
    assert estimate.T_map_base.distance_to(STOOD.x_m, STOOD.y_m) < 0.1


DRIFT_RAD = 0.0007
"""Turn of a gyro between two frames of a robot that stands, radians."""


def stands_in_drift(robot: Localisation, scan: Scan, k: int) -> tuple[Pose2, int]:
    """The pose by odometry and the number of frames after a robot has stood for 200 frames more."""
    pose = ROUTE[40]
    for _ in range(200):
        pose, k = pose @ Pose2(x_m=0.0, y_m=0.0, yaw_rad=DRIFT_RAD), k + 1
        robot.follow(frame_at(pose, k), scan)
    return pose, k


def test_the_gyros_drift_at_standstill_is_no_turn_for_the_search_beside_the_start() -> None:
    localisation, scan, _ = started()
    prepare = localisation.next_task()
    assert isinstance(prepare, PrepareSearch)
    localisation.take(prepare.run(lambda: False))
    pose, k = stands_in_drift(localisation, scan, 10)
    estimate = localisation.follow(frame_at(pose, k + 1), scan)
    search = localisation.next_task()
    assert isinstance(search, SearchPlaces)
    assert search.task.given is not None
    assert abs(search.task.given.yaw_rad - estimate.T_map_base.yaw_rad) < 0.01


def test_a_robot_that_comes_back_to_a_map_is_not_turned_by_the_gyros_drift_meanwhile() -> None:
    localisation, scan, before = started()
    localisation.load(())
    pose, k = stands_in_drift(localisation, scan.emptied(), 10)
    localisation.load(kept_map()[1], kept=before)
    estimate = localisation.follow(frame_at(pose, k + 1), scan.emptied())
    assert abs(estimate.T_map_base.yaw_rad - before.T_map_base.yaw_rad) < 0.01


def comes_back(driven_m: float) -> tuple[LocalisationEstimate, LocalisationEstimate]:
    """The estimates of before and after a robot has used another map, in which it has driven, by
    half of it forth and by half of it back."""
    localisation, scan, before = started()
    localisation.load(())
    step_m, start = 0.1, before.T_map_odom.inverse() @ before.T_map_base
    forth = [k * step_m for k in range(round(driven_m / 2 / step_m) + 1)]
    for number, x_m in enumerate([*forth, *forth[::-1]]):
        pose = start @ Pose2(x_m=-x_m, y_m=0.0, yaw_rad=0.0)
        localisation.follow(frame_at(pose, 100 + number), scan.emptied())
    localisation.load(kept_map()[1], kept=before)
    return before, localisation.follow(frame_at(pose, 101 + number), scan.emptied())


def test_a_robot_that_comes_back_to_a_map_is_as_uncertain_as_it_has_become_by_its_way() -> None:
    for driven_m in (1.0, 8.0):
        before, after = comes_back(driven_m)
        assert after.is_known
        assert after.sigma_m == pytest.approx(
            math.hypot(before.sigma_m, 0.02 * driven_m), abs=0.012 * math.sqrt(driven_m) + 0.02
        )


def test_after_a_long_way_its_place_is_checked_as_that_of_a_start() -> None:
    _, after = comes_back(40.0)
    assert after.state is LocalisationState.CHECKING


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


def accepted_elsewhere(robot: Localisation) -> None:
    """Let the search beside a place on trial have found another one."""
    robot._relocaliser = Relocaliser(cast(PlaceMap, None), RelocalisationConfig())
    robot._relocaliser.proposal = PlaceProposal(
        state=RelocalisationState.ACCEPTED,
        reason="",
        T_map_odom=Pose2(x_m=3.0, y_m=0.0, yaw_rad=0.0),
        covariance=0.01 * np.eye(3),
    )


@pytest.mark.parametrize("how", ["lost", "asked"])
def test_what_was_found_on_trial_does_not_place_a_robot_that_is_lost_after_it(how: str) -> None:
    localisation, _, _ = started()
    accepted_elsewhere(localisation)
    if how == "asked":
        localisation.search(0)
    else:
        localisation._begin_search(may_be_there=False)
    assert localisation.proposal is not None
    assert localisation.proposal.state is not RelocalisationState.ACCEPTED
    assert localisation.is_on_trial is (how == "lost")


def test_a_lost_robot_whose_odometry_jumps_is_not_placed_by_what_was_found_before() -> None:
    localisation, scan, before = started()
    localisation.search(0)
    accepted_elsewhere(localisation)
    late = search_result(fit(0.9))
    localisation._asked = late.task
    jumped = frame_at(Pose2(x_m=3.0, y_m=0.0, yaw_rad=0.0) @ ROUTE[40], 20)
    localisation.accept_jump(before, jumped)
    localisation.take(late)
    assert localisation.follow(jumped, scan).state is LocalisationState.LOST
    assert localisation.proposal is None


def test_a_start_is_checked_again_after_a_clock_that_was_set_back_was_accepted() -> None:
    ids, keyframes = kept_map()
    localisation = Localisation(ids, LocalisationConfig())
    localisation.load(keyframes)
    scan = WORLD.scan(ROUTE[40], np.random.default_rng(2))
    before = localisation.follow(frame_at(ROUTE[40], 500), scan)
    localisation.accept_jump(before, frame_at(ROUTE[40], 0))
    found = [localisation.follow(frame_at(ROUTE[40], k), scan) for k in range(8)]
    assert not found[0].is_known
    assert found[-1].is_known


def test_the_place_that_an_operator_shows_counts_before_a_kept_one() -> None:
    ids, keyframes = kept_map()
    localisation = Localisation(ids, LocalisationConfig())
    localisation.load(keyframes, kept=LocalisationEstimate())
    shown, frame = ROUTE[40], frame_at(ROUTE[40], 0)
    localisation.place(shown, 0.01 * np.eye(3), frame)
    estimate = localisation.follow(frame, WORLD.scan(shown, np.random.default_rng(2)))
    assert estimate.T_map_base.distance_to(shown.x_m, shown.y_m) < 0.05


def test_an_answer_about_the_place_before_says_nothing_of_the_one_that_was_found() -> None:
    for is_of_the_place_before in (True, False):
        localisation, _, _ = started()
        asked = search_result(fit(0.2), fit(0.9, x_m=9.0))
        localisation._asked = asked.task
        if is_of_the_place_before:
            localisation._prove()
        assert localisation._probation is not None
        for _ in range(RULES.doubts):
            localisation.take(asked)
        verdict = localisation._probation.after(0.0)
        assert verdict is (None if is_of_the_place_before else False)


def test_nor_where_the_mirrored_scans_fit_as_well() -> None:
    probation = Probation(RULES, RelocalisationConfig())
    for mirrored in ((), (fit(0.9),)):
        for _ in range(RULES.doubts):
            probation.take(search_result(fit(0.3), NEAR, mirrored=mirrored))
        assert (probation.correction is None) is bool(mirrored)
        probation = Probation(RULES, RelocalisationConfig())
