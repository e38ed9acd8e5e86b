"""Robots that cannot stop within what the safety gate looks ahead are refused."""

from __future__ import annotations

import dataclasses

import pytest

from navcore.errors import BadConfiguration
from navcore.robot.profile import HUSKY, RobotProfile, load_profile, robot_names
from navcore.safety.stopping import check_stopping

TRUCK = dataclasses.replace(HUSKY, name="truck", max_speed_mps=1.5, max_accel_mps2=0.6)


@pytest.mark.parametrize(
    "robot",
    [
        TRUCK,
        dataclasses.replace(HUSKY, max_yaw_accel_radps2=2.0),
        dataclasses.replace(HUSKY, length_m=4.0),
        dataclasses.replace(HUSKY, max_speed_mps=2.5, max_accel_mps2=20.0),
    ],
    ids=["brakes", "brakes of a turn", "length", "speed"],
)
def test_a_robot_that_the_gate_could_not_stop_is_refused(robot: RobotProfile) -> None:
    with pytest.raises(BadConfiguration, match="too fast for its brakes"):
        check_stopping(robot)


def test_the_refusal_names_speed_and_brakes_and_a_slower_robot_is_none() -> None:
    with pytest.raises(BadConfiguration, match=r"'truck'.* 1\.5 m/s .* 0\.6 m/s²"):
        check_stopping(TRUCK)
    check_stopping(dataclasses.replace(TRUCK, max_speed_mps=0.4))
    for name in robot_names():
        check_stopping(load_profile(name))
