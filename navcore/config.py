"""Everything that can be set about the navigation, with the values a new installation starts with."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from navcore.cloud_map import MapRules
from navcore.local_planner import LocalRules
from navcore.points import PointRules
from navcore.settings import between, from_table, read_toml


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigatorConfig:
    """Read from a TOML file by `load_config`; unknown keys and values out of range are refused by name."""

    safety_margin_m: float = between(0.0, 1.0, default=0.15)
    """Added to half the vehicle's width before obstacles are inflated, s_m in the paper."""
    max_vertex_angle_deg: float = between(90.0, 179.9, default=170.0)
    """A path cell is a waypoint where the angle between its two neighbours is below this, θ_th in the paper."""
    start_relief_m: float = between(0.0, 2.0, default=0.6)
    """A robot that stands inside the inflation plans from the nearest free cell within this distance."""
    plan_budget: int = between(1_000, 1_000_000_000, default=2_000_000)
    """Work after which a search is given up ("time budget exceeded"), in straight walks and diagonal steps; a large maze has
    some ten thousand, so that this is some seconds. A count and not a clock, so that the same run takes the same turn."""
    start_clear_m: float = between(0.0, 5.0, default=1.2)
    """Within this distance of where it is put down the robot has room; the camera cannot look there."""
    points: PointRules = field(default_factory=PointRules)
    """Which measurements count."""
    map: MapRules = field(default_factory=MapRules)
    """When points are replaced and cleared."""
    local: LocalRules = field(default_factory=LocalRules)
    """How the local planner moves."""


def load_config(path: Path) -> NavigatorConfig:
    """The configuration of a file; raises `BadConfiguration`."""
    return from_table(NavigatorConfig, read_toml(path), path.name)
