"""From a scenario, a seed and what was asked for to an episode that can be driven."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from app.episode.ablation import Ablation
from app.episode.episode import Episode
from app.runtime.segmentation import Perception
from navcore.config.navigator import NavigatorConfig, config_for
from navcore.errors import BadConfiguration
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Mission
from navcore.robot.profile import RobotProfile
from sim.scenario.schema import Scenario, map_grid
from sim.scenario.variation import randomise
from sim.truth.random_missions import EXTRA_CLEARANCE_M, draw_mission, draw_zones

ZONES = 2
"""Of an episode with random start and goal, when nobody says how many."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What an episode is about, beside its seed."""

    scenario: Scenario
    """The world as it is in its file."""
    goals: tuple[tuple[float, float], ...] = ()
    """Instead of the scenario's mission."""
    random: bool = False
    """Whether each seed draws start and goal instead."""
    zones: int | None = None
    """How many zones of the operator each seed draws; 2 with a random start, else none, when left
    out."""
    ablation: Ablation = Ablation.NONE
    """What is left out of the navigation."""
    max_time_s: float = 600.0
    """Simulated time after which the robot gives up."""

    def __post_init__(self) -> None:
        if self.random and self.goals:
            raise BadConfiguration(
                "--random with --goal: a random episode draws its goal; leave one of them out"
            )
        if self.ablation is Ablation.NO_ZONES and not self.zone_count:
            raise BadConfiguration(
                "--ablation no-zones where no zone is drawn shows nothing; give --zones N or --random"
            )
        if not (self.random or self.goals or self.scenario.goals):
            raise BadConfiguration(
                f"scenario {self.scenario.name!r} has no goals of its own; give --goal X,Y or --random"
            )

    @property
    def zone_count(self) -> int:
        """How many zones each seed draws."""
        return self.zones if self.zones is not None else ZONES * self.random


def episode_of(
    task: Task,
    seed: int,
    *,
    robot: RobotProfile,
    beware: BewareList,
    perception: Perception | None,
    config: NavigatorConfig | None = None,
) -> Episode:
    """The episode of a seed: places and zones drawn, if so asked, on the world as the seed makes
    it.

    Without a configuration it is driven with the one that the robot starts with.
    """
    world, config = randomise(task.scenario, seed), config or config_for(robot)
    margins_m = {entry.name: entry.margin_m for entry in beware.enabled}
    if task.random:
        world, config = _placed(world, seed, robot, config, margins_m)
    if task.goals:
        world = dataclasses.replace(world, goals=task.goals)
    mission = Mission()
    for x_m, y_m in world.goals:
        mission = mission.add(
            x_m, y_m, map_grid(world)
        )  # refuses what lies outside before anything is built
    inflation_m = robot.width_m / 2 + config.safety_margin_m
    return Episode(
        world,
        seed=seed,
        beware=beware,
        config=config,
        max_time_s=task.max_time_s,
        perception=perception,
        robot=robot,
        as_found=True,
        zones=draw_zones(
            world, seed, task.zone_count, inflation_m=inflation_m, margins_m=margins_m
        ),
        ablation=task.ablation,
    )


def _placed(
    world: Scenario,
    seed: int,
    robot: RobotProfile,
    config: NavigatorConfig,
    margins_m: dict[str, float],
) -> tuple[Scenario, NavigatorConfig]:
    """With start and goal drawn; where there is nowhere as much room as the robot is usually given,
    it is told of less."""
    tight_m = min(robot.circumscribed_radius_m + EXTRA_CLEARANCE_M, config.start_clear_m)
    room_m = {"robot": robot, "margin_m": config.safety_margin_m, "margins_m": margins_m}
    try:
        return draw_mission(world, seed, start_clear_m=config.start_clear_m, **room_m), config  # type: ignore[arg-type]
    except BadConfiguration:
        placed = draw_mission(world, seed, start_clear_m=tight_m, **room_m)  # type: ignore[arg-type]
        return placed, dataclasses.replace(config, start_clear_m=tight_m)
