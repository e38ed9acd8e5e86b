"""A simulated robot in scenarios with a referee; the names that other packages need."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sim.scenario.load import load_scenario, scenario_names
    from sim.scenario.schema import Scenario
    from sim.simulator import Simulator

__all__ = ["Scenario", "Simulator", "load_scenario", "scenario_names"]

_MODULES = {
    "Scenario": "sim.scenario.schema",
    "Simulator": "sim.simulator",
    "load_scenario": "sim.scenario.load",
    "scenario_names": "sim.scenario.load",
}
"""Module of each public name; loaded on first use, so that `import sim` stays cheap."""


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULES[name]), name)
