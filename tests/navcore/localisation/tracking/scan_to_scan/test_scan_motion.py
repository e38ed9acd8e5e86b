"""The motion between two scans, and the edges that it gives to the pose graph."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.graph.edges import ConstantErrors
from navcore.localisation.tracking.keyframe_chain import KeyframeChain
from navcore.localisation.tracking.odometry_model import OdometryStep
from navcore.localisation.tracking.scan_to_scan.scan_motion import ScanReference
from navcore.mapping.points.pose_ids import PoseIds
from tests.navcore.localisation.plan_worlds import PlanWorld
from tests.navcore.localisation.tracking.scan_to_scan.test_push_search import room

CONFIG = LocalisationConfig()
TRUE = Pose2(x_m=0.5, y_m=0.05, yaw_rad=math.radians(6.0))
SURE = np.diag([0.01, 0.01, 0.002]) ** 2


def apart(pose: Pose2, other: Pose2) -> tuple[float, float]:
    """Distance in metres and angle in degrees between two poses."""
    error = pose.inverse() @ other
    return math.hypot(error.x_m, error.y_m), abs(math.degrees(error.yaw_rad))


def corridor() -> PlanWorld:
    """Two walls without an end."""
    world = PlanWorld()
    world.wall((-20.0, -1.0), (20.0, -1.0))
    world.wall((-20.0, 1.0), (20.0, 1.0))
    return world


@pytest.mark.parametrize(
    ("error", "sigmas"),
    [
        (Pose2(x_m=0.01, y_m=-0.01, yaw_rad=0.005), (0.01, 0.01, 0.005)),
        # Beyond where surfaces are looked for: all places within the uncertainty are tried.
        (Pose2(x_m=0.25, y_m=-0.15, yaw_rad=math.radians(12.0)), (0.15, 0.15, math.radians(7.0))),
        (Pose2(x_m=-0.2, y_m=0.2, yaw_rad=math.radians(-14.0)), (0.15, 0.15, math.radians(7.0))),
    ],
)
def test_scans_measure_a_motion_as_far_as_odometry_may_err(
    error: Pose2, sigmas: tuple[float, float, float]
) -> None:
    rng, world = np.random.default_rng(1), room()
    reference = ScanReference(world.scan(IDENTITY, rng), CONFIG)
    found = reference.motion_to(world.scan(TRUE, rng), TRUE @ error, np.diag(sigmas) ** 2)
    assert found is not None
    motion, covariance = found.located()
    away_m, away_deg = apart(motion, TRUE)
    assert away_m < 0.02 and away_deg < 0.3
    assert math.sqrt(covariance[0, 0]) < 0.05 and math.sqrt(covariance[2, 2]) < math.radians(1.0)


def test_a_scan_of_another_place_measures_no_motion() -> None:
    rng = np.random.default_rng(1)
    reference = ScanReference(room().scan(IDENTITY, rng), CONFIG)
    beside = Pose2(x_m=6.0, y_m=1.0, yaw_rad=math.radians(75.0))
    assert reference.motion_to(room().scan(beside, rng), TRUE, SURE) is None
    few = room().scan(TRUE, rng)
    few = few.part(np.arange(len(few)) < CONFIG.match.min_points - 1)
    assert reference.motion_to(few, TRUE, SURE) is None


def test_along_a_corridor_the_motion_stays_as_expected_and_uncertain() -> None:
    rng, along = np.random.default_rng(1), Pose2(x_m=0.5, y_m=0.0, yaw_rad=0.0)
    reference = ScanReference(corridor().scan(IDENTITY, rng), CONFIG)
    expected = along @ Pose2(x_m=0.02, y_m=0.0, yaw_rad=0.0)
    found = reference.motion_to(corridor().scan(along, rng), expected, SURE)
    assert found is not None
    motion, covariance = found.located()
    assert motion.x_m == pytest.approx(expected.x_m, abs=0.02)
    assert covariance[0, 0] > 4 * covariance[1, 1]


@pytest.mark.parametrize("away_m", [1.5, 2.5])
@pytest.mark.parametrize("error_m", [-0.25, -0.1, 0.1, 0.25])
def test_between_equal_doors_scans_bring_the_motion_no_farther_from_the_truth(
    away_m: float, error_m: float
) -> None:
    world, rng = PlanWorld(), np.random.default_rng(2)
    for x, side in itertools.product(np.arange(-2.5, 40.0, 2.5).tolist(), (1.0, -1.0)):
        world.box(x, 0.9 * side, x + 1.6, 1.2 * side)
        world.box(x + 1.6, 1.05 * side, x + 2.5, 1.2 * side)
    reference = ScanReference(world.scan(IDENTITY, rng), CONFIG)
    along = Pose2(x_m=away_m, y_m=0.0, yaw_rad=0.02)
    expected = along @ Pose2(x_m=error_m, y_m=0.02, yaw_rad=0.0)
    spread = np.diag([0.12, 0.08, 0.02]) ** 2
    found = reference.motion_to(world.scan(along, rng), expected, spread)
    assert found is not None
    motion, _ = found.located()
    assert abs(motion.x_m - along.x_m) < abs(error_m) + 0.02


def test_keyframes_are_connected_by_odometry_and_by_their_scans() -> None:
    rng, world, chain = np.random.default_rng(1), room(), KeyframeChain(PoseIds(0.25, 10.0), CONFIG)
    known = ConstantErrors(mean=np.zeros(3), covariance=np.diag([1e-3, 0.02, 0.2]) ** 2)
    chain.add(world.scan(IDENTITY, rng), IDENTITY, 0, constant_errors=known)
    # A gyro that errs by a tenth: of 20° odometry tells 22.
    true = Pose2(x_m=0.3, y_m=0.0, yaw_rad=math.radians(20.0))
    measured = Pose2(x_m=0.3, y_m=0.0, yaw_rad=math.radians(22.0))
    chain.advance(OdometryStep.between(IDENTITY, measured, 1.0))
    chain.add(world.scan(true, rng), measured, 10**9, constant_errors=known)
    by_odometry, by_scans = chain.take_edges()
    assert {(edge.from_id, edge.to_id) for edge in (by_odometry, by_scans)} == {(0, 1)}
    assert apart(by_odometry.T_from_to, true)[1] == pytest.approx(2.0, abs=0.1)
    away_m, away_deg = apart(by_scans.T_from_to, true)
    assert away_m < 0.03 and away_deg < 0.3
    assert not by_scans.by_constant_errors.any() and by_odometry.by_constant_errors.any()


def test_no_edge_by_scans_that_odometry_excludes() -> None:
    rng, world, chain = np.random.default_rng(1), room(), KeyframeChain(PoseIds(0.25, 10.0), CONFIG)
    known = ConstantErrors(mean=np.zeros(3), covariance=np.diag([1e-6, 1e-4, 1e-4]) ** 2)
    chain.add(world.scan(IDENTITY, rng), IDENTITY, 0, constant_errors=known)
    measured = Pose2(x_m=0.4, y_m=0.0, yaw_rad=0.0)
    chain.advance(OdometryStep.between(IDENTITY, measured, 1.0))
    pushed = Pose2(x_m=0.4, y_m=0.07, yaw_rad=0.0)
    chain.add(world.scan(pushed, rng), measured, 10**9, constant_errors=known)
    assert len(chain.take_edges()) == 1
