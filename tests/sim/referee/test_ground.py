"""The referee tells a robot that drives over ground beyond its limits, or falls, from one that
drives over raised ground within them."""

from __future__ import annotations

import math

import pytest

from navcore.geometry.transform import Pose2
from sim.scenario.load import load_scenario
from tests.sim.worlds import blind, drive, open_floor

TERRAIN = load_scenario("terrain")
SOUTH, NORTH = -math.pi / 2, math.pi / 2


@pytest.mark.parametrize(
    ("start", "drive_s", "entered", "fell"),
    [
        ((-1.2, -2.0, 0.0), 2.5, {"edge": 1}, False),  # over the kerb
        ((5.5, -0.6, NORTH), 2.0, {"edge": 1}, False),  # against the side of the platform
        ((0.7, 1.6, 0.0), 2.0, {"steep slope": 1}, False),
        ((5.5, 1.4, SOUTH), 2.5, {"edge": 1}, True),  # off the platform
        ((6.2, 3.0, 0.0), 2.5, {"edge": 1}, True),  # down the stairs
    ],
)
def test_ground_beyond_the_limits_counts_once_and_a_fall_is_told(
    start: tuple[float, float, float], drive_s: float, entered: dict[str, int], fell: bool
) -> None:
    x, y, yaw = start
    with blind(TERRAIN, start=Pose2(x_m=x, y_m=y, yaw_rad=yaw), odometry="ideal") as simulator:
        drive(simulator, 0.6, 0.0, drive_s)
        verdict = simulator.referee.summary()
        assert (verdict["ground_intruded"], verdict["fell"]) == (entered, fell)
        assert verdict["ground_intrusions"] == 1 and verdict["ground_intrusion_s"] > 0.5
        assert [intrusion["what"] for intrusion in verdict["intrusions"]] == list(entered)
        assert simulator.referee.violations() >= 1 + fell


@pytest.mark.parametrize(
    ("start", "v_mps", "w_radps"),
    [
        ((-1.4, 4.3, 0.0), 0.6, 0.0),  # up the ramp
        ((4.8, 4.3, math.pi), 0.6, 0.0),  # down
        ((-6.0, -2.0, 0.0), 0.6, 0.0),  # over the gravel
        ((-5.0, -2.0, 0.0), 0.0, 1.0),  # turning in it
        ((-1.2, -2.0, 0.0), 0.2, 0.0),  # near the kerb
    ],
)
def test_raised_ground_within_the_limits_is_floor(
    start: tuple[float, float, float], v_mps: float, w_radps: float
) -> None:
    x, y, yaw = start
    with blind(TERRAIN, start=Pose2(x_m=x, y_m=y, yaw_rad=yaw), odometry="ideal") as simulator:
        drive(simulator, v_mps, w_radps, 2.5)
        assert simulator.referee.violations() == 0


def test_an_edge_that_a_robot_is_put_on_counts_once_it_has_left_it() -> None:
    with blind(TERRAIN) as simulator:
        simulator.teleport(Pose2(x_m=0.3, y_m=-2.0, yaw_rad=0.0))
        drive(simulator, 0.6, 0.0, 2.0)
        assert simulator.referee.ground_intrusions == 0
        drive(simulator, -0.6, 0.0, 2.5)
        assert simulator.referee.ground_intrusions == 1


def test_a_flat_world_has_no_such_ground() -> None:
    with blind(open_floor()) as simulator:
        drive(simulator, 1.0, 0.5, 1.0)
        assert simulator.referee.summary()["ground_intruded"] == {}
        assert simulator.referee.violations() == 0
