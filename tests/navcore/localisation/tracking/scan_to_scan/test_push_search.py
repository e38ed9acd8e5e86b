"""A robot that is pushed in a new map: the scans of before and after tell it, and by how much."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Pose2, difference, wrap_angle
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.graph.edges import Edge, in_parent_axes
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from navcore.localisation.tracking.localiser import Localiser
from navcore.localisation.tracking.odometry_model import OdometryMotion, OdometryStep
from navcore.localisation.tracking.pose_filter import PoseFilter
from navcore.localisation.tracking.scan_to_scan.push_search import PushSearch
from navcore.mapping.points.pose_ids import PoseIds
from tests.navcore.localisation.plan_worlds import PlanWorld
from tests.navcore.localisation.tracking.test_localiser import Trip, frame_at

AT = 30
"""Frame before which the robot is pushed."""
STANDS = [IDENTITY] * 60
DRIVES = [Pose2(x_m=0.08 * k, y_m=0.0, yaw_rad=0.0) for k in range(60)]
PUSHES = [
    Pose2(x_m=0.15, y_m=0.1, yaw_rad=0.05),
    Pose2(x_m=-0.3, y_m=0.2, yaw_rad=-0.1),
    Pose2(x_m=0.0, y_m=-0.4, yaw_rad=0.0),
]


def room() -> PlanWorld:
    """A corridor, 4 m wide, with furniture along both walls."""
    world = PlanWorld()
    world.wall((-2.0, -2.0), (9.0, -2.0))
    world.wall((-2.0, 2.0), (9.0, 2.0))
    world.wall((9.0, -2.0), (9.0, 2.0))
    for x in range(0, 9, 2):
        world.box(x, 1.3, x + 0.6, 2.0)
        world.box(x + 1.0, -2.0, x + 1.5, -1.2)
    return world


def followed(
    odometry: Sequence[Pose2], push: Pose2, world: PlanWorld | None = None, frames: int = 3
) -> tuple[list[LocalisationEstimate], list[Pose2]]:
    """Estimates and true poses of a robot that some frames push, which odometry does not tell."""
    part = Pose2(x_m=push.x_m / frames, y_m=push.y_m / frames, yaw_rad=push.yaw_rad / frames)
    true = [odometry[0]]
    for k, (before, after) in enumerate(itertools.pairwise(odometry), start=1):
        step = before.inverse() @ after
        true.append(true[-1] @ (part @ step if AT <= k < AT + frames else step))
    trip = Trip(Localiser(PoseIds(0.25, 10.0)))
    return [e for e, _ in trip.go(true, odometry, world or room())], true


def error_m(estimate: LocalisationEstimate, true: Pose2) -> float:
    """Distance of the estimate from the truth in metres."""
    return estimate.T_map_base.distance_to(true.x_m, true.y_m)


@pytest.mark.parametrize("odometry", [STANDS, DRIVES], ids=["standing", "driving"])
@pytest.mark.parametrize("push", PUSHES)
def test_a_robot_that_is_pushed_knows_by_how_much_within_a_second(
    odometry: list[Pose2], push: Pose2
) -> None:
    estimates, true = followed(odometry, push)
    told = [k for k, estimate in enumerate(estimates) if estimate.pushed_m > 0.0]
    assert told and AT <= told[0] <= AT + 8
    assert sum(estimates[k].pushed_m for k in told) == pytest.approx(
        math.hypot(push.x_m, push.y_m), abs=0.06
    )
    if odometry is STANDS:  # a robot that drives stands for a correction, which waits until then
        for estimate, there in zip(estimates[AT + 10 :], true[AT + 10 :], strict=True):
            assert error_m(estimate, there) < 0.05
            turn = wrap_angle(estimate.T_map_base.yaw_rad - there.yaw_rad)
            assert abs(turn) < math.radians(1.0)


@pytest.mark.parametrize("frames", [4, 8, 10])
def test_a_long_push_is_followed_until_it_is_over(frames: int) -> None:
    """Farther than a search reaches."""
    estimates, true = followed(STANDS, Pose2(x_m=0.0, y_m=0.8, yaw_rad=0.0), frames=frames)
    told = [estimate.pushed_m for estimate in estimates if estimate.pushed_m > 0.0]
    assert told == [pytest.approx(0.8, abs=0.05)]
    assert error_m(estimates[-1], true[-1]) < 0.05


@pytest.mark.parametrize(("step_m", "slip_m"), [(0.12, 0.8), (0.1, 1.0)])
def test_wheels_that_slip_for_seconds_leave_no_certain_wrong_place(
    step_m: float, slip_m: float
) -> None:
    drives = [Pose2(x_m=step_m * k, y_m=0.0, yaw_rad=0.0) for k in range(60)]
    slip = Pose2(x_m=-slip_m, y_m=0.0, yaw_rad=0.0)
    estimates, true = followed(drives, slip, frames=10)
    assert error_m(estimates[-1], true[-1]) < 3.0 * estimates[-1].sigma_m
    assert sum(estimate.pushed_m for estimate in estimates) > 0.3


@pytest.mark.parametrize("odometry", [STANDS, DRIVES], ids=["standing", "driving"])
def test_a_robot_that_is_not_pushed_is_told_of_none(odometry: list[Pose2]) -> None:
    estimates, _ = followed(odometry, IDENTITY)
    assert not any(estimate.pushed_m for estimate in estimates)


def test_a_push_after_the_clock_was_set_back_is_told() -> None:
    trip, there = Trip(Localiser(PoseIds(0.25, 10.0)), k=500), STANDS[:10]
    for _ in trip.go(there, there, room()):
        pass
    trip.k = 0
    trip.localiser.place(IDENTITY, 0.001 * np.eye(3), frame_at(IDENTITY, 0))
    true = [IDENTITY] * 5 + [PUSHES[1]] * 15
    told = [one.pushed_m for one, _ in trip.go(true, [IDENTITY] * 20, room())]
    assert any(told)


def test_without_the_search_a_pushed_robot_would_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PushSearch, "find", lambda *_: None)
    estimates, true = followed(STANDS, PUSHES[1])
    assert error_m(estimates[-1], true[-1]) > 0.25


def test_along_a_bare_wall_no_push_is_made_up_and_across_it_is_told() -> None:
    world = PlanWorld()
    world.wall((-40.0, 2.0), (40.0, 2.0))
    facing = [Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi / 2)] * 60
    for push in (Pose2(x_m=0.0, y_m=0.3, yaw_rad=0.0), Pose2(x_m=0.3, y_m=0.0, yaw_rad=0.0)):
        estimates, true = followed(facing, push, world)
        error = estimates[-1].T_map_base.inverse() @ true[-1]
        told = any(estimate.pushed_m for estimate in estimates)
        assert told == (push.x_m > 0.0)
        assert abs(error.x_m) < 0.03  # the camera looks across the wall
        if told:  # along it the push may have been as large as any
            assert math.sqrt(estimates[-1].covariance[0, 0]) > 0.1


def pushes_by_a_group(config: LocalisationConfig) -> list[float]:
    """The pushes that are told to a robot that stands in a hall, where three people who have stood
    before it begin to walk together."""
    trip, told = Trip(Localiser(PoseIds(0.25, 10.0), config)), []
    for k in range(AT + 6):
        world, walked_m = PlanWorld(), 0.28 * max(k - AT - 2, 0)
        world.box(4.2, 1.0, 4.6, 1.4)
        for x, y in ((1.6, -0.8), (2.4, -0.2), (3.6, -1.6)):
            world.box(x, y + walked_m, x + 0.45, y + walked_m + 0.45)
        told += [estimate.pushed_m for estimate, _ in trip.go([IDENTITY], [IDENTITY], world)]
    return told


def test_people_who_walk_together_before_the_robot_do_not_push_it() -> None:
    config = LocalisationConfig()
    assert not any(pushes_by_a_group(config))
    # Control: it would be told of one if the push did not have to be over.
    at_once = replace(config.scan_odometry, over_m=1.0, over_deg=90.0)
    assert any(pushes_by_a_group(replace(config, scan_odometry=at_once)))


@pytest.mark.parametrize("heading_deg", [30.0, 34.0])
def test_more_of_a_wall_that_comes_into_view_by_a_turn_is_no_push(heading_deg: float) -> None:
    """Along the wall a motion would bring all that is seen now onto what was seen before."""
    world, config, rng = PlanWorld(), LocalisationConfig(), np.random.default_rng(0)
    world.wall((-6.0, 1.29), (1.64, 1.29))
    world.wall((3.0, 3.2), (5.0, 1.4))
    before = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.radians(heading_deg))
    turned = before @ Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.45)
    reference = ScanMap(config.match)
    first = Keyframe(pose_id=0, T_map_base=IDENTITY, scan=world.scan(before, rng))
    reference.put(first)
    own = PoseFilter(before, config.odometry)
    own.refer()
    own.predict(OdometryStep.between(before, turned, 0.5))
    assert PushSearch(config).find(world.scan(turned, rng), reference, own) is None


def test_what_fits_elsewhere_by_chance_is_no_push_where_the_far_wall_is_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two scans of the simulated camera, 1 m apart: most of what the second shows is at the end of
    its range in the first, and a corner and a table, which are not, fit 0.55 m beside."""
    kept = np.load(Path(__file__).with_name("far_wall.npz"))
    before, after = (
        Scan(
            points_base=kept[f"{name}_points"].astype(np.float64),
            variance_m2=kept[f"{name}_variances"].astype(np.float64),
            normals=kept[f"{name}_normals"].astype(np.float64),
            origin=kept[f"{name}_origin"],
        )
        for name in ("before", "after")
    )
    config, (x_m, y_m, yaw_rad) = LocalisationConfig(), kept["motion"].tolist()
    reference = ScanMap(replace(config.match, fine_m=config.scan_odometry.window_m))
    reference.put(Keyframe(pose_id=0, T_map_base=IDENTITY, scan=before))
    own = PoseFilter(IDENTITY, config.odometry)
    motion = Pose2(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
    monkeypatch.setattr(PoseFilter, "motion", motion)
    monkeypatch.setattr(PoseFilter, "motion_covariance", kept["covariance"])
    assert PushSearch(config).find(after, reference, own) is None
    # Control: by what was in view at the expected motion alone it would be told.
    monkeypatch.setattr(PushSearch, "_is_seen_from", lambda *_: True)
    assert PushSearch(config).find(after, reference, own) is not None


def test_filter_and_edge_go_on_by_the_push() -> None:
    push = Pose2(x_m=0.2, y_m=-0.1, yaw_rad=0.3)
    spread = np.diag([0.02, 0.03, 0.01]) ** 2
    start = Pose2(x_m=1.0, y_m=2.0, yaw_rad=0.7)
    own, motion = PoseFilter(start), OdometryMotion(start)
    for each in (own, motion):
        each.push(push, spread)
    there = start @ push
    np.testing.assert_allclose(difference(own.pose, there), 0.0, atol=1e-12)
    expected = in_parent_axes(there, spread)
    for covariance in (own.covariance, own.covariance_by_motion, own.covariance_within):
        np.testing.assert_allclose(covariance, expected, atol=1e-6)
    np.testing.assert_allclose(own.motion_covariance, 0.0, atol=1e-6)  # the reference is here
    measured, noise, _ = motion.to(IDENTITY)
    np.testing.assert_allclose(difference(measured, there), 0.0, atol=1e-12)
    np.testing.assert_allclose(noise, spread, atol=1e-6)


def test_an_earlier_error_of_heading_swings_the_push() -> None:
    own = PoseFilter(IDENTITY)
    own.place(IDENTITY, np.diag([0.0, 0.0, 0.1]) ** 2)
    own.push(Pose2(x_m=0.5, y_m=0.0, yaw_rad=0.0), np.zeros((3, 3)))
    assert math.sqrt(own.covariance[1, 1]) == pytest.approx(0.05, rel=1e-2)
    own.predict(OdometryStep(along_m=0.1, aside_m=0.0, turn_rad=0.0, duration_s=0.1))
    assert own.pose.x_m == pytest.approx(0.6, abs=1e-6)


def test_a_push_is_part_of_the_edge_between_keyframes() -> None:
    trip = Trip(Localiser(PoseIds(0.25, 10.0)))
    stops = [*DRIVES[:AT], *[DRIVES[AT]] * 10, *DRIVES[AT:]]
    true = [*stops[: AT + 1], *(Pose2(x_m=p.x_m, y_m=0.3, yaw_rad=0.0) for p in stops[AT + 1 :])]
    edges: list[Edge] = []
    for _ in trip.go(true, stops, room()):
        edges += trip.localiser.take_edges()
    assert len(edges) > 10
    by_odometry = [edge for edge in edges if edge.by_constant_errors.any()]
    assert sum(edge.T_from_to.y_m for edge in by_odometry) == pytest.approx(0.3, abs=0.05)
