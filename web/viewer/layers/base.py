"""Layers of the scene: each sends only what has changed since the last snapshot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone
from web.interface.insight import Candidates
from web.interface.snapshots import State, TickSnapshot


def _nothing() -> None:
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Values of one update of all layers."""

    state: State
    """Newest state."""
    tick: TickSnapshot
    """Values of the newest tick."""
    zones: tuple[Zone, ...]
    """Stored zones, and areas that the robot keeps out of for a while by its own decision."""
    beware: BewareList
    """Beware list in force."""
    candidates: Callable[[], Candidates | None] = _nothing
    """Return the motion primitives of the local planner; None while they are hidden."""


class Layer(Protocol):
    """Part of the scene below one node, named as the layer."""

    name: str
    """Name of the layer and of its node."""
    period_s: float
    """Shortest time between two updates in seconds; longer for costly layers."""

    def push(self, scene: Scene) -> None:
        """Send the changes."""
