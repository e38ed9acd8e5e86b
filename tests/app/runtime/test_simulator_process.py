"""The link to the simulator process: sending never blocks, and the process always ends."""

from __future__ import annotations

import dataclasses
import os
import signal
import time
from collections.abc import Iterator

import numpy as np
import pytest

from app.runtime.simulator_process import SimulatorFailed, SimulatorProcess, _decode, _encode
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Pose2, Twist
from navcore.robot.fix import FixSource, PositionFix
from navcore.robot.frame import Frame
from navcore.robot.laser_scan import LaserScan, ScannerMount
from navcore.robot.profile import HUSKY, load_profile
from sim.simulator import STEPS_PER_S
from tests.navcore.scene import picture

AHEAD = Twist(v_mps=0.4, w_radps=0.0)
JACKAL = dataclasses.replace(load_profile("jackal"), scanner=ScannerMount())


@pytest.fixture
def robot() -> Iterator[SimulatorProcess]:
    process = SimulatorProcess("empty_room", seed=0, profile=HUSKY)
    yield process
    process.close()
    assert not process._process.is_alive()


def driven(robot: SimulatorProcess, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        robot.send(AHEAD)
        time.sleep(0.03)


def speed(robot: SimulatorProcess) -> float:
    frame = robot.newest_frame()
    assert frame is not None
    return frame.twist.v_mps


def test_the_robot_moves_while_commands_come_and_stands_by_itself_when_they_end(
    robot: SimulatorProcess,
) -> None:
    driven(robot, 1.0)
    assert speed(robot) == pytest.approx(0.4, abs=0.05)
    time.sleep(1.0)
    assert abs(speed(robot)) < 0.02


def test_a_simulator_that_hangs_blocks_no_sender(robot: SimulatorProcess) -> None:
    process = robot._process.pid
    assert process is not None
    driven(robot, 0.5)
    os.kill(process, signal.SIGSTOP)
    for _ in range(5000):
        robot.send(AHEAD)
        robot.note_stop("x")
    newest = robot.newest_frame()
    os.kill(process, signal.SIGCONT)
    later = robot.wait_frame(newest, 20.0)
    # What was sent while it hung is too old to be obeyed now.
    assert later is not None
    deadline = time.monotonic() + 20.0
    while abs(speed(robot)) >= 0.02:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_simulator_that_has_died_is_named_with_its_exit_code(robot: SimulatorProcess) -> None:
    process = robot._process.pid
    assert process is not None
    os.kill(process, signal.SIGKILL)
    deadline = time.monotonic() + 20.0
    with pytest.raises(SimulatorFailed, match=r"ended with exit code -9; start the console again"):
        while time.monotonic() < deadline:
            robot.wait_frame(robot.newest_frame(), 0.2)


def test_a_lag_that_is_made_up_puts_no_frames_closer_together_than_the_camera_took_them(
    robot: SimulatorProcess,
) -> None:
    process = robot._process.pid
    assert process is not None
    stamps, frame = [], robot.newest_frame()
    for _ in range(30):
        os.kill(process, signal.SIGSTOP)
        time.sleep(0.08)
        os.kill(process, signal.SIGCONT)
        frame = robot.wait_frame(frame, 20.0)
        assert frame is not None
        assert frame.stamp_ns <= robot.now_ns()
        stamps.append(frame.stamp_ns)
    assert min(np.diff(stamps)) > 0.1e9 - 1e9 / STEPS_PER_S


def test_a_world_that_does_not_come_up_is_told_and_leaves_nothing_behind() -> None:
    with pytest.raises(SimulatorFailed, match="no frame"):
        SimulatorProcess("nowhere", seed=0, profile=HUSKY)


def test_the_process_simulates_the_robot_of_the_profile_with_its_sensors() -> None:
    robot = SimulatorProcess("empty_room", seed=0, profile=JACKAL)
    try:
        frame = robot.newest_frame()
        assert frame is not None and frame.scan is not None
        assert frame.T_base_camera[2, 3] == pytest.approx(JACKAL.camera.z_m)
    finally:
        robot.close()


def test_a_laser_scan_crosses_the_link() -> None:
    scan = LaserScan(
        ranges_m=np.array([1.25, np.inf, 0.3] * 12, dtype=np.float32), x_m=0.1, max_range_m=8.0
    )
    got, _ = _decode(_encode(dataclasses.replace(picture(), scan=scan), 0, {}))
    assert got.scan is not None
    np.testing.assert_array_equal(got.scan.ranges_m, scan.ranges_m)
    assert got.scan.ranges_m.dtype == np.float32
    assert (got.scan.x_m, got.scan.max_range_m) == (0.1, 8.0)
    assert _decode(_encode(picture(), 0, {}))[0].scan is None


def test_a_depth_image_of_the_wrong_size_crosses_the_link() -> None:
    sent = picture()
    rows = sent.intrinsics.height // 2
    unknown = np.arange(sent.rgb[..., 0].size).reshape(sent.rgb.shape[:2]) % 3 == 0
    got, _ = _decode(
        _encode(dataclasses.replace(sent, depth_m=sent.depth_m[:rows], uncoloured=unknown), 0, {})
    )
    np.testing.assert_array_equal(got.depth_m, sent.depth_m[:rows])
    np.testing.assert_array_equal(got.rgb, sent.rgb)
    np.testing.assert_array_equal(got.uncoloured, unknown)


def test_roll_pitch_and_fixes_cross_the_link_with_stamps_of_the_machine() -> None:
    fixes = tuple(
        PositionFix(
            stamp_ns=900 + i,
            x_m=1.5,
            y_m=-2.0,
            yaw_rad=None if i == 0 else 0.5,
            covariance=np.eye(2 if i == 0 else 3),
            source=FixSource.GNSS if i == 0 else FixSource.TAG,
            source_id=None if i == 0 else 7,
        )
        for i in range(2)
    )
    lens = Intrinsics(width=4, height=2, fx=2.0, fy=2.0, cx=1.5, cy=0.5)
    sent = Frame(
        stamp_ns=1000,
        rgb=np.zeros((2, 4, 3), dtype=np.uint8),
        depth_m=np.ones((2, 4), dtype=np.float32),
        intrinsics=lens,
        T_base_camera=HUSKY.camera.T_base_camera,
        pose=Pose2(x_m=1.0, y_m=2.0, yaw_rad=3.0),
        twist=AHEAD,
        roll_rad=0.1,
        pitch_rad=-0.05,
        uncoloured=np.arange(8).reshape(2, 4) % 3 == 0,
        fixes=fixes,
    )
    got, _ = _decode(_encode(sent, 5000, {}))
    assert (got.roll_rad, got.pitch_rad, got.stamp_ns) == (0.1, -0.05, 5000)
    np.testing.assert_array_equal(got.uncoloured, sent.uncoloured)
    for before, after in zip(fixes, got.fixes, strict=True):
        assert after.stamp_ns == before.stamp_ns + 4000
        assert np.array_equal(after.covariance, before.covariance)
        assert (after.x_m, after.y_m, after.yaw_rad) == (before.x_m, before.y_m, before.yaw_rad)
        assert after.source is before.source and after.source_id == before.source_id
