"""Uncertainty by odometry grows as its errors do, and standing still measures the gyro's bias."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.localisation.localisation import DEGPH, OdometryConfig
from navcore.geometry.transform import Matrix, Pose2, difference, wrap_angle
from navcore.localisation.tracking.odometry_model import (
    DrivenOdometry,
    OdometryMotion,
    OdometryStep,
    initial_covariance,
    travel_of,
    travel_variance,
)
from navcore.localisation.tracking.pose_filter import PoseFilter
from tests.navcore.laws import law

START = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
CONFIG = OdometryConfig()


def straight(count: int) -> PoseFilter:
    """A filter after steps of 0.1 m straight ahead, 0.2 s each."""
    own = PoseFilter(START)
    for _ in range(count):
        own.predict(OdometryStep(along_m=0.1, aside_m=0.0, turn_rad=0.0, duration_s=0.2))
    return own


def test_uncertainty_along_the_route_grows_in_proportion_to_the_distance() -> None:
    near, far = straight(400).covariance, straight(1600).covariance

    assert 3.0 < math.sqrt(far[0, 0] / near[0, 0]) < 4.1
    assert far[0, 0] > (CONFIG.length_scale * 160.0) ** 2


def test_the_covariance_covers_the_errors_that_are_expected() -> None:
    rng = np.random.default_rng(3)
    squares = []
    for _ in range(60):
        own, true = PoseFilter(START), START
        length = 1 + CONFIG.length_scale * rng.standard_normal()
        gyro = 1 + CONFIG.gyro_scale * rng.standard_normal()
        bias = CONFIG.gyro_bias_degph * DEGPH * rng.standard_normal()
        for k in range(600):
            along, turn = 0.12, 0.03 * math.sin(k / 40)
            true = true @ Pose2(x_m=along, y_m=0.0, yaw_rad=turn)
            noise = math.radians(CONFIG.gyro_noise_deg) * math.sqrt(0.2) * rng.standard_normal()
            measured = Pose2(
                x_m=length * along + CONFIG.slip_m * math.sqrt(along) * rng.standard_normal(),
                y_m=CONFIG.aside_m * math.sqrt(along) * rng.standard_normal(),
                yaw_rad=gyro * turn + bias * 0.2 + noise,
            )
            own.predict(OdometryStep.between(START, measured, 0.2))
        error = np.array(
            [
                own.pose.x_m - true.x_m,
                own.pose.y_m - true.y_m,
                wrap_angle(own.pose.yaw_rad - true.yaw_rad),
            ]
        )
        squares.append(error @ np.linalg.solve(own.covariance, error))

    assert 2.0 < np.mean(squares) < 4.2  # 3 degrees of freedom


@law(20)
@given(seed=st.integers(0, 2**31), turn_rad=st.sampled_from([0.0, 0.05, 0.3]))
def test_noise_and_constant_errors_of_a_motion_together_are_its_covariance(
    seed: int, turn_rad: float
) -> None:
    """Also of a turn on the spot, which has no length."""
    rng = np.random.default_rng(seed)
    own, motion = PoseFilter(START), OdometryMotion(START)
    for along in rng.uniform(0.02, 0.2, 20) if turn_rad < 0.3 else np.zeros(20):
        step = OdometryStep(
            along_m=float(along),
            aside_m=0.0,
            turn_rad=turn_rad * rng.uniform(0.5, 1.0),
            duration_s=0.2,
        )
        own.predict(step)
        motion.advance(step)

    pose, noise, by_errors = motion.to(START)
    whole = noise + by_errors @ PoseFilter(START).constant_errors.covariance @ by_errors.T
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    assert pose.distance_to(own.pose.x_m, own.pose.y_m) < 1e-9
    # The bias of the filter drifts, by a thousandth of its variance.
    assert np.allclose(whole, turn @ own.covariance @ turn.T, rtol=1e-3, atol=1e-7)


def test_a_motion_to_another_frame_errs_as_it_lies_beside_the_robot() -> None:
    motion = OdometryMotion(START)
    motion.advance(OdometryStep(along_m=0.0, aside_m=0.0, turn_rad=0.5, duration_s=1.0))
    offset = Pose2(x_m=-2.0, y_m=0.0, yaw_rad=0.0)  # the frame is 2 m ahead of the robot

    pose, noise, by_errors = motion.to(offset)

    assert pose.x_m == 2.0 * math.cos(0.5) and pose.y_m == 2.0 * math.sin(0.5)
    assert by_errors[1, 2] == -2.0 * 0.5  # an error of the turn swings it to the right
    assert noise[1, 1] > (2.0 * math.radians(CONFIG.gyro_noise_deg)) ** 2


def test_standing_still_the_gyro_bias_is_learnt_and_the_pose_stays() -> None:
    bias = 40 * DEGPH
    own = PoseFilter(START)
    for _ in range(300):
        own.predict(OdometryStep(along_m=0.0, aside_m=0.0, turn_rad=0.2 * bias, duration_s=0.2))
    assert own.pose == START
    assert abs(own.constant_errors.mean[0] - bias) < 10 * DEGPH

    for _ in range(600):
        own.predict(OdometryStep(along_m=0.1, aside_m=0.0, turn_rad=0.2 * bias, duration_s=0.2))

    # Without the bias learnt, the heading would be 1.3° wrong.
    assert abs(math.degrees(own.pose.yaw_rad)) < 0.35


def test_a_motion_over_a_gap_between_frames_is_no_standstill_and_tells_no_bias() -> None:
    """The lens was covered while the robot braked over 0.4 m and turned."""
    own, driven = straight(20), DrivenOdometry()
    before = own.pose
    driven.follow(START, 0)
    driven.follow(Pose2(x_m=0.4, y_m=0.0, yaw_rad=0.2), 120 * 10**9)
    own.predict(OdometryStep(along_m=0.4, aside_m=0.0, turn_rad=0.2, duration_s=120.0))

    assert before.distance_to(own.pose.x_m, own.pose.y_m) == pytest.approx(0.4)
    assert driven.pose.x_m == 0.4 and driven.travel[0] == pytest.approx(0.4)
    assert own.constant_errors.mean[0] == 0.0

    # Nor does one that has ended where it began.
    unknown = own.constant_errors.covariance[0, 0]
    own.predict(OdometryStep(along_m=0.0, aside_m=0.0, turn_rad=0.001, duration_s=120.0))
    assert own.constant_errors.mean[0] == 0.0
    assert own.constant_errors.covariance[0, 0] >= unknown


def test_what_is_learnt_of_constant_errors_does_not_move_the_robot_away_from_its_new_map() -> None:
    bias = 40 * DEGPH
    own = PoseFilter(START)
    for k in range(1, 801):  # 80 m
        own.predict(OdometryStep(along_m=0.1, aside_m=0.0, turn_rad=0.2 * bias, duration_s=0.2))
        if k % 5 == 0:
            own.refer()
    arrived, unknown = own.pose, own.constant_errors.covariance[0, 0]

    for _ in range(50):
        own.predict(OdometryStep(along_m=0.0, aside_m=0.0, turn_rad=0.2 * bias, duration_s=0.2))

    assert own.constant_errors.covariance[0, 0] < 0.1 * unknown
    assert np.abs(difference(own.pose, arrived)).max() < 1e-3
    # The bias has turned the route by 1.8°: what is not corrected stays uncertain.
    error = difference(own.pose, Pose2(x_m=80.0, y_m=0.0, yaw_rad=0.0))
    assert 1.0 < abs(error[1]) < 3.0 * math.sqrt(own.covariance[1, 1])


def test_wheels_on_a_slope_measure_more_than_the_map_shows() -> None:
    after = Pose2(x_m=1.0, y_m=0.0, yaw_rad=0.0)

    step = OdometryStep.between(START, after, 1.0, pitch_rad=0.12)

    assert step.along_m == math.cos(0.12)


def test_a_match_against_the_own_map_moves_the_pose_and_makes_it_no_more_certain() -> None:
    information = np.diag([1e4, 1e4, 1e5])
    floor = np.diag([0.01, 0.01, 0.002]) ** 2
    pull = information @ (0.1, 0.05, 0.01)
    own, saved = straight(100), straight(100)
    before = own.covariance

    own.fuse_match(pull, information, floor, absolute=False)
    saved.fuse_match(pull, information, floor, absolute=True)

    assert own.pose.x_m > 10.05
    assert np.allclose(own.covariance, before)
    assert own.covariance_within[0, 0] < 0.1 * before[0, 0]
    assert saved.covariance[0, 0] < 0.1 * before[0, 0]
    # The floor: not even a million points make it better than the map.
    assert saved.covariance[0, 0] > 0.5 * floor[0, 0]


def test_a_known_part_of_the_own_map_makes_the_pose_as_certain_as_it_is() -> None:
    own = straight(200)
    pose, by_motion, before = own.pose, own.covariance_by_motion, own.covariance_but_scale
    most = np.diag([0.02, 0.5, 0.001]) ** 2  # nothing is known across
    own.bound(most)
    once = own.covariance_but_scale
    assert once[0, 0] < 1.01 * most[0, 0] < before[0, 0]
    assert np.linalg.eigvalsh(most - once)[0] > -1e-8
    assert np.linalg.eigvalsh(before - once)[0] > -1e-8
    own.bound(most)
    assert own.covariance_but_scale == pytest.approx(once, rel=1e-3, abs=1e-7)
    assert own.pose == pose and own.covariance_by_motion == pytest.approx(by_motion)
    assert own.covariance == pytest.approx(by_motion - before + once, rel=1e-3, abs=1e-7)


def test_a_located_robot_learns_the_scale_of_its_wheels() -> None:
    own = PoseFilter(START)
    true_m = 0.0
    for k in range(400):
        true_m += 0.1
        own.predict(OdometryStep(along_m=0.102, aside_m=0.0, turn_rad=0.0, duration_s=0.2))
        if k % 5 == 0:
            residual = np.array([true_m - own.pose.x_m, -own.pose.y_m])
            own.fuse_position(residual, np.eye(3)[:2], np.eye(2) * 0.03**2)

    assert abs(own.constant_errors.mean[1] - 0.02) < 0.004


def measured_by_scans(information: Matrix) -> PoseFilter:
    """A filter after 40 m by wheels that measure 2 % too much, with a motion by scans each 0.5 m of
    which (3, 3) is known."""
    own = PoseFilter(START)
    for k in range(1, 401):
        own.predict(OdometryStep(along_m=0.102, aside_m=0.0, turn_rad=0.0, duration_s=0.2))
        if k % 5 == 0:
            true = Pose2(x_m=0.5, y_m=0.0, yaw_rad=0.0)
            pull = information @ difference(true, own.motion)
            assert own.fuse_motion(pull, information, gate=9.0)
            own.refer()
    return own


def test_motions_by_scans_tell_the_scale_of_the_wheels_as_well_as_scans_know_it() -> None:
    known = np.diag([1.0 / 0.005**2, 1.0 / 0.005**2, 1.0 / math.radians(0.1) ** 2])
    own, bare = measured_by_scans(known), measured_by_scans(np.diag([0.0, 1.0, 1.0]) * known)

    # The prior of scans and wheels shares out what they differ by.
    share = CONFIG.length_scale**2 / (CONFIG.length_scale**2 + CONFIG.length_floor**2)
    assert math.isclose(own.constant_errors.mean[1], share * 0.02, rel_tol=0.05)
    assert abs(own.pose.x_m - 40.0) < 0.2
    assert math.sqrt(own.covariance[0, 0]) >= 0.9 * CONFIG.length_floor * 40.0
    assert bare.pose.x_m > 40.7  # between bare walls no scan tells the way


def test_what_is_known_of_errors_that_are_not_expected_can_be_inverted() -> None:
    exact = OdometryConfig(length_scale=0.0, gyro_scale=0.0, gyro_bias_degph=0.0)
    known = PoseFilter(START, exact).constant_errors

    assert np.isfinite(np.linalg.inv(known.covariance)).all()
    assert np.sqrt(np.diag(known.covariance)).max() <= 1e-5


def test_a_motion_that_odometry_excludes_is_refused() -> None:
    own = straight(5)
    before, known = own.pose, np.diag([1e5, 1e5, 1e5])

    assert not own.fuse_motion(known @ np.array([-0.2, 0.0, 0.0]), known, gate=9.0)
    assert own.pose == before


def test_the_bound_after_a_travel_covers_all_that_was_seen_before_and_not_much_more() -> None:
    rng = np.random.default_rng(5)
    constant = initial_covariance()[3:6, 3:6]
    ratios = []
    for _ in range(60):
        motion, travel = OdometryMotion(START), np.zeros(3)
        speed_mps, turn_radps = rng.uniform(0.2, 1.0), rng.uniform(-0.5, 0.5)
        for _ in range(int(rng.integers(5, 100))):
            step = OdometryStep(
                along_m=0.1 * speed_mps, aside_m=0.0, turn_rad=0.1 * turn_radps, duration_s=0.1
            )
            motion.advance(step)
            travel = travel + travel_of(step)
        pose, noise, by_errors = motion.to(START)
        x, y = pose.from_parent(rng.uniform(-2.0, 2.0, (1, 2)))[0]
        relative = np.array([[-1.0, 0.0, y], [0.0, -1.0, -x]])
        covariance = relative @ (noise + by_errors @ constant @ by_errors.T) @ relative.T
        (bound,) = travel_variance(travel[None], np.array([math.hypot(x, y)]))
        ratios.append(bound / np.linalg.eigvalsh(covariance)[-1])

    assert min(ratios) >= 0.99
    assert np.median(ratios) < 4.0
