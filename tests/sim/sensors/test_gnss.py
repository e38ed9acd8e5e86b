"""The GNSS receiver and the accelerometer of the simulated robot."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.robot.fix import FixSource, check_fix
from navcore.robot.frame import check_frame
from sim.scenario.load import load_scenario
from sim.scenario.variation import Source, generator
from sim.sensors.gnss import GNSS_ERRORS, GnssReceiver
from sim.sensors.gnss_settings import Gnss, GnssKind, carried
from sim.sensors.imu import BIAS_RAD, NOISE_RAD
from sim.simulator import Simulator
from tests.sim.worlds import open_floor, wait

POSE = Pose2(x_m=3.0, y_m=-2.0, yaw_rad=1.0)


def errors_m(gnss: Gnss, seed: int, duration_s: float) -> npt.NDArray[np.float64]:
    """Return (N, 2) errors of the fixes of a receiver that stands."""
    receiver = GnssReceiver(gnss, generator(seed, Source.GNSS))
    found: dict[int, tuple[float, float]] = {}
    for step in range(round(duration_s * gnss.rate_hz)):
        receiver.observe(round(step * 1e9 / gnss.rate_hz), POSE)
        found |= {fix.stamp_ns: (fix.x_m - POSE.x_m, fix.y_m - POSE.y_m) for fix in receiver.fixes}
    return np.array(list(found.values()))


@pytest.mark.parametrize("kind, sigma_m", [("rtk", 0.02), ("plain", 1.5)])
def test_the_errors_are_those_of_the_covariance_and_stay_alike_for_the_stated_time(
    kind: GnssKind, sigma_m: float
) -> None:
    gnss = Gnss(kind="rtk" if kind == "rtk" else "plain", rate_hz=1.0)
    runs = np.array([errors_m(gnss, seed, 600.0) for seed in range(40)])
    errors = GNSS_ERRORS[kind]
    assert errors.sigma_m == pytest.approx(sigma_m, rel=0.01)
    assert runs.std() == pytest.approx(sigma_m, rel=0.1)
    lag = round(errors.bias_s)
    alike = (runs[:, lag:] * runs[:, :-lag]).mean() / runs.var()
    expected = (errors.bias_m / errors.sigma_m) ** 2 / math.e
    assert alike == pytest.approx(expected, abs=0.12)


def test_an_outage_has_no_fix_and_changes_no_later_one() -> None:
    whole = Gnss(kind="rtk", rate_hz=2.0)
    broken = dataclasses.replace(whole, outages_s=((3.0, 5.0), (8.0, 8.5)))
    all_errors, rest = errors_m(whole, 0, 10.0), errors_m(broken, 0, 10.0)
    kept = np.ones(20, dtype=np.bool_)
    kept[[6, 7, 8, 9, 16]] = False
    assert np.array_equal(all_errors[kept], rest)


def test_a_frame_has_the_fixes_of_the_last_second_in_the_frame_of_the_world() -> None:
    world = dataclasses.replace(open_floor(start=(3.0, -2.0, 1.0)), gnss=Gnss(kind="rtk"))
    with Simulator(
        world,
        seed=0,
        camera_size=(32, 24),
        camera_rate_hz=2.0,
        odometry_origin=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0),
    ) as simulator:
        wait(simulator, 2.0)
        frame = simulator.newest_frame()
    assert frame is not None
    check_frame(frame)
    stamps = [fix.stamp_ns for fix in frame.fixes]
    assert len(stamps) == 5 and stamps == sorted(stamps)
    assert frame.stamp_ns - 1e9 < stamps[0] and stamps[-1] <= frame.stamp_ns
    for fix in frame.fixes:
        check_fix(fix)
        assert fix.source is FixSource.GNSS and fix.yaw_rad is None
        assert math.hypot(fix.x_m - 3.0, fix.y_m + 2.0) < 0.1
    assert frame.placed(POSE).fixes == frame.fixes


def test_the_forest_has_rtk_and_the_option_replaces_the_receiver_and_keeps_its_outages() -> None:
    of_world = Gnss(kind="rtk", rate_hz=2.0, outages_s=((1.0, 2.0),))
    assert carried(of_world, None) == of_world
    assert carried(of_world, "none") is None
    assert carried(of_world, "plain") == dataclasses.replace(of_world, kind="plain")
    assert carried(None, "rtk") == Gnss(kind="rtk") and carried(None, None) is None
    assert load_scenario("forest").gnss == Gnss(kind="rtk")
    assert load_scenario("office").gnss is None


@pytest.mark.parametrize(
    "lines, why",
    [
        ('kind = "galileo"', "gnss.kind: expected one of 'rtk', 'plain'"),
        ('kind = "rtk"\nrate_hz = 0', "gnss.rate_hz"),
        ('kind = "rtk"\noutages_s = [[5, 4]]', r"gnss.outages_s\[0\]: ends at 4 s"),
        ('kind = "rtk"\noutages = []', "unknown key 'outages'"),
        ("rate_hz = 1", "key 'kind' is missing"),
    ],
)
def test_a_bad_receiver_is_refused_by_key(tmp_path: Path, lines: str, why: str) -> None:
    file = tmp_path / "field.toml"
    file.write_text(
        'name = "field"\nsize_m = [9, 9]\nstart = [0, 0, 0]\n'
        f"[map]\nsize_m = [9, 9]\n[gnss]\n{lines}\n"
    )
    with pytest.raises(BadConfiguration, match=why):
        load_scenario(file)


@pytest.mark.long
def test_roll_and_pitch_are_those_of_the_slope_with_the_error_of_an_accelerometer() -> None:
    forest = load_scenario("forest")
    errors = []
    for seed in range(3):
        with Simulator(forest, seed=seed, camera_size=(16, 16), camera_rate_hz=0.001) as simulator:
            frame, pose = simulator.capture(), simulator.true_pose()
            tilt = simulator.ground.surface_pose(pose)[:3, :3]
        level = pose.matrix()[:3, :3] @ frame.T_level_base[:3, :3]
        errors.append(math.acos(min(1.0, (np.trace(level.T @ tilt) - 1) / 2)))
        assert frame.roll_rad != 0.0
    assert 0 < max(errors) < 4 * math.hypot(BIAS_RAD, NOISE_RAD)
