"""Confirmation of the place at which the robot starts in a saved map."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.localisation import Localisation
from navcore.localisation.relocalisation.relocalisation import SearchResult
from navcore.localisation.start_check import StartCheck
from navcore.localisation.tracking.localiser import Localiser
from navcore.mapping.points.pose_ids import PoseIds
from navcore.robot.profile import HUSKY
from tests.navcore.localisation.plan_worlds import office
from tests.navcore.localisation.starts import (
    DOOR_M,
    FEW,
    MANY,
    ROUTE,
    RULES,
    SIDE,
    WORLD,
    fit,
    kept_map,
    search_result,
    started,
)
from tests.navcore.localisation.tracking.test_localiser import frame_at


def verdict_of(share: float | None, points: int, *, may_be_elsewhere: bool = False) -> bool | None:
    """Verdict on frames that are all alike, for as long as it takes."""
    check = StartCheck(RULES, RelocalisationConfig())
    verdicts = (
        check.after(share, points, 0.2, may_be_elsewhere=may_be_elsewhere) for _ in range(60)
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


def test_two_looks_with_a_gap_between_them_neither_confirm_a_start_nor_refute_it() -> None:
    """As of a camera that begins slowly: the time in between shows nothing."""
    localisation = Localisation(kept_map()[0], LocalisationConfig(), HUSKY.depth_sensor)
    localisation.load(kept_map()[1])
    scan = WORLD.scan(ROUTE[40], np.random.default_rng(2))
    found = [localisation.follow(frame_at(ROUTE[40], k), scan) for k in (0, 50, 51, 52, 53)]
    assert [one.state for one in found[:4]] == [LocalisationState.CHECKING] * 4
    assert found[4].is_known


def verdicts_while_searching(result: SearchResult | None) -> list[bool | None]:
    """Verdicts on frames, five a second, that fit while the map is searched; the result comes after
    two seconds."""
    check, verdicts = StartCheck(RULES, RelocalisationConfig()), []
    for k in range(25):
        if k == 10 and result is not None:
            check.take(result)
        verdicts.append(check.after(0.9, MANY, 0.2, may_be_elsewhere=False, is_searching=True))
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
    localisation = Localisation(ids, LocalisationConfig(), HUSKY.depth_sensor)
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
    localisation = Localisation(ids, LocalisationConfig(), HUSKY.depth_sensor)
    localisation.load(keyframes, last)
    dark = WORLD.scan(ROUTE[0], rng)
    dark = dark.part(np.zeros(len(dark), dtype=np.bool_))
    for k in range(frames):
        yield localisation.follow(frame_at(ROUTE[0], k), dark)
    for k, pose in enumerate(then or []):
        true = STOOD @ ROUTE[0].inverse() @ pose
        yield localisation.follow(frame_at(pose, frames + k), WORLD.scan(true, rng))


def kept_where_the_map_shows_nothing() -> int:
    """Number of surfaces that a robot keeps which stands far from everything on its map."""
    rng, ids = np.random.default_rng(1), PoseIds(0.25, 10.0)
    maker, far = Localiser(ids), Pose2(x_m=500.0, y_m=0.0, yaw_rad=0.0)
    for k, pose in enumerate(ROUTE):
        maker.follow(frame_at(far @ pose, k), WORLD.scan(pose, rng))
    ids.freeze()
    localisation = Localisation(ids, LocalisationConfig(), HUSKY.depth_sensor)
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
        localisation = Localisation(ids, LocalisationConfig(), HUSKY.depth_sensor)
        localisation.load(maker.keyframes, kept=kept)
        for k in range(25):
            found = localisation.follow(frame_at(there, k), scan)
        assert found.is_known is known


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


def test_a_jump_that_was_accepted_when_the_map_was_changed_forgets_no_place_on_the_new_one() -> (
    None
):
    ids, keyframes = kept_map()
    localisation = Localisation(ids, LocalisationConfig(), HUSKY.depth_sensor)
    localisation.load(keyframes, STOOD)
    localisation.accept_jump(LocalisationEstimate(), frame_at(ROUTE[40], 0))
    for k in range(1, 40):
        scan = WORLD.scan(STOOD, np.random.default_rng(k))
        estimate = localisation.follow(frame_at(ROUTE[40], k), scan)
    assert estimate.is_known
    assert estimate.T_map_base.distance_to(STOOD.x_m, STOOD.y_m) < 0.1


def test_a_start_is_checked_again_after_a_clock_that_was_set_back_was_accepted() -> None:
    ids, keyframes = kept_map()
    localisation = Localisation(ids, LocalisationConfig(), HUSKY.depth_sensor)
    localisation.load(keyframes)
    scan = WORLD.scan(ROUTE[40], np.random.default_rng(2))
    before = localisation.follow(frame_at(ROUTE[40], 500), scan)
    localisation.accept_jump(before, frame_at(ROUTE[40], 0))
    found = [localisation.follow(frame_at(ROUTE[40], k), scan) for k in range(8)]
    assert not found[0].is_known
    assert found[-1].is_known
