"""The simulated laser scanner measures what is there, at its height, and not the robot."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from navcore.geometry.transform import Pose2
from navcore.robot.laser_scan import LaserScan, ScannerMount
from navcore.robot.profile import HUSKY
from sim.bullet import pybullet
from sim.scenario.load import load_scenario
from sim.simulator import Simulator

MOUNT = ScannerMount(x_m=0.2)
EXACT = dataclasses.replace(MOUNT, noise_m=0.0)


def simulator(world: str, mount: ScannerMount | None, seed: int = 3) -> Simulator:
    robot = dataclasses.replace(HUSKY, scanner=mount)
    return Simulator(load_scenario(world), seed=seed, robot=robot)


def taken(sim: Simulator) -> LaserScan:
    scan = sim.capture().scan
    assert scan is not None
    return scan


def test_the_ranges_are_those_of_rays_through_the_physics() -> None:
    with simulator("office", EXACT) as sim:
        pose, scan = sim.true_pose(), taken(sim)
        checked = 0
        for i in range(0, EXACT.rays, 4):
            angle = pose.yaw_rad + i * scan.step_rad
            eye = pose.to_parent(np.array([EXACT.x_m, 0.0]))
            ahead = np.array([math.cos(angle), math.sin(angle)])
            near, far = eye + 0.9 * ahead, eye + EXACT.max_range_m * ahead
            body, _, share, *_ = pybullet.rayTest(
                [*near, EXACT.z_m], [*far, EXACT.z_m], physicsClientId=sim.client
            )[0]
            if body < 0 or not math.isfinite(scan.ranges_m[i]):
                continue
            # A person's body is a cylinder for the physics, and legs and arms for the eye.
            expected_m = 0.9 + share * (EXACT.max_range_m - 0.9)
            checked += abs(scan.ranges_m[i] - expected_m) < 0.03 + 0.01 * expected_m
        assert checked > 0.85 * EXACT.rays / 4


def test_noise_is_as_the_mount_says_and_the_same_seed_scans_the_same() -> None:
    with simulator("office", EXACT) as exact, simulator("office", MOUNT) as noisy:
        clean, scan = taken(exact), taken(noisy)
    both = np.isfinite(clean.ranges_m) & np.isfinite(scan.ranges_m)
    errors = scan.ranges_m[both] - clean.ranges_m[both]
    assert np.std(errors) == pytest.approx(MOUNT.noise_m, rel=0.2)
    with simulator("office", MOUNT) as again:
        np.testing.assert_array_equal(taken(again).ranges_m, scan.ranges_m)


def test_a_person_behind_is_hit_and_what_is_out_of_range_is_infinite() -> None:
    with simulator("empty_room", dataclasses.replace(EXACT, max_range_m=1.0)) as sim:
        assert not np.isfinite(taken(sim).ranges_m).any()
    with simulator("office", EXACT) as sim:
        sim.capture()  # puts what is seen where it is
        person = sim.moving_poses()[0]
        away = Pose2(x_m=person.x_m + 1.2, y_m=person.y_m, yaw_rad=0.0)
        scan = sim._scanner.scan(away) if sim._scanner is not None else None
    assert scan is not None
    hits = away.to_parent(scan.hits())
    assert (np.hypot(*(hits - (person.x_m, person.y_m)).T) < 0.35).sum() >= 5


def test_a_robot_without_a_scanner_has_no_scan_and_a_scanner_changes_no_image() -> None:
    with simulator("office", None) as plain, simulator("office", MOUNT) as equipped:
        for _ in range(48):
            plain.step()
            equipped.step()
        frame, other = plain.newest_frame(), equipped.newest_frame()
    assert frame is not None and other is not None
    assert frame.scan is None
    np.testing.assert_array_equal(frame.depth_m, other.depth_m)
    np.testing.assert_array_equal(frame.rgb, other.rgb)
    assert frame.pose == other.pose
