"""A place is believed only when new data says so again; a wrong map never is."""

from __future__ import annotations

import dataclasses
import itertools
import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from app.evaluation.localisation.recording import mirrored
from navcore.config.localisation.relocalisation import (
    PlaceFitConfig,
    PlaceSearchConfig,
    RelocalisationConfig,
)
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.relocalisation import place_fit, place_search
from navcore.localisation.relocalisation.place_fit import PlaceFit, fit_place
from navcore.localisation.relocalisation.place_map import PlaceMap, place_map_of
from navcore.localisation.relocalisation.relocalisation import (
    PlaceProposal,
    RelocalisationState,
    Relocaliser,
    SearchTask,
    search_task,
)
from navcore.localisation.relocalisation.submap import submap_of
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.tasks import PrepareSearch
from navcore.localisation.tracking.odometry_model import FRAME_LIFE_S
from tests.navcore.localisation.plan_worlds import (
    Drive,
    PlanWorld,
    colonnade,
    drive,
    equal_rooms,
    equal_rooms_tour,
    odometry_of,
    office,
    room_doors,
    surfaces_of,
    tour,
    turn_on_spot,
)
from tests.navcore.localisation.starts import ROUTE, fit, search_result, started
from tests.navcore.localisation.tracking.test_localiser import frame_at

CONFIG = RelocalisationConfig()
BY_LIKELIHOOD = dataclasses.replace(
    CONFIG.fit, unknown_worth=0.0, contradicted_cost=0.0, walls_cost=0.0
)
ROOMS = 3
ELSEWHERE = Pose2(x_m=-7.0, y_m=3.0, yaw_rad=2.0)
"""Where odometry's frame begins in the map, which relocalisation has to find."""


def mapped(world: PlanWorld, poses: Drive) -> PlaceMap:
    """The place map of a drive with true poses."""
    rng = np.random.default_rng(99)
    views = [(at, world.scan(at, rng)) for at in poses]
    return place_map_of(*surfaces_of(views), CONFIG.search, keyframes_of(views))


def keyframes_of(views: list[tuple[Pose2, Scan]]) -> list[Keyframe]:
    return [Keyframe(pose_id=k, T_map_base=at, scan=scan) for k, (at, scan) in enumerate(views)]


@cache
def office_map(seed: int) -> PlaceMap:
    return mapped(office(seed, rooms=ROOMS), tour(seed, rooms=ROOMS)[::2])


@cache
def mirrored_map(seed: int) -> PlaceMap:
    """The place map of a mirrored office, whose y points the other way."""
    rng, world = np.random.default_rng(99), office(seed, rooms=ROOMS)
    views = [(at, world.scan(at, rng)) for at in tour(seed, rooms=ROOMS)[::2]]
    surfaces, normals = surfaces_of(views)
    flip = np.array([1.0, -1.0])
    return place_map_of(
        surfaces * flip, normals * flip, CONFIG.search, mirrored(keyframes_of(views))
    )


def relocalised(
    world: PlanWorld,
    true: Drive,
    place_map: PlaceMap,
    *,
    seed: int = 0,
    config: RelocalisationConfig = CONFIG,
) -> tuple[PlaceProposal, Pose2 | None, list[PlaceProposal]]:
    """The last proposal of a drive, the error at the place if it was accepted, and all proposals;
    the drive ends when a place is accepted."""
    rng = np.random.default_rng(seed)
    relocaliser, proposals = Relocaliser(place_map, config), []
    for where, odometry in zip(true, odometry_of(true, rng), strict=True):
        T_odom_base = ELSEWHERE.inverse() @ odometry
        relocaliser.observe(world.scan(where, rng), T_odom_base, 0.2)
        if (task := relocaliser.next_task()) is None:
            continue
        result = search_task(task, place_map, config)
        assert result is not None
        proposals.append(relocaliser.take(result))
        if proposals[-1].state is RelocalisationState.ACCEPTED:
            T_map_odom = proposals[-1].T_map_odom
            assert T_map_odom is not None
            return proposals[-1], where.inverse() @ (T_map_odom @ T_odom_base), proposals
    return relocaliser.proposal, None, proposals


def room_drive(seed: int, room: int, *, turns: float = 1.0) -> Drive:
    """A turn inside a room of an office, then the way into the corridor and along it."""
    x, side, depth = sorted(room_doors(seed, rooms=ROOMS))[room]
    inside = (x, side * (1.0 + 0.4 * depth))
    way = drive([inside, (x, 0.0), (x + (3.0 if room < ROOMS else -3.0), 0.0)])
    return turn_on_spot(inside, way[0].yaw_rad, turns * 2.0 * math.pi) + way


@pytest.mark.parametrize("room", [0, 1, 3, 4])
def test_after_a_turn_and_some_metres_the_place_is_found(room: int) -> None:
    last, error, proposals = relocalised(office(1, rooms=ROOMS), room_drive(1, room), office_map(1))
    assert last.state is RelocalisationState.ACCEPTED
    assert error is not None
    assert math.hypot(error.x_m, error.y_m) < 0.15
    assert abs(error.yaw_rad) < math.radians(2.0)
    assert last.covariance is not None
    assert np.linalg.eigvalsh(last.covariance).min() > 0.0
    assert proposals[0].state is not RelocalisationState.ACCEPTED


@pytest.mark.long
@pytest.mark.parametrize(("rules", "is_found"), [(CONFIG.fit, True), (BY_LIKELIHOOD, False)])
def test_in_a_map_that_has_seen_one_side_of_things_what_it_has_not_seen_tells_nothing(
    rules: PlaceFitConfig, is_found: bool
) -> None:
    """On the first day the robot drove into the rooms and on, and never looked back. The control
    ranks places by their likelihood alone."""
    doors = sorted(room_doors(2, rooms=ROOMS))
    corners = [(0.8, 0.0)]
    for x, side, depth in doors:
        corners += [(x, 0.0), (x, side * (1.0 + 0.5 * depth)), (x, 0.0)]
    world = office(2, rooms=ROOMS)
    one_way = mapped(world, drive([*corners, (4.75 * ROOMS - 0.8, 0.0)])[::2])
    x, side, depth = doors[0]
    way = drive([(x, side * (1.0 + 0.4 * depth)), (x, 0.0), (max(x - 5.0, 0.8), 0.0)])
    config = dataclasses.replace(CONFIG, fit=rules)
    _, error, _ = relocalised(world, way, one_way, config=config)
    assert (error is not None) is is_found
    assert error is None or math.hypot(error.x_m, error.y_m) < 0.15


def test_a_place_is_never_believed_from_one_look() -> None:
    """However good it is: the robot stands after its first scans, and nothing new is seen."""
    world, true = office(1, rooms=ROOMS), room_drive(1, 0)[:30]
    standing = true + [true[-1]] * 60
    _, error, proposals = relocalised(world, standing, office_map(1))
    assert error is None
    assert proposals


@pytest.mark.parametrize(("seed", "room"), [(2, 0), (3, 4), (4, 2)])
def test_a_wrong_map_is_never_believed(seed: int, room: int) -> None:
    """In the last of them the robot turns in a room that has its like in the other map."""
    world, true = office(1, rooms=ROOMS), room_drive(1, room, turns=2.0)
    last, error, _ = relocalised(world, true, office_map(seed), seed=room)
    assert error is None
    assert last.reason


def test_a_turn_alone_would_believe_the_like_of_a_room_in_a_wrong_map() -> None:
    """The control: the map must contradict less of what has been seen from one position."""
    world, true = office(1, rooms=ROOMS), room_drive(1, 2, turns=2.0)
    rash = dataclasses.replace(CONFIG, turn_contradicted_share=0.05)
    assert relocalised(world, true, office_map(4), seed=2, config=rash)[1] is not None


@pytest.mark.long
def test_a_turn_in_short_strokes_is_a_turn_alone_however_many_metres_they_add_up_to() -> None:
    """They take the robot no more than 0.15 m from where it turns."""
    on_spot = room_drive(1, 2, turns=2.0)[: round(4.0 * math.pi / 0.14)]
    strokes = [0.15 * (1.0 - abs(k % 6 - 3) / 1.5) for k in range(len(on_spot))]
    true = [
        at @ Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0) for at, x_m in zip(on_spot, strokes, strict=True)
    ]
    last, error, _ = relocalised(office(1, rooms=ROOMS), true, office_map(4), seed=2)
    assert error is None
    assert "drive on" in last.reason


@pytest.mark.long
def test_rooms_of_the_same_shape_that_are_a_little_larger_fit_only_roughly() -> None:
    """All points find their surface, but not as closely as in the room itself."""
    rough, strict = (dataclasses.replace(CONFIG, least_closeness=least) for least in (0.1, 0.8))
    world, true = office(1, rooms=ROOMS), room_drive(1, 3)
    assert relocalised(world, true, office_map(1), config=strict)[1] is not None
    last, error, _ = relocalised(*larger(world, true, 1.04), office_map(1), config=strict)
    assert error is None and "roughly" in last.reason
    assert relocalised(*larger(world, true, 1.04), office_map(1), config=rough)[1] is not None


def larger(world: PlanWorld, true: Drive, scale: float) -> tuple[PlanWorld, Drive]:
    """A world and a drive in it of which all lengths are multiplied."""
    x0, y0, x1, y1 = (scale * np.array(world.boxes).T).tolist()
    return PlanWorld(boxes=list(zip(x0, y0, x1, y1, strict=True))), [
        Pose2(x_m=scale * pose.x_m, y_m=scale * pose.y_m, yaw_rad=pose.yaw_rad) for pose in true
    ]


def test_a_mirrored_map_is_never_believed() -> None:
    for room in (1, 4):
        world, true = office(1, rooms=ROOMS), room_drive(1, room)
        assert relocalised(world, true, mirrored_map(1), seed=room)[1] is None


def test_what_fits_as_well_when_mirrored_is_not_believed() -> None:
    """A map in which the control finds a place tells nothing; without its place, one is believed
    so far as to be confirmed."""
    world, true = office(1, rooms=ROOMS), room_drive(1, 0)
    relocaliser, rng = Relocaliser(office_map(1)), np.random.default_rng(0)
    for at in true:
        relocaliser.observe(world.scan(at, rng), at, 0.2)
    task = relocaliser.next_task()
    assert task is not None
    result = search_task(task, office_map(1))
    assert result is not None and result.everything
    assert relocaliser.take(result).state is RelocalisationState.CONFIRMING
    alike = dataclasses.replace(result, mirrored=result.everything)
    doubted = relocaliser.take(alike)
    assert doubted.state is RelocalisationState.AMBIGUOUS
    assert "mirrored" in doubted.reason


@pytest.mark.long
def test_equal_rooms_are_ambiguous_and_all_of_them_are_named() -> None:
    count = 20
    world = equal_rooms(count)
    place_map = mapped(world, equal_rooms_tour(count)[::2])
    x, y = 5 * 4.0 + 1.2, 2.8
    true = turn_on_spot((x, y), 0.3, 2.0 * math.pi) + drive([(x, y), (x, 3.8), (x, 2.0)])
    last, error, _ = relocalised(world, true, place_map)
    assert error is None
    assert last.state is RelocalisationState.AMBIGUOUS
    assert "places fit alike" in last.reason
    assert len(last.candidates) == count


@pytest.mark.long
def test_without_asking_for_a_second_best_an_equal_room_is_believed() -> None:
    """The control: the rule is what keeps equal rooms apart."""
    world = equal_rooms(6)
    place_map = mapped(world, equal_rooms_tour(6)[::2])
    x, y = 4.0 + 1.2, 2.8
    true = turn_on_spot((x, y), 0.3, 4.0 * math.pi)
    assert relocalised(world, true, place_map)[1] is None
    rash = dataclasses.replace(CONFIG, margin=0.0, same_m=50.0, same_deg=30.0)
    careless, error, _ = relocalised(world, true, place_map, config=rash)
    assert error is not None or careless.state is RelocalisationState.CONFIRMING


def test_as_many_places_are_named_as_fit_alike_and_one_where_one_is_left_to_confirm() -> None:
    best, like_it, worse = fit(0.9), fit(0.85, x_m=9.0), fit(0.6, x_m=20.0)
    for found, state in (
        ((best, like_it, worse), RelocalisationState.AMBIGUOUS),
        ((best, worse), RelocalisationState.CONFIRMING),
    ):
        said = Relocaliser(office_map(1)).take(search_result(None, *found))
        assert said.state is state
        assert said.candidates == found[:-1]


def test_time_in_which_no_scan_tells_is_none_for_which_scans_have_fitted() -> None:
    world, at, rng = office(1, rooms=ROOMS), room_drive(1, 0)[0], np.random.default_rng(0)
    relocaliser = Relocaliser(office_map(1))
    relocaliser._leading = IDENTITY
    scan, other = world.scan(at, rng), world.scan(at @ Pose2(x_m=0, y_m=0, yaw_rad=1.5), rng)
    tracked_s = []
    for seen in [scan] * 3 + [scan.emptied()] * 16 + [scan] * 2 + [other] * 3 + [scan] * 8:
        relocaliser.observe(seen, at, 0.2)
        tracked_s.append(relocaliser._tracked_s)
    assert tracked_s[2:19] == [0.4] * 17
    assert tracked_s[20] == pytest.approx(0.6)
    assert tracked_s[23] == 0.0  # after scans that do not fit
    assert 0.0 < tracked_s[-1] < 1.6


def test_nor_is_a_gap_without_frames_of_which_each_scan_tells_the_end_alone() -> None:
    robot, scan, _ = started()
    task = robot.next_task()
    assert isinstance(task, PrepareSearch)
    tables = task.run(lambda: False)
    assert tables is not None
    robot.take(tables)
    robot.follow(frame_at(ROUTE[40], 10), scan)
    assert robot._search._relocaliser is not None
    robot._search._relocaliser._leading = IDENTITY
    tracked_s = []
    for k in (11, 12, 62):  # of which the last comes after 10 s
        robot.follow(frame_at(ROUTE[40], k), scan)
        tracked_s.append(robot._search._relocaliser._tracked_s)
    assert tracked_s == pytest.approx([0.0, 0.2, 0.2 + FRAME_LIFE_S])


def test_a_cancelled_search_ends_without_a_result() -> None:
    world, true = office(1, rooms=ROOMS), room_drive(1, 0)
    relocaliser, rng = Relocaliser(office_map(1)), np.random.default_rng(0)
    relocaliser.observe(world.scan(true[0], rng), true[0], 0.0)
    task = relocaliser.next_task()
    assert task is not None
    assert search_task(task, office_map(1), is_cancelled=lambda: True) is None
    assert relocaliser.next_task() is None


def test_whether_a_search_is_cancelled_is_asked_for_each_place_that_it_refines(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world, true, rng = office(1, rooms=ROOMS), room_drive(1, 0), np.random.default_rng(0)
    views = tuple((at, world.scan(at, rng)) for at in true[:12])
    events: list[str] = []

    def refined(*of: Any) -> PlaceFit:
        events.append("refined")
        return fit_place(*of)

    def is_cancelled() -> bool:
        events.append("asked")
        return False

    for module in (place_search, place_fit):
        monkeypatch.setattr(module, "fit_place", refined)
    task = SearchTask(everything=views, recent=views)
    assert search_task(task, office_map(1), is_cancelled=is_cancelled) is not None
    assert events.count("refined") > 5
    assert ("refined", "refined") not in itertools.pairwise(events)


def test_an_empty_map_and_an_empty_view_fit_nowhere() -> None:
    empty = place_map_of(np.empty((0, 2)), np.empty((0, 2)), PlaceSearchConfig())
    world, true = office(1, rooms=ROOMS), room_drive(1, 0)[:40]
    last, error, _ = relocalised(world, true, empty)
    assert error is None
    assert last.state is RelocalisationState.SEARCHING
    blank, error, _ = relocalised(PlanWorld([(90.0, 90.0, 91.0, 91.0)]), true, office_map(1))
    assert error is None
    assert blank.state is RelocalisationState.SEARCHING


def test_a_place_between_pillars_that_are_alike_is_as_uncertain_as_they_are_apart() -> None:
    world, poses = colonnade(), drive([(-4.0, 0.0), (8.0, 0.0)])
    place_map, rng = mapped(world, poses[::2]), np.random.default_rng(5)
    relocaliser = Relocaliser(place_map, CONFIG)
    for pose in poses[40:60]:
        relocaliser.observe(world.scan(pose, rng), pose, 0.1)
    task = relocaliser.next_task()
    assert task is not None

    result = search_task(task, place_map, CONFIG)

    assert result is not None
    best = result.everything[0]
    near = fit_place(submap_of(task.everything), best.T_map_base, place_map, CONFIG.fit)
    assert near.sigma_m < 0.1  # the control: the next pillars alone seem to tell
    assert best.sigma_m > 0.2
    assert math.sqrt(best.covariance[1, 1]) < 0.1
