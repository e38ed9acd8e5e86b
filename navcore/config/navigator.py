"""Configuration of the navigation, with its defaults."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from navcore.config.behaviours import BehavioursConfig, RecoveryConfig
from navcore.config.control import ControlConfig, LocalPlannerConfig
from navcore.config.localisation.localisation import LocalisationConfig
from navcore.config.localisation.zone_margins import ZoneMarginConfig
from navcore.config.mapping import MappingConfig
from navcore.config.people import PeopleConfig
from navcore.config.perception.perception import ObservationConfig, PerceptionConfig
from navcore.config.planning import PlanningConfig
from navcore.robot.profile import HUSKY, RobotProfile
from navcore.toml_config import from_table, ranged, read_toml


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigatorConfig:
    """Read from a TOML file by `load_config`; unknown keys and values out of range are refused by
    name."""

    safety_margin_m: float = ranged(0.0, 1.0, default=0.15)
    """Clearance in metres added to half the vehicle's width to give the inflation radius, s_m in
    the paper."""
    start_relief_m: float = ranged(0.0, 2.0, default=0.6)
    """Distance in metres within which a robot that stands inside the inflation looks for the free
    cell to plan from."""
    plan_budget: int = ranged(1_000, 1_000_000_000, default=2_000_000)
    """Number of straight walks and diagonal steps after which a search is given up ("time budget
    exceeded"); a large maze takes some ten thousand. Where unseen floor has a price, the number of
    cells after which the shortest path is followed instead. A count and not a clock, so that a run
    can be repeated exactly."""
    start_clear_m: float = ranged(0.0, 5.0, default=1.2)
    """Radius in metres of the floor that is clear around the start pose, where the camera cannot
    look; but for a rim of half a cell it is taken for free. A robot that is put down in a narrow
    place needs a smaller one."""
    start_ahead_m: float = ranged(0.0, 5.0, default=1.2)
    """Distance in metres ahead of the start pose up to which the floor is taken for free, as wide
    as the body: from there on the camera sees it."""
    points: ObservationConfig = field(default_factory=ObservationConfig)
    """Which measurements become map points."""
    perception: PerceptionConfig = field(default_factory=PerceptionConfig)
    """Tuning of the perception stage."""
    map: MappingConfig = field(default_factory=MappingConfig)
    """When points of the map are replaced and cleared."""
    local: LocalPlannerConfig = field(default_factory=LocalPlannerConfig)
    """Local planner."""
    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)
    """Recovery of a blocked robot."""
    behaviours: BehavioursConfig = field(default_factory=BehavioursConfig)
    """Waiting for people, their lanes, driving by hand."""
    people: PeopleConfig = field(default_factory=PeopleConfig)
    """Behaviour beside people."""
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    """Tuning of the planning stage."""
    control: ControlConfig = field(default_factory=ControlConfig)
    """Tuning of the control stage."""
    localisation: LocalisationConfig = field(default_factory=LocalisationConfig)
    """Where the robot is in the map."""
    zone_margins: ZoneMarginConfig = field(default_factory=ZoneMarginConfig)
    """How zones grow with the uncertainty of the robot's position."""


def load_config(path: Path, robot: RobotProfile = HUSKY) -> NavigatorConfig:
    """Load the configuration of a robot, with the values that a TOML file changes; raises
    `BadConfiguration`."""
    return from_table(NavigatorConfig, read_toml(path), path.name, config_for(robot))


def config_for(robot: RobotProfile) -> NavigatorConfig:
    """Return the default configuration of a robot: that of the Husky, scaled to body and limits.

    The margin is the same share of the clearance that a turn in place needs beyond half the width;
    speeds and decelerations are the same shares of the platform's limits. What is above the robot
    is no obstacle.
    """
    usual, rules = NavigatorConfig(), LocalPlannerConfig()
    room = _turning_room_m(robot) / _turning_room_m(HUSKY)
    return replace(
        usual,
        safety_margin_m=min(usual.safety_margin_m * room, 1.0),
        points=replace(usual.points, ceiling_m=robot.ceiling_m),
        local=replace(
            rules,
            padding_m=min(rules.padding_m * room, 0.5),
            braking_mps2=min(
                rules.braking_mps2 * (robot.max_accel_mps2 / HUSKY.max_accel_mps2), 5.0
            ),
            turn_rate_radps=min(
                rules.turn_rate_radps * (robot.max_yaw_rate_radps / HUSKY.max_yaw_rate_radps), 2.0
            ),
        ),
    )


def _turning_room_m(robot: RobotProfile) -> float:
    return robot.circumscribed_radius_m - robot.width_m / 2
