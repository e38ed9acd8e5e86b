"""The simulated Husky drives as commanded, stops without commands, and its odometry drifts a
little."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, Twist
from navcore.robot.profile import HUSKY
from sim.robot.husky import HUSKY_CHASSIS
from sim.robot.odometry import Odometry
from sim.robot.odometry_grade import ODOMETRY_ERRORS, OdometryGrade
from sim.robot.skid_steer import COMMAND_TIMEOUT_NS, Driver
from sim.scenario.load import load_scenario
from sim.scenario.schema import Furniture, Item
from sim.scenario.variation import Source, generator
from sim.simulator import PERIOD_S, Simulator
from tests.sim.worlds import blind, drive, open_floor, shifted, turned_by, wait


@pytest.mark.parametrize("v_mps", [0.0, 0.5])
@pytest.mark.parametrize("w_radps", [-1.0, -0.6, -0.3, 0.3, 0.6, 1.0])
def test_a_commanded_velocity_is_reached(v_mps: float, w_radps: float) -> None:
    with blind(open_floor()) as simulator:
        drive(simulator, v_mps, w_radps, 1.0)
        before, driven_m = simulator.true_pose(), simulator.referee.distance_m
        drive(simulator, v_mps, w_radps, 1.0)
        assert turned_by(before.yaw_rad, simulator.true_pose().yaw_rad) == pytest.approx(
            w_radps, rel=0.1
        )
        assert simulator.referee.distance_m - driven_m == pytest.approx(v_mps, rel=0.05, abs=0.01)


def test_it_drives_straight_and_does_not_roll_on() -> None:
    with blind(open_floor()) as simulator:
        drive(simulator, 1.0, 0.0, 3.0)
        drive(simulator, 0.0, 0.0, 0.6)
        stopped = simulator.true_pose()
        assert abs(stopped.y_m) < 0.02
        # 3 s at 1 m/s, the ramps up and down taking as much away as they add
        assert stopped.x_m == pytest.approx(3.0, abs=0.06)
        wait(simulator, 1.0)
        assert simulator.true_pose().distance_to(stopped.x_m, stopped.y_m) < 1e-3


def test_a_turn_on_the_spot_keeps_the_position() -> None:
    with blind(open_floor()) as simulator:
        drive(simulator, 0.0, 1.0, 2 * math.pi)
        assert simulator.true_pose().distance_to(0.0, 0.0) < 0.02


def test_the_driver_forgets_a_command_after_its_timeout() -> None:
    with blind(open_floor()) as simulator:
        drive(simulator, 0.5, 0.0, 1.0)
        wait(simulator, COMMAND_TIMEOUT_NS / 1e9 + 0.5 / HUSKY.max_accel_mps2 + 0.1)
        assert abs(simulator.velocity().v_mps) < 0.01
        drive(simulator, 0.5, 0.0, 1.0)  # the control: commanded again, it goes on
        assert simulator.velocity().v_mps == pytest.approx(0.5, rel=0.05)


@pytest.mark.parametrize(
    "v_mps, w_radps", [(1e9, 0.0), (-1e9, 1e9), (math.nan, math.inf), (math.inf, math.nan)]
)
def test_no_command_moves_the_wheels_beyond_the_limits(v_mps: float, w_radps: float) -> None:
    driver = Driver(PERIOD_S, HUSKY, HUSKY_CHASSIS)
    before = (0.0, 0.0)
    for step in range(480):
        driver.command(Twist(v_mps=v_mps, w_radps=w_radps), step)
        before = driver.wheel_speeds(step, 0.0)
    assert all(math.isfinite(speed) for speed in before)
    limit_mps = HUSKY.max_speed_mps + (2 * HUSKY.max_yaw_rate_radps + 1.5) * 0.5708 / 2
    assert max(map(abs, before)) * 0.17775 <= limit_mps + 1e-9


def test_the_driver_ramps_with_the_platforms_acceleration() -> None:
    driver = Driver(PERIOD_S, HUSKY, HUSKY_CHASSIS)
    driver.command(Twist(v_mps=1.0, w_radps=0.0), 0)
    speeds = [driver.wheel_speeds(0, 0.0)[0] * 0.17775 for _ in range(100)]
    rises = [b - a for a, b in pairwise(speeds)]
    assert max(rises) == pytest.approx(HUSKY.max_accel_mps2 * PERIOD_S)
    assert speeds[-1] == pytest.approx(1.0)


def odometry_errors(seed: int) -> tuple[float, float]:
    """Return the errors of odometry in position (m) and heading (rad) after loops of 24 m on the
    open floor."""
    with blind(open_floor(start=(0.0, -3.0, 0.0)), seed, odometry="ideal") as simulator:
        for _ in range(4):
            drive(simulator, 1.0, 0.0, 4.0)
            drive(simulator, 0.5, 0.5, math.pi)
        truth, belief = simulator.true_pose(), simulator.odometry()
        return truth.distance_to(belief.x_m, belief.y_m), abs(
            turned_by(truth.yaw_rad, belief.yaw_rad)
        )


def test_ideal_odometry_drifts_a_little_and_differently_in_each_run() -> None:
    errors = [odometry_errors(seed) for seed in (0, 1)]
    for position_m, heading_rad in errors:
        assert 1e-4 < position_m < 0.12
        assert 1e-6 < heading_rad < math.radians(0.5)
    assert errors[0] != errors[1]


def track(simulator: Simulator) -> list[object]:
    """Return everything that a short run shows to the navigator."""
    seen: list[object] = []
    for _ in range(10):
        drive(simulator, 0.4, 0.3, 0.1)
        seen += [
            simulator.odometry(),
            simulator.velocity(),
            simulator.true_pose(),
            simulator.moving_poses(),
        ]
    frame = simulator.capture()
    return [*seen, frame.rgb.tobytes(), frame.depth_m.tobytes()]


def test_the_same_seed_gives_the_same_run_bit_for_bit_also_beside_another_simulator() -> None:
    office = load_scenario("office")
    with blind(office, 3) as one, blind(office, 3) as same, blind(office, 4) as other:
        first = track(one)
        assert track(same) == first
        assert track(other) != first


def test_with_ideal_odometry_the_figures_do_not_depend_on_the_other_grades() -> None:
    """The ideal grade draws from the same sources as before there were others."""
    pose = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    errors = ODOMETRY_ERRORS[OdometryGrade.IDEAL]
    one, other = (
        Odometry(
            pose, errors, generator(0, Source.ENCODER), 0.1, slip_rng=generator(seed, Source.SLIP)
        )
        for seed in (1, 2)
    )
    for step in range(100):
        for odometry in (one, other):
            odometry.update(0.05 * step, 0.06 * step, 0.1, (0.1, -0.1))
    assert one.pose == other.pose


def test_the_robot_starts_where_it_is_put_and_odometry_where_it_is_told_to() -> None:
    start, origin = Pose2(x_m=2.0, y_m=1.0, yaw_rad=1.0), Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    with blind(open_floor(), start=start, odometry_origin=origin, odometry="ideal") as simulator:
        assert simulator.scenario.start_pose == start
        assert simulator.true_pose().distance_to(2.0, 1.0) < 0.01
        assert simulator.odometry() == origin
        first = simulator.true_pose()
        drive(simulator, 0.5, 0.3, 2.0)
        true, believed = first.inverse() @ simulator.true_pose(), simulator.odometry()
        assert believed.x_m > 0.5
        assert true.distance_to(believed.x_m, believed.y_m) < 0.01


@pytest.mark.parametrize(
    "x_m, y_m, why",
    [
        (3.0, 0.0, r"furniture\[0\]"),
        (9.8, 0.0, "outside the world"),
        (math.nan, 0.0, "finite"),
        (-3.0, 0.0, r"items\[0\]"),
    ],
)
def test_a_pose_in_which_the_robot_cannot_stand_is_refused(
    x_m: float, y_m: float, why: str
) -> None:
    world = open_floor(
        furniture=(Furniture(kind="desk", at=(3.0, 0.0)),), items=(Item(kind="box", at=(-3.0, 0)),)
    )
    bad = Pose2(x_m=x_m, y_m=y_m, yaw_rad=0.0)
    with pytest.raises(BadConfiguration, match=f"start.*{why}"):
        blind(world, start=bad)
    with blind(world) as simulator:
        before = simulator.true_pose()
        with pytest.raises(BadConfiguration, match=f"teleport.*{why}"):
            simulator.teleport(bad)
        assert simulator.true_pose() == before


def test_a_teleported_robot_knows_nothing_of_it() -> None:
    """Odometry and driven distance go on; a zone that the robot lands in counts once left."""
    with blind(open_floor(start=(-5.0, 0.0, 0.0))) as simulator:
        drive(simulator, 0.5, 0.0, 2.0)
        wait(simulator, 1.0)
        believed, driven_m = simulator.odometry(), simulator.referee.distance_m
        simulator.referee.set_zones([np.array(shifted(5.0, 5.0))])
        simulator.teleport(Pose2(x_m=5.0, y_m=5.0, yaw_rad=2.0))
        wait(simulator, 1.0)
        here, after = simulator.true_pose(), simulator.odometry()
        assert here.distance_to(5.0, 5.0) < 0.02 and abs(turned_by(here.yaw_rad, 2.0)) < 0.01
        assert believed.distance_to(after.x_m, after.y_m) < 0.01
        assert abs(turned_by(believed.yaw_rad, after.yaw_rad)) < 0.01
        assert simulator.referee.distance_m - driven_m < 0.05
        drive(simulator, 0.5, 0.0, 2.0)
        assert simulator.referee.distance_m - driven_m == pytest.approx(0.9, abs=0.15)
        assert after.distance_to(simulator.odometry().x_m, simulator.odometry().y_m) > 0.7
        assert simulator.referee.violations() == 0
