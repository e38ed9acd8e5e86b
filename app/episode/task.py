"""Composition of an episode from a scenario, a seed and options."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass

from app.episode.ablations import Ablation
from app.episode.episode import Episode, EpisodeSettings
from app.episode.latency import NO_LATENCY, Latency
from app.episode.second_day import second_day
from app.runtime.start.segmentation import Perception
from navcore.config.navigator import NavigatorConfig, config_for
from navcore.errors import BadConfiguration, BadGeometry
from navcore.mission.beware_list import BewareList
from navcore.robot.camera_stream import CameraStream
from navcore.robot.profile import RobotProfile
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.schema import Scenario
from sim.scenario.variation import randomise
from sim.sensors.gnss_settings import GnssKind
from sim.truth.clearance import clearance_m, grown_obstacles
from sim.truth.random_missions import draw_mission, draw_zones

ZONES = 2
"""Default number of zones of an episode with random start and goal."""
NARROW_CLEARANCE_M = 0.3
"""Clearance at the start of a robot that turns in place, in a world where hardly a position has as
much as configured. With less it sees no floor beside it that it could drive on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Options of an episode, without its seed."""

    scenario: Scenario
    """Scenario as in its file."""
    goals: tuple[tuple[float, float], ...] = ()
    """Goals (x, y) in metres of the map frame; empty for those of the scenario."""
    random: bool = False
    """Whether each seed draws start and goal."""
    zones: int | None = None
    """Number of operator's zones that each seed draws; None for 2 with a random start, else 0."""
    ablation: Ablation = Ablation.NONE
    """Part of the navigation that is left out."""
    odometry: OdometryGrade = OdometryGrade.TYPICAL
    """How good the odometry of the robot is."""
    gnss: GnssKind | None = None
    """GNSS receiver of the robot; None for that of the scenario."""
    camera: CameraStream | None = None
    """Size and rate of the camera's images; None for those of the robot's profile."""
    latency: Latency = NO_LATENCY
    """Time that ticks take on the simulated clock."""
    yielding: bool = False
    """Whether the people of the scenario who yield to the robot do so; else all walk on."""
    kept_map: bool = False
    """Whether the robot has mapped the world on the day before."""
    max_time_s: float = 600.0
    """Longest simulated duration, seconds."""

    def __post_init__(self) -> None:
        if self.random and self.goals:
            raise BadConfiguration(
                "--random with --goal: a random episode draws its goal; leave one of them out"
            )
        if self.ablation is Ablation.NO_ZONES and not self.zone_count:
            raise BadConfiguration(
                "--ablation no-zones without a zone has no effect; give --zones N or --random"
            )
        if not (self.random or self.goals or self.scenario.goals):
            raise BadConfiguration(
                f"scenario {self.scenario.name!r} has no goals of its own; "
                "give --goal X,Y or --random"
            )

    @property
    def world(self) -> Scenario:
        """Scenario with the goals that were asked for, before a seed varies it."""
        return dataclasses.replace(self.scenario, goals=self.goals or self.scenario.goals)

    @property
    def populated(self) -> Scenario:
        """Scenario with people who yield or walk on, as was asked for."""
        people = tuple(
            dataclasses.replace(person, yields=person.yields and self.yielding)
            for person in self.scenario.people
        )
        return dataclasses.replace(self.scenario, people=people)

    @property
    def zone_count(self) -> int:
        """Number of zones that each seed draws."""
        return self.zones if self.zones is not None else ZONES * self.random


def check_goals(world: Scenario) -> None:
    """Refuse a goal outside the world, with `BadGeometry`, before anything slow is built."""
    half_x_m, half_y_m = (side / 2 for side in world.size_m)
    for x_m, y_m in world.goals:
        if not (abs(x_m) <= half_x_m and abs(y_m) <= half_y_m):
            raise BadGeometry(
                f"goal ({x_m:g}, {y_m:g}) lies outside the world, x ±{half_x_m:g} m, "
                f"y ±{half_y_m:g} m"
            )


def episode_of(
    task: Task,
    seed: int,
    *,
    robot: RobotProfile,
    beware: BewareList,
    perception: Perception | None,
    config: NavigatorConfig | None = None,
) -> Episode:
    """Compose the episode of a seed: the scenario randomised, mission and zones drawn as the task
    says; for one in a kept map the day before is driven now.

    Without a configuration the default of the robot is used.
    """
    world, config = randomise(task.populated, seed), config or config_for(robot)
    margins_m = {entry.detected_as: entry.margin_m for entry in beware.enabled}
    if task.random:
        world, config = _placed(world, seed, robot, config, margins_m)
    if task.goals:
        world = dataclasses.replace(world, goals=task.goals)
    check_goals(world)
    inflation_m = robot.width_m / 2 + config.safety_margin_m
    settings = EpisodeSettings(
        beware=beware,
        config=config,
        max_time_s=task.max_time_s,
        perception=perception,
        robot=robot,
        randomised=True,
        zones=draw_zones(
            world,
            seed,
            task.zone_count,
            robot=robot,
            inflation_m=inflation_m,
            margins_m=margins_m,
        ),
        ablation=task.ablation,
        odometry=task.odometry,
        camera=task.camera,
        latency=task.latency,
        gnss=task.gnss,
    )
    if task.kept_map:
        return second_day(world, settings, seed=seed)
    return Episode(world, settings, seed=seed)


def _placed(
    world: Scenario,
    seed: int,
    robot: RobotProfile,
    config: NavigatorConfig,
    margins_m: dict[str, float],
) -> tuple[Scenario, NavigatorConfig]:
    """Draw start and goal; where hardly a position has the usual clearance at the start, the robot
    is told of that which it has."""
    narrow_m = min(robot.circumscribed_radius_m + NARROW_CLEARANCE_M, config.start_clear_m)
    draw = functools.partial(
        draw_mission,
        world,
        seed,
        robot=robot,
        margin_m=config.safety_margin_m,
        start_ahead_m=config.start_ahead_m,
        margins_m=margins_m,
    )
    try:
        return draw(start_clear_m=config.start_clear_m), config
    except BadConfiguration:
        placed = draw(start_clear_m=narrow_m)
        x_m, y_m, _ = placed.start
        clear_m = clearance_m(grown_obstacles(placed, margins_m, robot), x_m, y_m)
        told_m = min(clear_m, config.start_clear_m)
        return placed, dataclasses.replace(config, start_clear_m=told_m)
