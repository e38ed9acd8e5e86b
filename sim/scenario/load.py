"""Loading of scenarios: built-in worlds by name, or TOML files."""

from __future__ import annotations

from pathlib import Path

from navcore.errors import BadConfiguration
from navcore.robot.profile import HUSKY, RobotProfile
from navcore.toml_config import from_table, read_toml
from sim.scenario.schema import Scenario
from sim.scenario.validation import check_scenario

FOR_TESTS = ("empty_room",)
"""Built-in worlds that are not offered: tests drive in them."""
WORLDS = Path(__file__).parent / "worlds"
"""Folder of the built-in worlds."""


def scenario_names() -> tuple[str, ...]:
    """Return the names of the built-in worlds, sorted."""
    return tuple(sorted(path.stem for path in WORLDS.glob("*.toml")))


def load_scenario(name_or_path: str | Path, robot: RobotProfile = HUSKY) -> Scenario:
    """Return a built-in world by name, or the world of a file that ends in .toml, in which a robot
    can stand at the start and at the goals; raises `BadConfiguration`, which names the key."""
    path = _path_of(name_or_path)
    scenario = from_table(Scenario, read_toml(path), path.name)
    check_scenario(scenario, path.name, robot)
    return scenario


def _path_of(name_or_path: str | Path) -> Path:
    if isinstance(name_or_path, Path) or name_or_path.endswith(".toml"):
        return Path(name_or_path)
    if name_or_path not in scenario_names():
        known = ", ".join(name for name in scenario_names() if name not in FOR_TESTS)
        raise BadConfiguration(
            f"no world is called {name_or_path!r}; give a .toml file or one of: {known}"
        )
    return WORLDS / f"{name_or_path}.toml"
