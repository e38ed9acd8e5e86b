"""What is plausible of a camera that a person carries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.replay.carried_camera import PLAUSIBLE
from app.replay.recording import open_recording
from app.replay.robot import ReplayRobot
from navcore.geometry.transform import Matrix
from navcore.robot.profile import HUSKY
from navcore.safety.sensor_monitor import SensorFault, SensorMonitor
from tests.recorded import PLACES, RECORDING_GAP_NS, write_recording


@pytest.mark.parametrize("left_out", [0, 1, 4, 6, 13])
def test_images_may_be_left_out_of_a_walk_that_is_sideways_and_faster_than_a_robot(
    tmp_path: Path, left_out: int
) -> None:
    recording, now_ns = open_recording(write_recording(tmp_path / "walk", np.eye(4))), 0
    robot = ReplayRobot(recording, np.eye(4), clock=lambda: now_ns, back_and_forth=True)
    monitor = SensorMonitor()
    for _ in range(4 * len(PLACES)):
        now_ns += (1 + left_out) * RECORDING_GAP_NS
        frame = robot.wait_frame(None, 0.0)
        assert frame is not None
        monitor = monitor.after(frame, HUSKY, PLAUSIBLE)
        assert monitor.newest_is_trusted, monitor.fault_text


def test_a_trajectory_that_was_cut_and_goes_on_elsewhere_has_jumped(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "walk", np.eye(4))
    recording, now_ns = open_recording(folder), 0
    elsewhere: Matrix = np.eye(4)
    elsewhere[0, 3] = 3.0
    recording.T_world_camera[4:] = elsewhere @ recording.T_world_camera[4:]
    robot = ReplayRobot(recording, np.eye(4), clock=lambda: now_ns)
    faults, monitor = [], SensorMonitor()
    for step in range(6):
        now_ns = recording.stamp_ns(step)
        frame = robot.wait_frame(None, 0.0)
        assert frame is not None
        monitor = monitor.after(frame, HUSKY, PLAUSIBLE)
        faults.append(monitor.fault)
    assert faults == [None] * 4 + [SensorFault.POSE] * 2
