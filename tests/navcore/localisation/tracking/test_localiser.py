"""The localiser as a whole, in worlds seen from above."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from navcore.config.localisation.localisation import OdometryConfig
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import IDENTITY, Matrix, Pose2, Twist, difference, wrap_angle
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.scans.scan import Keyframe
from navcore.localisation.tracking.localiser import Localiser
from navcore.localisation.tracking.scan_to_scan.recent_scans import RecentScans
from navcore.localisation.tracking.scan_to_scan.scan_odometry import ScanOdometry
from navcore.mapping.points.pose_ids import PoseIds
from navcore.robot.fix import FixSource, PositionFix
from navcore.robot.frame import Frame
from tests.navcore.localisation.plan_worlds import PlanWorld, drive, office

WORLD = office(3)
LENS = Intrinsics(width=8, height=6, fx=5.0, fy=5.0, cx=3.5, cy=2.5)
PERIOD_S = 0.2
ROUTE = drive([(1.5, 0.0), (22.0, 0.0)])


def frame_at(pose: Pose2, k: int) -> Frame:
    """A frame that carries nothing but odometry."""
    return Frame(
        stamp_ns=round(k * PERIOD_S * 1e9),
        rgb=np.zeros((6, 8, 3), dtype=np.uint8),
        depth_m=np.ones((6, 8), dtype=np.float32),
        intrinsics=LENS,
        T_base_camera=np.eye(4),
        pose=pose,
        twist=Twist(v_mps=0.5, w_radps=0.0),
    )


def odometry_of(
    true: Sequence[Pose2], *, scale: float = 1.0, gyro: float = 1.0, start: Pose2 | None = None
) -> list[Pose2]:
    """Odometry with constant errors of length and turns."""
    poses = [start or true[0]]
    for before, after in itertools.pairwise(true):
        step = before.inverse() @ after
        poses.append(
            poses[-1]
            @ Pose2(x_m=scale * step.x_m, y_m=scale * step.y_m, yaw_rad=gyro * step.yaw_rad)
        )
    return poses


@dataclass
class Trip:
    """A localiser that is fed frame by frame."""

    localiser: Localiser
    k: int = 0

    def go(
        self,
        true: Sequence[Pose2],
        odometry: Sequence[Pose2],
        world: PlanWorld = WORLD,
    ) -> Iterator[tuple[LocalisationEstimate, Pose2]]:
        """Yield the estimate and the true pose of each frame."""
        for pose, measured in zip(true, odometry, strict=True):
            scan = world.scan(pose, np.random.default_rng((7, self.k)))
            yield self.localiser.follow(frame_at(measured, self.k), scan), pose
            self.k += 1


def new_trip() -> Trip:
    """A robot that starts without a map."""
    return Trip(Localiser(PoseIds(0.25, 10.0)))


def saved_map() -> tuple[Keyframe, ...]:
    """Keyframes of a drive along the corridor with exact odometry."""
    trip = new_trip()
    for _ in trip.go(ROUTE, ROUTE):
        pass
    return trip.localiser.keyframes


KEYFRAMES = saved_map()


def saved_trip(keyframes: tuple[Keyframe, ...]) -> Trip:
    """A robot in a saved map."""
    ids = PoseIds(0.25, 10.0)
    poses = [k.T_map_base for k in keyframes]
    ids.restore(np.array([[pose.x_m, pose.y_m, pose.yaw_rad] for pose in poses]), "")
    localiser = Localiser(ids)
    localiser.load(keyframes)
    return Trip(localiser)


def located_trip() -> Trip:
    """A robot in the saved map."""
    return saved_trip(KEYFRAMES)


def away_m(estimate: LocalisationEstimate, true: Pose2) -> float:
    """Distance of the estimate from the true position in metres."""
    return estimate.T_map_base.distance_to(true.x_m, true.y_m)


def test_without_a_map_the_pose_begins_as_odometry_and_stays_near_it() -> None:
    results = list(new_trip().go(ROUTE, ROUTE))

    assert results[0][0].T_map_odom == IDENTITY
    assert max(away_m(estimate, true) for estimate, true in results) < 0.2
    sigmas = [estimate.sigma_m for estimate, _ in results]
    for (estimate, true), sigma_m in zip(results, sigmas, strict=True):
        # The own map tells lengths, and nothing else that would make the place more certain.
        driven_m = true.distance_to(ROUTE[0].x_m, ROUTE[0].y_m)
        assert sigma_m >= 0.99 * OdometryConfig().length_floor * driven_m
        assert away_m(estimate, true) <= 3 * sigma_m + 0.01
    assert all(estimate.is_known for estimate, _ in results)


def test_a_robot_that_comes_back_is_as_certain_as_it_was_there() -> None:
    """Out along a corridor, round, and back: by motion alone it would only become less certain."""
    true = drive([(1.5, 0.0), (16.0, 0.0), (3.0, 0.0), (8.0, 0.0)])
    middle = [k for k, pose in enumerate(true) if abs(pose.x_m - 6.0) < 0.06]
    out, again = middle[0], middle[-1]
    squares = []
    for scale, gyro in ((1.015, 1.005), (0.98, 0.99), (1.0, 1.01), (1.02, 1.0)):
        trip = list(new_trip().go(true, odometry_of(true, scale=scale, gyro=gyro)))
        first, last = trip[out][0], trip[again][0]
        assert last.covariance_by_motion is not None
        by_motion_m = np.sqrt(np.diag(last.covariance_by_motion)[:2])
        assert last.sigma_m < 1.5 * first.sigma_m + 0.02
        assert last.sigma_m < 0.6 * by_motion_m.max()
        for estimate, pose in trip[1:]:
            error = difference(estimate.T_map_base, pose)
            squares.append(error @ np.linalg.solve(estimate.covariance, error))
    assert np.mean(squares) < 3.0 and np.max(squares) < 16.3


def share_of_error_left() -> float:
    """Error at the end of 20 m in a new map, as a share of that of wheels that measure 2 % too
    much."""
    odometry = odometry_of(ROUTE, scale=1.02)
    by_odometry_m = odometry[-1].distance_to(ROUTE[-1].x_m, ROUTE[-1].y_m)
    return away_m(*list(new_trip().go(ROUTE, odometry))[-1]) / by_odometry_m


def test_in_a_new_map_scans_tell_the_scale_of_the_wheels() -> None:
    assert share_of_error_left() < 0.6


def test_without_the_motion_by_scans_the_wheels_are_believed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ScanOdometry, "follow", lambda *_: None)

    assert share_of_error_left() > 0.75


def test_in_a_saved_map_poor_odometry_does_no_harm() -> None:
    start = ROUTE[10]
    odometry = odometry_of(ROUTE[10:], scale=1.02, start=start)
    assert odometry[-1].distance_to(ROUTE[-1].x_m, ROUTE[-1].y_m) > 0.3

    results = list(located_trip().go(ROUTE[10:], odometry))

    aside = [abs(estimate.T_map_base.y_m - true.y_m) for estimate, true in results]
    assert np.percentile(aside, 95) < 0.03
    assert np.percentile([away_m(*result) for result in results], 95) < 0.15
    located = [e.state is LocalisationState.LOCATED for e, _ in results]
    assert np.mean(located) > 0.9


def test_along_bare_walls_the_pose_is_as_uncertain_as_odometry_makes_it() -> None:
    """Far points, which show no line, would else tell a way that nothing tells."""
    bare = PlanWorld()
    bare.wall((-30.0, 1.0), (60.0, 1.0))
    bare.wall((-30.0, -1.0), (60.0, -1.0))
    way = drive([(0.0, 0.0), (20.0, 0.0)])
    first = new_trip()
    for _ in first.go(way, way, bare):
        pass
    trip = saved_trip(first.localiser.keyframes)
    for estimate, true in trip.go(way, odometry_of(way, scale=1.02), bare):
        error_m = estimate.T_map_base.x_m - true.x_m
        assert abs(error_m) <= 2.0 * math.sqrt(estimate.covariance[0, 0]) + 0.01
        assert abs(estimate.T_map_base.y_m) < 0.03
    assert math.sqrt(estimate.covariance[0, 0]) > 0.2


def test_the_saved_map_stays_as_it_was() -> None:
    trip = located_trip()
    before = trip.localiser.saved_map.surfaces
    for _ in trip.go(ROUTE, odometry_of(ROUTE, scale=1.01)):
        pass
    trip.localiser.correct({0: Pose2(x_m=5.0, y_m=5.0, yaw_rad=1.0)})

    assert np.array_equal(trip.localiser.saved_map.surfaces, before)


def test_a_robot_that_was_carried_off_is_lost_until_it_is_placed() -> None:
    trip = located_trip()
    for _ in trip.go(ROUTE[:60], ROUTE[:60]):
        pass
    # Into a room, turned round, while odometry goes on.
    there = [Pose2(x_m=8.0 + 0.1 * k, y_m=3.0, yaw_rad=wrap_angle(2.5)) for k in range(40)]
    odometry = [ROUTE[60] @ Pose2(x_m=0.1 * k, y_m=0.0, yaw_rad=0.0) for k in range(40)]
    results = list(trip.go(there, odometry))

    lost = [e.state is LocalisationState.LOST for e, _ in results]
    assert any(lost[:21])  # within 2 m
    assert all(lost[21:])  # and it does not go on by itself

    frame = frame_at(odometry[-1], trip.k - 1)
    trip.localiser.place(ROUTE[60], np.diag([0.05, 0.05, 0.02]) ** 2, frame)
    onward = [odometry[-1] @ (ROUTE[60].inverse() @ pose) for pose in ROUTE[60:80]]
    back = list(trip.go(ROUTE[60:80], onward))
    assert back[-1][0].state is LocalisationState.LOCATED
    assert abs(back[-1][0].T_map_base.y_m - ROUTE[79].y_m) < 0.05


THERE = [Pose2(x_m=8.0 + 0.1 * k, y_m=3.0, yaw_rad=wrap_angle(2.5)) for k in range(30)]
"""A way through a room that the robot does not know."""


def carried_off_in_a_new_map(trip: Trip) -> list[bool]:
    """Whether the robot is lost in each frame after it was carried into a room, where its own map
    knows nothing, while odometry goes on."""
    for _ in trip.go(ROUTE[:60], ROUTE[:60]):
        pass
    odometry = [ROUTE[60] @ Pose2(x_m=0.1 * k, y_m=0.0, yaw_rad=0.0) for k in range(30)]
    return [e.state is LocalisationState.LOST for e, _ in trip.go(THERE, odometry)]


@pytest.mark.parametrize("moved_m", [0.0, 2.0])
def test_one_contradicting_frame_after_a_gap_loses_no_robot(moved_m: float) -> None:
    """A person may stand before the camera when the lens is free again."""
    trip = located_trip()
    list(trip.go(ROUTE[:60], ROUTE[:60]))
    there = ROUTE[60] @ Pose2(x_m=moved_m, y_m=0.0, yaw_rad=0.0)
    elsewhere = Pose2(x_m=there.x_m + 7.3, y_m=0.0, yaw_rad=1.2)
    trip.k += 25
    ((doubted, _),) = trip.go([elsewhere], [there])
    ((after, _),) = trip.go([there], [there])
    assert doubted.state is LocalisationState.DEAD_RECKONING
    assert after.state is LocalisationState.LOCATED


def test_a_robot_that_was_carried_off_in_its_new_map_is_lost() -> None:
    trip = new_trip()
    lost = carried_off_in_a_new_map(trip)
    assert any(lost[:21])  # within 2 m
    assert all(lost[21:])

    # Once it is told where it is, it goes on with its map.
    steps = [Pose2(x_m=0.03 * k, y_m=0.0, yaw_rad=0.0) for k in range(30)]
    onward = [ROUTE[60] @ Pose2(x_m=2.9, y_m=0.0, yaw_rad=0.0) @ step for step in steps]
    way = [THERE[-1] @ step for step in steps]
    keyframes = len(trip.localiser.keyframes)
    trip.localiser.place(way[0], None, frame_at(onward[0], trip.k))
    assert not any(e.state is LocalisationState.LOST for e, _ in trip.go(way, onward))
    assert len(trip.localiser.keyframes) > keyframes


def test_by_its_own_map_alone_it_would_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RecentScans, "are_continued", lambda *_: None)
    assert not any(carried_off_in_a_new_map(new_trip()))


def test_without_enough_points_the_robot_reckons_and_its_uncertainty_grows() -> None:
    results = list(new_trip().go(ROUTE[:50], ROUTE[:50], PlanWorld([(90.0, 90.0, 91.0, 91.0)])))

    estimate = results[-1][0]
    assert estimate.state is LocalisationState.DEAD_RECKONING
    assert estimate.match_share is None
    assert estimate.since_m == pytest.approx(4.9, abs=0.01)
    assert estimate.sigma_m > results[10][0].sigma_m


def fix_at(x_m: float, y_m: float, covariance: Matrix, stamp_ns: int = 0) -> PositionFix:
    return PositionFix(
        stamp_ns=stamp_ns, x_m=x_m, y_m=y_m, covariance=covariance[:2, :2], source=FixSource.GNSS
    )


def test_a_position_fix_is_fused_and_one_far_off_is_refused() -> None:
    trip = new_trip()
    empty = PlanWorld([(90.0, 90.0, 91.0, 91.0)])
    for _ in trip.go(ROUTE, odometry_of(ROUTE, scale=1.01), empty):
        pass
    frame, true = frame_at(odometry_of(ROUTE, scale=1.01)[-1], trip.k - 1), ROUTE[-1]
    accurate = np.eye(2) * 0.02**2

    assert not trip.localiser.fuse(fix_at(true.x_m + 3.0, true.y_m, accurate, frame.stamp_ns))
    assert away_m(trip.localiser.estimate(frame), true) > 0.15
    assert trip.localiser.fuse(fix_at(true.x_m, true.y_m, accurate, frame.stamp_ns))
    assert trip.localiser.pending is None
    scan = empty.scan(true, np.random.default_rng(1))
    for k in range(12):
        standing = frame_at(frame.pose, trip.k + k)
        estimate = trip.localiser.follow(standing, scan)
    assert away_m(estimate, true) < 0.03
    assert estimate.sigma_m < 0.03


def test_a_fix_is_of_its_own_time_and_odometry_tells_the_way_since() -> None:
    """On a circle, at 1 m/s, half a frame before the image that brings it."""
    trip, step = new_trip(), Pose2(x_m=0.1, y_m=0.0, yaw_rad=0.05)
    scan = PlanWorld([(90.0, 90.0, 91.0, 91.0)]).scan(IDENTITY, np.random.default_rng(1))
    pose = IDENTITY
    for k in range(40):
        half = pose @ step if k else pose
        pose = half @ step if k else pose
        estimate = trip.localiser.follow(frame_at(pose, k), scan)
        stamp_ns = round((k - 0.5) * PERIOD_S * 1e9)
        assert trip.localiser.fuse(fix_at(half.x_m, half.y_m, np.eye(2) * 0.02**2, stamp_ns)) == (
            k > 0
        )
    assert away_m(estimate, pose) < 0.01
    assert abs(estimate.T_map_base.yaw_rad - pose.yaw_rad) < 0.01
    assert not trip.localiser.fuse(fix_at(0.0, 0.0, np.eye(2), round(30 * PERIOD_S * 1e9)))


def fixes_after_a_push(scatter_m: float, seconds: float) -> list[bool]:
    """Which fixes are believed after a robot with accurate fixes was pushed aside by 1.1 m; those
    of odd frames are `scatter_m` off."""
    trip, empty = new_trip(), PlanWorld([(90.0, 90.0, 91.0, 91.0)])
    accurate, believed = np.eye(2) * 0.02**2, []
    scan = empty.scan(IDENTITY, np.random.default_rng(1))
    for k in range(10 + round(seconds / PERIOD_S)):
        pose = Pose2(x_m=0.1 * k, y_m=0.0, yaw_rad=0.0)
        trip.localiser.follow(frame_at(pose, k), scan)
        aside_m = 1.1 + scatter_m * (k % 2) if k >= 10 else 0.0
        fix = fix_at(pose.x_m, aside_m, accurate, round(k * PERIOD_S * 1e9))
        believed.append(trip.localiser.fuse(fix))
    assert all(believed[:10])
    return believed[10:]


def test_fixes_that_agree_for_seconds_are_believed_and_the_robot_was_pushed() -> None:
    believed = fixes_after_a_push(0.0, 6.0)
    refused = believed.index(True)
    assert refused * PERIOD_S == pytest.approx(3.0, abs=0.3)
    assert all(believed[refused:])


def test_fixes_that_disagree_and_short_disturbances_are_not_believed() -> None:
    assert not any(fixes_after_a_push(2.0, 8.0))
    assert not any(fixes_after_a_push(0.0, 2.5))


def test_consecutive_keyframes_have_edges_by_odometry_and_by_scans() -> None:
    trip = new_trip()
    for _ in trip.go(ROUTE, ROUTE):
        pass
    edges = trip.localiser.take_edges()
    poses = {k.pose_id: k.T_map_base for k in trip.localiser.keyframes}

    assert trip.localiser.take_edges() == ()
    by_odometry = [edge for edge in edges if edge.by_constant_errors.any()]
    assert len(by_odometry) == len(poses) - 1
    assert len(by_odometry) >= len(edges) - len(by_odometry) > 0.8 * len(by_odometry)
    for edge in edges:
        true = poses[edge.from_id].inverse() @ poses[edge.to_id]
        error = np.array(
            [
                edge.T_from_to.x_m - true.x_m,
                edge.T_from_to.y_m - true.y_m,
                wrap_angle(edge.T_from_to.yaw_rad - true.yaw_rad),
            ]
        )
        assert error @ np.linalg.solve(edge.covariance, error) < 30.0
        assert math.hypot(*error[:2]) < 0.15


def test_no_edge_leads_on_from_keyframes_that_were_moved_without_the_robot() -> None:
    trip = new_trip()
    for _ in trip.go(ROUTE[:40], ROUTE[:40]):
        pass
    shift = Pose2(x_m=0.0, y_m=0.3, yaw_rad=0.0)
    moved = {one.pose_id: shift @ one.T_map_base for one in trip.localiser.keyframes}
    trip.localiser.move_keyframes(moved)
    trip.localiser.take_edges()
    for _ in trip.go(ROUTE[40:60], ROUTE[40:60]):
        pass
    edges = trip.localiser.take_edges()
    assert edges and not any(edge.from_id in moved for edge in edges)


def test_after_a_correction_of_keyframes_the_robot_is_as_uncertain_as_it_has_become_since() -> None:
    trip, dark = new_trip(), PlanWorld([(90.0, 90.0, 91.0, 91.0)])
    *_, (then, _) = trip.go(ROUTE[:60], ROUTE[:60])
    newest = trip.localiser.keyframes[-1]
    *_, (now, _) = trip.go(ROUTE[60:], ROUTE[60:], dark)
    known = newest.pose_id, 1e-6 * np.eye(3)
    trip.localiser.correct({newest.pose_id: newest.T_map_base}, known)
    corrected = trip.localiser.estimate(frame_at(ROUTE[-1], trip.k - 1))
    assert now.sigma_m > then.sigma_m + 0.05
    grown = (now.covariance - then.covariance)[0, 0]
    assert corrected.covariance[0, 0] == pytest.approx(grown, rel=0.1)
    # Another loop that ends at the same keyframe takes nothing of the way since.
    trip.localiser.correct({newest.pose_id: newest.T_map_base}, known)
    again = trip.localiser.estimate(frame_at(ROUTE[-1], trip.k - 1))
    assert again.covariance[0, 0] == pytest.approx(grown, rel=0.1)


def test_a_fix_since_a_keyframe_takes_nothing_of_the_way_since_then() -> None:
    covariances = []
    for is_fixed in (False, True):
        trip, dark = new_trip(), PlanWorld([(90.0, 90.0, 91.0, 91.0)])
        for _ in trip.go(ROUTE[:60], ROUTE[:60]):
            pass
        newest = trip.localiser.keyframes[-1]
        for _ in trip.go(ROUTE[60:], ROUTE[60:], dark):
            pass
        if is_fixed:
            there = fix_at(
                ROUTE[-1].x_m,
                ROUTE[-1].y_m,
                1e-4 * np.eye(2),
                frame_at(IDENTITY, trip.k - 1).stamp_ns,
            )
            assert trip.localiser.fuse(there)
        known = newest.pose_id, 1e-6 * np.eye(3)
        trip.localiser.correct({newest.pose_id: newest.T_map_base}, known)
        covariances.append(trip.localiser.estimate(frame_at(ROUTE[-1], trip.k - 1)).covariance)
    without, with_fix = covariances
    assert with_fix[0, 0] > 0.9 * without[0, 0]


def test_a_correction_moves_keyframes_and_robot_alike() -> None:
    trip = new_trip()
    for _ in trip.go(ROUTE[:100], ROUTE[:100]):
        pass
    before = {k.pose_id: k.T_map_base for k in trip.localiser.keyframes}
    shift = Pose2(x_m=0.3, y_m=-0.2, yaw_rad=0.05)

    trip.localiser.correct({pose_id: shift @ pose for pose_id, pose in before.items()})

    after = {k.pose_id: k.T_map_base for k in trip.localiser.keyframes}
    assert all(after[i] == shift @ before[i] for i in before)
    scan = WORLD.scan(ROUTE[99], np.random.default_rng(1))
    for k in range(3):
        estimate = trip.localiser.follow(frame_at(ROUTE[99], trip.k + k), scan)
    assert away_m(estimate, shift @ ROUTE[99]) < 0.03
