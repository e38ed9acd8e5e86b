"""Back ends of the console: the simulated robot, or a recording that is played as a robot."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from app.replay.carried_camera import PLAUSIBLE
from app.replay.floor_plane import find_floor
from app.replay.recording import open_recording
from app.replay.robot import ReplayRobot, map_around
from app.runtime.control.loop import LiveRobot
from app.runtime.record.run_report import Referee
from app.runtime.simulator_process import SimulatorProcess
from navcore.config.navigator import NavigatorConfig
from navcore.config.safety import DEFAULT_SAFETY, SensorMonitorConfig
from navcore.grid.grid import DEFAULT_RESOLUTION_M, GridSpec
from navcore.localisation.fixes import TagMap
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.robot.profile import RobotProfile
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.beware import starting_beware_list
from sim.scenario.load import load_scenario
from sim.scenario.schema import map_grid
from sim.scenario.tags import given_tags
from sim.sensors.faults import Fault
from sim.sensors.gnss_settings import GnssKind


@dataclass(frozen=True, slots=True, kw_only=True)
class BackEnd:
    """A robot and its world."""

    robot: LiveRobot
    """Camera, odometry and wheels."""
    spec: GridSpec
    """Grid of the map."""
    name: str
    """Name of the world, for the operator."""
    referee: Referee | None = None
    """External judge of the runs; None without one."""
    faults: tuple[Fault, ...] = ()
    """Scheduled faults of the world."""
    tags: TagMap = field(default_factory=TagMap)
    """Tags of the world, for sites that name none."""
    beware: BewareList = field(default_factory=default_beware_list)
    """List that a new site in this world starts with."""
    sensors: SensorMonitorConfig = DEFAULT_SAFETY.sensors
    """Which frames of the robot are plausible."""


def simulated(
    scenario: str,
    *,
    seed: int,
    profile: RobotProfile,
    odometry: OdometryGrade = OdometryGrade.TYPICAL,
    gnss: GnssKind | None = None,
) -> BackEnd:
    """Start the simulated robot in a process of its own; raises `SimulatorFailed`."""
    world = load_scenario(scenario, profile)
    robot = SimulatorProcess(scenario, seed=seed, profile=profile, odometry=odometry, gnss=gnss)
    return BackEnd(
        robot=robot,
        spec=map_grid(world),
        name=world.name,
        referee=robot,
        faults=world.faults,
        tags=given_tags(world.tags),
        beware=starting_beware_list(world),
    )


def recorded(folder: Path, *, config: NavigatorConfig, level: bool = False) -> BackEnd:
    """Open a recording, which is played forwards and backwards and ignores commands.

    `level`: its world frame has z up and the floor at 0. Raises `BadConfiguration` naming the file
    that is not a recording.
    """
    recording = open_recording(folder)
    T_map_world = np.eye(4) if level else find_floor(recording)
    spec = map_around(
        recording, T_map_world, reach_m=config.points.max_range_m, resolution_m=DEFAULT_RESOLUTION_M
    )
    robot = ReplayRobot(recording, T_map_world, back_and_forth=True)
    return BackEnd(
        robot=robot, spec=spec, name=f"recording {folder.resolve().name}", sensors=PLAUSIBLE
    )
