"""Loop closures on their way to the map."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig, TrackingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import IDENTITY, STANDSTILL, Pose2
from navcore.grid.grid import GridSpec
from navcore.localisation.graph.pose_graph import PoseGraph, optimise
from navcore.localisation.localisation import Localisation
from navcore.localisation.loops.loop_closure import LoopCandidates, LoopClosures
from navcore.localisation.map_correction import MapCorrection, PrepareCorrection
from navcore.localisation.tasks import PrepareSearch, TaskFailed
from navcore.mapping.point_map import PointMap
from navcore.robot.profile import HUSKY
from tests.navcore.localisation.starts import started
from tests.navcore.localisation.tracking.test_localiser import ROUTE, WORLD, frame_at


def empty_map() -> PointMap:
    spec = GridSpec.centred(size_m=(4.0, 4.0), resolution_m=0.1)
    return PointMap(spec, NavigatorConfig().map)


def test_the_robot_and_what_it_has_seen_since_move_with_the_loops_before() -> None:
    point_map, rng = empty_map(), np.random.default_rng(3)
    localisation = Localisation(point_map.pose_ids, LocalisationConfig(), HUSKY.depth_sensor)
    correction = MapCorrection(point_map, localisation, TrackingConfig())
    for k, pose in enumerate(ROUTE[:80]):
        here = localisation.follow(frame_at(pose, k), WORLD.scan(pose, rng)).T_map_base
    before = {one.pose_id: one.T_map_base for one in localisation.keyframes}
    closed = dict(list(before.items())[:-5])
    # A pose that is corrected as it is already moves by nothing at all, or by rounding alone.
    shifts = (Pose2(x_m=0.0, y_m=0.3, yaw_rad=0.5 + 1e-5 * k) for k in range(100_000))
    newest = list(closed.values())[-1]
    shift = next(s for s in shifts if (s @ newest) @ (s @ newest).inverse() == IDENTITY)
    poses = {pose_id: shift @ pose for pose_id, pose in closed.items()}
    localisation.closures = LoopClosures(
        poses=poses,
        loops=(),
        new_loops=(),
        candidates=LoopCandidates(edges=()),
        graph=optimise(PoseGraph(poses=poses, odometry=())),
    )
    task = correction.next_task()
    assert isinstance(task, PrepareCorrection)
    correction.take(task.run(lambda: False))
    assert correction.apply(here, STANDSTILL) is not None
    for one in localisation.keyframes:
        assert one.T_map_base == point_map.pose_ids[one.pose_id]
        assert one.T_map_base.y_m == pytest.approx((shift @ before[one.pose_id]).y_m)
    after = localisation.follow(frame_at(ROUTE[79], 80), WORLD.scan(ROUTE[79], rng).emptied())
    assert after.T_map_base.y_m == pytest.approx((shift @ here).y_m, abs=1e-4)


def test_a_search_that_fails_is_tried_again_once_the_robot_has_moved() -> None:
    point_map = empty_map()
    localisation = Localisation(point_map.pose_ids, LocalisationConfig(), HUSKY.depth_sensor)
    correction = MapCorrection(point_map, localisation, TrackingConfig())
    scan = WORLD.scan(ROUTE[0], np.random.default_rng(3))
    localisation.follow(frame_at(ROUTE[0], 0), scan)
    localisation.search(0)
    task = correction.next_task()
    assert isinstance(task, PrepareSearch)
    correction.take(TaskFailed(task=task))
    for k, pose in enumerate(ROUTE[:3], 1):
        estimate = localisation.follow(frame_at(pose, k), scan)
        assert correction.next_task() is None and "search failed" in estimate.reason
    for k, pose in enumerate(ROUTE[3:20], 4):
        estimate = localisation.follow(frame_at(pose, k), scan)
    assert isinstance(correction.next_task(), PrepareSearch) and not estimate.reason


def test_a_robot_that_becomes_lost_is_searched_although_a_search_before_has_failed() -> None:
    localisation, _, _ = started()
    correction = MapCorrection(empty_map(), localisation, TrackingConfig())
    task = correction.next_task()  # of the place, which is on trial
    assert isinstance(task, PrepareSearch)
    correction.take(TaskFailed(task=task))
    assert correction.next_task() is None
    here = ROUTE[40]
    elsewhere = WORLD.scan(here @ Pose2(x_m=0.5, y_m=0.0, yaw_rad=2.0), np.random.default_rng(3))
    for k in range(11, 60):
        estimate = localisation.follow(frame_at(here, k), elsewhere)
    assert estimate.is_lost and not estimate.reason
    assert isinstance(correction.next_task(), PrepareSearch)


def test_a_correction_that_fails_is_given_up_and_other_work_goes_on() -> None:
    localisation = SimpleNamespace(
        closures=object(), corrected=lambda _: ({}, None), next_task=lambda: "the next search"
    )
    point_map = empty_map()
    correction = MapCorrection(point_map, cast(Localisation, localisation), TrackingConfig())
    task = correction.next_task()
    assert isinstance(task, PrepareCorrection)
    assert correction.next_task() is None  # it waits for the outcome
    correction.take(TaskFailed(task=task))
    following: object = correction.next_task()
    assert following == "the next search"
