"""Everything that can be set about the navigation, with the values a new installation starts with."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from navcore.config.behaviours import RecoveryConfig
from navcore.config.control import ControlConfig, LocalPlannerConfig
from navcore.config.mapping import MappingConfig
from navcore.config.people import PeopleConfig
from navcore.config.perception import ObservationConfig
from navcore.config.planning import MAX_VERTEX_ANGLE_DEG, PlanningConfig
from navcore.robot.profile import HUSKY, RobotProfile
from navcore.toml_config import from_table, ranged, read_toml


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigatorConfig:
    """Read from a TOML file by `load_config`; unknown keys and values out of range are refused by
    name."""

    safety_margin_m: float = ranged(0.0, 1.0, default=0.15)
    """Added to half the vehicle's width before obstacles are inflated, s_m in the paper."""
    max_vertex_angle_deg: float = ranged(135.1, 179.9, default=MAX_VERTEX_ANGLE_DEG)
    """A path cell is a waypoint where the angle between its two neighbours is below this, θ_th in
    the paper. A path turns by 45° at least: below 135° bends would be left out, and the lines
    between waypoints cross what the path goes round."""
    start_relief_m: float = ranged(0.0, 2.0, default=0.6)
    """A robot that stands inside the inflation plans from the nearest free cell within this
    distance."""
    plan_budget: int = ranged(1_000, 1_000_000_000, default=2_000_000)
    """Work after which a search is given up ("time budget exceeded"), in straight walks and
    diagonal steps; a large maze has some ten thousand, so that this is some seconds. A count and
    not a clock, so that the same run takes the same turn."""
    start_clear_m: float = ranged(0.0, 5.0, default=1.2)
    """Within this distance of where it is put down the robot has room; the camera cannot look
    there."""
    points: ObservationConfig = field(default_factory=ObservationConfig)
    """Which measurements count."""
    map: MappingConfig = field(default_factory=MappingConfig)
    """When points are replaced and cleared."""
    local: LocalPlannerConfig = field(default_factory=LocalPlannerConfig)
    """How the local planner moves."""
    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)
    """What it tries when it is boxed in."""
    people: PeopleConfig = field(default_factory=PeopleConfig)
    """How it behaves beside people."""
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    """Tuning of the planning stage."""
    control: ControlConfig = field(default_factory=ControlConfig)
    """Tuning of the control stage."""


def load_config(path: Path, robot: RobotProfile = HUSKY) -> NavigatorConfig:
    """The configuration that a robot starts with, but for what a file says otherwise; raises
    `BadConfiguration`."""
    return from_table(NavigatorConfig, read_toml(path), path.name, config_for(robot))


def config_for(robot: RobotProfile) -> NavigatorConfig:
    """The configuration that a robot starts with: the defaults, which were found with the Husky,
    fitted to body and limits.

    The margin is the same share of the room that a turn in place needs beyond half the width;
    speeds and decelerations are the same shares of the platform's limits.
    """
    usual, rules = NavigatorConfig(), LocalPlannerConfig()
    room = _turning_room_m(robot) / _turning_room_m(HUSKY)
    return replace(
        usual,
        safety_margin_m=min(usual.safety_margin_m * room, 1.0),
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
