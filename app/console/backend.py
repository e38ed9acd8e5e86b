"""What the console can be put before: the simulated robot in a world, or a recording that plays as
one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.replay.floor_plane import find_floor
from app.replay.recording import open_recording
from app.replay.robot import ReplayRobot, map_around
from app.replay.run import RESOLUTION_M
from app.runtime.loop import LiveRobot
from app.runtime.recorder import Referee
from app.runtime.simulator_process import SimulatorProcess
from navcore.config.navigator import NavigatorConfig
from navcore.grid.grid import GridSpec
from navcore.robot.profile import RobotProfile
from sim.scenario.load import load_scenario
from sim.scenario.schema import map_grid
from sim.sensors.faults import Fault


@dataclass(frozen=True, slots=True, kw_only=True)
class BackEnd:
    """A robot with what the console must know of where it is."""

    robot: LiveRobot
    """Its senses and wheels."""
    spec: GridSpec
    """Of the map."""
    name: str
    """Of the world, for the operator."""
    referee: Referee | None = None
    """Who judges from outside."""
    faults: tuple[Fault, ...] = ()
    """What the world breaks, and when."""


def simulated(scenario: str, *, seed: int, profile: RobotProfile) -> BackEnd:
    """The simulated robot in a process of its own; raises `SimulatorFailed` when it does not come
    up."""
    world = load_scenario(scenario)
    robot = SimulatorProcess(scenario, seed=seed, profile=profile)
    return BackEnd(
        robot=robot, spec=map_grid(world), name=world.name, referee=robot, faults=world.faults
    )


def recorded(folder: Path, *, config: NavigatorConfig, level: bool = False) -> BackEnd:
    """A recording that plays back and forth; its wheels are nowhere. `level`: its world has z up
    and the floor at 0.

    Raises `BadConfiguration` naming the file for what is no recording.
    """
    recording = open_recording(folder)
    T_map_world = np.eye(4) if level else find_floor(recording)
    spec = map_around(
        recording, T_map_world, reach_m=config.points.max_range_m, resolution_m=RESOLUTION_M
    )
    robot = ReplayRobot(recording, T_map_world, back_and_forth=True)
    return BackEnd(robot=robot, spec=spec, name=f"recording {folder.resolve().name}")
