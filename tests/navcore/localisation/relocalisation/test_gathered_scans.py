"""What confirms a place: scans that show something, over some way, with enough points together."""

from __future__ import annotations

import math

import numpy as np

from navcore.config.localisation.relocalisation import DEFAULT_RELOCALISATION
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.relocalisation.gathered_scans import GatheredScans
from navcore.localisation.relocalisation.place_map import place_map_of
from navcore.localisation.relocalisation.relocalisation import SearchTask, search_task
from navcore.localisation.relocalisation.submap import submap_of
from navcore.localisation.scans.scan import Scan
from tests.navcore.localisation.plan_worlds import drive, office

WORLD = office(3)
WAY = drive([(1.5, 0.0), (5.0, 0.0)])


def gathered(most: int) -> GatheredScans:
    """What a robot has seen that has had no more than some points in view on its way."""
    seen = GatheredScans(config=DEFAULT_RELOCALISATION)
    for k, pose in enumerate(WAY):
        scan = WORLD.scan(pose, np.random.default_rng(k))
        seen.add(scan.part(np.arange(len(scan)) < most), pose)
    return seen


def test_a_handful_of_points_confirms_no_place_however_far_the_robot_has_come() -> None:
    everything = submap_of(gathered(50).everything)
    place_map = place_map_of(everything.points, everything.normals, DEFAULT_RELOCALISATION.search)
    for seen, tells in ((gathered(2), False), (gathered(50), True)):
        newest, has_only_turned = seen.newest(0)
        assert newest and not has_only_turned
        task = SearchTask(everything=seen.everything, recent=seen.recent, newest=newest)
        result = search_task(task, place_map)
        assert result is not None
        assert (result.newest is not None) is tells


def test_nor_do_a_few_recent_ones_move_a_robot_beside_its_place() -> None:
    many, few = gathered(50).everything, gathered(2).recent
    assert len(submap_of(few)) < DEFAULT_RELOCALISATION.search.least_points
    everything = submap_of(many)
    place_map = place_map_of(everything.points, everything.normals, DEFAULT_RELOCALISATION.search)
    for recent in (few, many):
        task = SearchTask(everything=many, recent=recent, given=IDENTITY)
        result = search_task(task, place_map)
        assert result is not None and result.given is not None
        assert (result.moved is None) is (recent is few)


def test_strokes_to_and_fro_show_one_position_however_many_metres_they_add_up_to() -> None:
    seen = GatheredScans(config=DEFAULT_RELOCALISATION)
    for k in range(60):
        pose = WAY[0] @ Pose2(x_m=0.15 * (-1) ** k, y_m=0.0, yaw_rad=0.14 * k)
        seen.add(WORLD.scan(pose, np.random.default_rng(k)), pose)
    assert seen.travel.driven_m > 2.0 * DEFAULT_RELOCALISATION.confirm_m
    assert seen.newest(0)[1]
    assert not gathered(50).newest(0)[1]


def empty() -> Scan:
    return WORLD.scan(WAY[0], np.random.default_rng(0)).emptied()


def test_a_turn_in_the_dark_shows_nothing_around_the_robot() -> None:
    seen = gathered(50)
    for turn in np.linspace(0.0, 2.0 * np.pi, 60):
        seen.add(empty(), WAY[-1] @ Pose2(x_m=0.0, y_m=0.0, yaw_rad=float(turn)))
    assert not seen.has_looked_round


def test_scans_are_forgotten_on_a_way_in_the_dark() -> None:
    seen = gathered(50)
    assert not seen.is_empty
    for x in np.arange(0.0, DEFAULT_RELOCALISATION.submap_m + 1.0, 0.1):
        seen.add(empty(), WAY[-1] @ Pose2(x_m=float(x), y_m=0.0, yaw_rad=0.0))
    assert seen.is_empty
    assert seen.newest(0) == ((), False)
    seen.add(WORLD.scan(IDENTITY, np.random.default_rng(0)), IDENTITY)
    assert seen.everything


def test_a_robot_that_turns_on_and_on_keeps_the_scans_of_the_last_turns() -> None:
    """Those of one turn show everything around it."""
    seen, turn_deg, kept = GatheredScans(config=DEFAULT_RELOCALISATION), 15.0, []
    for k in range(round(12 * 360.0 / turn_deg)):
        pose = Pose2(x_m=1.5, y_m=0.0, yaw_rad=math.radians(turn_deg * k))
        seen.add(WORLD.scan(pose, np.random.default_rng(k)), pose)
        kept.append(len(seen.everything))
    assert max(kept) == kept[-1] <= 3 * 360.0 / turn_deg + 1
    assert seen.has_looked_round
    assert seen.newest(0)[0] == seen.everything
