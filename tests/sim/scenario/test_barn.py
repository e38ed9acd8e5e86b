"""The Jackal drives as commanded, timetables are kept, and published worlds become scenarios."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from navcore.config.navigator import NavigatorConfig, config_for
from navcore.errors import BadConfiguration
from navcore.geometry.camera import back_project
from navcore.geometry.transform import STANDSTILL, Pose2, transform_points
from navcore.grid.grid import GridSpec
from navcore.robot.profile import HUSKY, ROBOTS, load_profile
from sim.referee.referee import Referee
from sim.scenario.barn import HUSKY_SCALE, load_worlds
from sim.scenario.schema import Mover, Scenario
from sim.sensors.stereo_noise import PERFECT
from sim.simulator import PERIOD_S, Simulator
from tests.shared_data import beside
from tests.sim.worlds import drive, open_floor, turned_by, wait

JACKAL = load_profile("jackal")
DATA = Path(__file__).parents[3].parent / "shared" / "data" / "barn"
META = {
    "start": [-2.25, 3, 1.57],
    "goal": [-2.25, 13],
    "goal_tolerance": 1.0,
    "timeout": 100.0,
    "cylinder_radius": 0.075,
}
STATIC: dict[str, Any] = {
    "id": 6,
    "walls": [[-4.0, 5.0]],
    "cylinders": [[-2.0, 8.0], [-3.0, 9.0]],
    "path_length": 12.0,
}
MOVING: dict[str, Any] = {
    "id": 4,
    "walls": [{"name": "top", "centre": [0.0, 10.0], "size": [20.0, 0.5]}],
    "obstacles": [
        {"name": "a", "radius": 0.5, "period": 8.0, "keys": [[0.0, 1.0, 2.0], [4.0, 1.0, 6.0]]}
    ],
}


def a_file(folder: Path, *worlds: dict[str, Any], **meta: object) -> Path:
    path = folder / "worlds.json"
    path.write_text(json.dumps({"meta": {**META, **meta}, "worlds": worlds}))
    return path


def published(name: str) -> Path:
    return beside(DATA / name, "the published worlds are")


def jackal(scenario: Scenario, *, size: tuple[int, int] = (16, 16)) -> Simulator:
    return Simulator(
        scenario,
        seed=0,
        camera_size=size,
        camera_rate_hz=0.001,
        errors=PERFECT,
        robot=JACKAL,
    )


@pytest.mark.parametrize("v_mps", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("w_radps", [-2.0, -0.3, 0.3, 1.0, 2.0])
def test_the_jackal_reaches_a_commanded_velocity(v_mps: float, w_radps: float) -> None:
    with jackal(open_floor(start=(-4.0, 0.0, 0.0))) as simulator:
        drive(simulator, v_mps, w_radps, 1.0)
        before, driven_m = simulator.true_pose(), simulator.referee.distance_m
        drive(simulator, v_mps, w_radps, 1.0)
        assert turned_by(before.yaw_rad, simulator.true_pose().yaw_rad) == pytest.approx(
            w_radps, rel=0.1
        )
        assert simulator.referee.distance_m - driven_m == pytest.approx(v_mps, rel=0.05, abs=0.01)


def test_the_jackal_stops_as_fast_as_its_profile_says() -> None:
    with jackal(open_floor(start=(-4.0, 0.0, 0.0))) as simulator:
        drive(simulator, 2.0, 0.0, 1.5)
        began = simulator.true_pose()
        drive(simulator, 0.0, 0.0, 1.0)
        stopped = simulator.true_pose()
        assert stopped.x_m - began.x_m == pytest.approx(
            2.0**2 / (2 * JACKAL.max_accel_mps2), abs=0.05
        )
        assert abs(stopped.y_m) < 0.02


def test_the_jackals_camera_sees_the_floor_before_its_bumper_and_nothing_of_itself() -> None:
    with jackal(open_floor(), size=(106, 60)) as simulator:
        frame = simulator.capture()
    points = transform_points(frame.T_base_camera, back_project(frame.depth_m, frame.intrinsics))
    assert len(points) > 1000
    assert np.abs(points[:, 2]).max() < 0.03
    assert JACKAL.length_m / 2 < points[:, 0].min() < JACKAL.length_m / 2 + 0.4


def test_a_mover_keeps_its_timetable_and_never_yields() -> None:
    mover = Mover(
        keys=((0.0, 3.0, 0.0), (1.0, 1.0, 0.0), (2.0, 1.0, 1.0)), period_s=3.0, radius_m=0.5
    )
    with jackal(open_floor(movers=(mover,))) as simulator:
        positions = []
        for _ in range(4):
            positions.append(simulator.moving_poses()[0])
            wait(simulator, 1.0)
        assert simulator.referee.min_clearance_m == pytest.approx(
            1.0 - 0.5 - JACKAL.length_m / 2, abs=0.03
        )
        assert simulator.referee.collisions + simulator.referee.struck_while_standing == 0
    assert [(round(at.x_m, 2), round(at.y_m, 2)) for at in positions] == [
        (3, 0),
        (1, 0),
        (1, 1),
        (3, 0),
    ]


def test_contact_with_a_mover_counts_by_its_own_radius_and_the_robots_own_footprint() -> None:
    def contacts(radius_m: float, robot: str) -> int:
        mover = Mover(keys=((0.0, 0.9, 0.0),), period_s=10.0, radius_m=radius_m)
        referee = Referee(open_floor(movers=(mover,)), load_profile(robot))
        here = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
        there = Pose2(x_m=0.9, y_m=0.0, yaw_rad=0.0)
        referee.observe(t_s=0.0, pose=here, rolling=STANDSTILL, people=[there], period_s=PERIOD_S)
        return referee.struck_while_standing

    assert [contacts(0.5, "jackal"), contacts(0.7, "jackal"), contacts(0.5, "husky")] == [0, 1, 1]


def test_a_world_keeps_its_measures_and_is_centred_between_start_and_goal(tmp_path: Path) -> None:
    file = a_file(tmp_path, STATIC)
    (one,), (large,) = load_worlds(file, scale=1.0), load_worlds(file, scale=HUSKY_SCALE)
    assert one.scenario.start == pytest.approx((0.0, -5.0, 1.57))
    assert one.scenario.goals[0] == pytest.approx((0.0, 5.0))
    positions = np.array([piece.at for piece in one.scenario.furniture])
    assert positions == pytest.approx(np.array([(-1.75, -3.0), (0.25, 0.0), (-0.75, 1.0)]))
    assert one.scenario.furniture[0].size_m is not None and one.scenario.furniture[0].size_m[
        0
    ] == pytest.approx(0.15)
    assert (one.id, one.reference_m, one.tolerance_m, one.limit_s) == (6, 12.0, 1.0, 100.0)
    assert large.scenario.furniture[1].at == pytest.approx((0.25 * 1.7, 0.0))
    assert (large.reference_m, large.tolerance_m) == pytest.approx((12.0 * 1.7, 1.7))


def test_a_moving_world_is_stretched_in_time_as_well_so_that_its_speeds_stay(
    tmp_path: Path,
) -> None:
    file = a_file(tmp_path, MOVING, start=[11, 0, 3.14], goal=[-9, 0])
    (one,), (large,) = load_worlds(file, scale=1.0), load_worlds(file, scale=HUSKY_SCALE)
    assert one.reference_m == 20.0
    assert one.scenario.movers[0].keys == ((0.0, 0.0, 2.0), (4.0, 0.0, 6.0))
    for world in (one, large):
        (t0, _, y0), (t1, _, y1) = world.scenario.movers[0].keys
        assert (y1 - y0) / (t1 - t0) == pytest.approx(1.0)
    assert large.scenario.movers[0].period_s == pytest.approx(8.0 * 1.7)


@pytest.mark.parametrize(
    ("seconds", "score"), [(1.0, 0.5), (12.0, 0.5), (24.0, 0.25), (48.0, 0.125), (99.0, 0.125)]
)
def test_the_score_is_the_challenges(tmp_path: Path, seconds: float, score: float) -> None:
    (world,) = load_worlds(a_file(tmp_path, STATIC), scale=1.0)  # best time 6 s
    assert world.score(success=True, seconds=seconds) == pytest.approx(score)
    assert world.score(success=False, seconds=seconds) == 0.0


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"worlds": []}', '{"meta": {}, "worlds": [{"id": 0}]}']
)
def test_a_file_of_something_else_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "w.json"
    path.write_text(text)
    with pytest.raises(BadConfiguration, match=r"w\.json"):
        load_worlds(path, scale=1.0)


def test_profiles_are_files_and_unknown_keys_and_robots_are_refused(tmp_path: Path) -> None:
    assert load_profile("husky") == HUSKY
    assert config_for(HUSKY) == NavigatorConfig()
    path = tmp_path / "r.toml"
    path.write_text((ROBOTS / "jackal.toml").read_text() + "\nwheels = 4\n")
    with pytest.raises(BadConfiguration, match="unknown key 'wheels'"):
        load_profile(path)
    with pytest.raises(BadConfiguration, match="husky, jackal"):
        load_profile("hasky")


def test_every_published_world_has_a_path_for_the_jackal_with_its_own_margin() -> None:
    inflation_m = JACKAL.width_m / 2 + config_for(JACKAL).safety_margin_m
    worlds = load_worlds(published("barn_static_open.json"), scale=1.0)
    assert len(worlds) == 150
    for world in worlds[::10]:
        scenario, spec = (
            world.scenario,
            GridSpec.centred(size_m=world.scenario.map.size_m, resolution_m=0.05),
        )
        path_m = Referee(scenario, JACKAL).shortest_m(spec, inflation_m, scenario.goals)
        assert path_m is not None and math.isfinite(path_m) and path_m >= 10.0, scenario.name
