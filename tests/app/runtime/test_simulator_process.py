"""The link to the simulator process: sending never blocks, and the process always ends."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator

import pytest

from app.runtime.simulator_process import SimulatorFailed, SimulatorProcess
from navcore.geometry.transform import Twist
from navcore.robot.profile import HUSKY

AHEAD = Twist(v_mps=0.4, w_radps=0.0)


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
    time.sleep(1.0)
    assert abs(speed(robot)) < 0.02


def test_a_world_that_does_not_come_up_is_told_and_leaves_nothing_behind() -> None:
    with pytest.raises(SimulatorFailed, match="no frame"):
        SimulatorProcess("nowhere", seed=0, profile=HUSKY)
