"""Raised ground: what the engine, the camera and the model of the ground say of it agrees."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from navcore.errors import BadConfiguration
from navcore.geometry.camera import back_project
from navcore.geometry.transform import Pose2
from navcore.robot.profile import load_profile
from sim.bullet import pybullet
from sim.models.ground import Ground
from sim.models.raised_ground import RaisedGround
from sim.scenario.load import WORLDS, load_scenario
from sim.sensors.stereo_noise import PERFECT
from sim.simulator import Simulator
from tests.sim.worlds import blind, drive, open_floor, wait

RAMP = RaisedGround(at=(1.0, 0.5), size_m=(3.0, 2.4), height_m=(0.0, 0.45), yaw_deg=30.0)
GRAVEL = RaisedGround(at=(-3.0, 0.0), size_m=(2.0, 1.6), height_m=(0.0, 0.0), bumps_m=0.06)
FOOT_OF_THE_RAMP = Pose2(x_m=-1.4, y_m=4.3, yaw_rad=0.0)


@pytest.mark.parametrize("part", [RAMP, GRAVEL])
def test_the_mesh_of_raised_ground_has_its_heights(part: RaisedGround) -> None:
    corners = part.mesh().corners.reshape(-1, 3, 3)
    normals = part.mesh().normals.reshape(-1, 3, 3)[:, 0]
    top = corners[normals[:, 2] > 0.1]
    weights = np.random.default_rng(1).dirichlet((1, 1, 1), size=len(top))
    inside = np.einsum("nk,nkd->nd", weights, top)
    heights = Ground(raised=[part]).heights(inside[:, :2])
    assert np.abs(heights - inside[:, 2]).max() < 1e-9
    sides = corners[np.abs(normals[:, 2]) < 1e-9].mean(axis=1)[:, :2] - part.at
    outward = normals[np.abs(normals[:, 2]) < 1e-9][:, :2]
    assert len(sides) and ((sides * outward).sum(axis=1) > 0).all()


def test_where_raised_parts_overlap_the_highest_counts() -> None:
    low, high = (
        RaisedGround(at=(0.0, 0.0), size_m=(2.0, 2.0), height_m=(height, height))
        for height in (0.1, 0.3)
    )
    for parts in ([low, high], [high, low]):
        assert Ground(raised=parts).height_m(0.5, 0.5) == pytest.approx(0.3)
    assert Ground(raised=[low]).height_m(1.5, 0.0) == 0.0


def test_the_robot_drives_up_a_ramp_tilted_and_raised_like_it() -> None:
    with blind(load_scenario("terrain"), start=FOOT_OF_THE_RAMP, odometry="ideal") as simulator:
        drive(simulator, 0.6, 0.0, 3.0)
        pose = simulator.true_pose()
        (_, _, z_m), turn = pybullet.getBasePositionAndOrientation(
            simulator.body, physicsClientId=simulator.client
        )
        _, pitch_rad, _ = pybullet.getEulerFromQuaternion(turn)
        assert pose.x_m == pytest.approx(FOOT_OF_THE_RAMP.x_m + 1.7, abs=0.15)
        assert pitch_rad == pytest.approx(-math.atan(0.15), abs=0.01)
        assert simulator.ground.attitude(pose)[1] == pytest.approx(pitch_rad, abs=0.01)
        assert z_m == pytest.approx(simulator.ground.standing_m(pose), abs=0.01)


@pytest.mark.parametrize("name", ["husky", "jackal"])
def test_a_robot_of_any_size_beside_raised_ground_is_neither_tilted_nor_drawn_to_it(
    name: str,
) -> None:
    robot = load_profile(name)
    platform = RaisedGround(at=(0.0, -2.0), size_m=(6.0, 3.0), height_m=(0.45, 0.45))
    beside = Pose2(x_m=0.0, y_m=-0.5 + robot.width_m / 2 + 0.03, yaw_rad=0.0)
    world = dataclasses.replace(open_floor(), raised=(platform,))
    with Simulator(
        world, seed=0, robot=robot, camera_size=(16, 16), camera_rate_hz=0.001, start=beside
    ) as simulator:
        wait(simulator, 0.5)
        pose = simulator.true_pose()
        assert simulator.ground.surface_pose(pose) == pytest.approx(pose.matrix())
        assert pose.distance_to(beside.x_m, beside.y_m) < 0.01


def test_the_camera_sees_raised_ground_where_it_is() -> None:
    with Simulator(
        load_scenario("terrain"),
        seed=0,
        camera_size=(106, 60),
        errors=PERFECT,
        start=FOOT_OF_THE_RAMP,
    ) as simulator:
        frame, pose, ground = simulator.capture(), simulator.true_pose(), simulator.ground
    points = back_project(np.where(frame.depth_m < 3.0, frame.depth_m, 0.0), frame.intrinsics)
    T_map_camera = ground.surface_pose(pose) @ frame.T_base_camera
    seen = points @ T_map_camera[:3, :3].T + T_map_camera[:3, 3]
    seen = seen[seen[:, 1] < 5.8]  # without the wall
    errors = np.abs(ground.heights(seen[:, :2].astype(np.float64)) - seen[:, 2])
    assert np.median(errors) < 0.002 and seen[:, 2].max() > 0.3
    assert (errors < 0.02).mean() > 0.95  # all but the upright sides


def test_raised_ground_in_a_world_with_hills_is_refused(tmp_path: Path) -> None:
    text = (WORLDS / "terrain.toml").read_text(encoding="utf-8")
    path = tmp_path / "hills.toml"
    path.write_text("relief = { slope = 0.1, wave_m = 50.0 }\n" + text, encoding="utf-8")
    with pytest.raises(BadConfiguration, match="raised"):
        load_scenario(path)
