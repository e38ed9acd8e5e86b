"""Layers of the scene: each sends only what has changed since the last snapshot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone
from web.images.palette import Rgb
from web.interface.insight import Candidates
from web.interface.snapshots import State, TickSnapshot
from web.viewer.layers.geometry import faded


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
    strength: Mapping[str, float] = field(default_factory=dict)
    """Opacity of layers, 0 to 1; 1 for those not named."""

    def faded(self, colour: Rgb, layer: str) -> Rgb:
        """Return a colour with the opacity of its layer."""
        r, g, b = faded(np.array(colour, dtype=np.uint8), self.strength.get(layer, 1.0)).tolist()
        return r, g, b


class Layer(Protocol):
    """Part of the scene below one node, named as the layer."""

    name: str
    """Name of the layer and of its node."""
    period_s: float
    """Shortest time between two updates in seconds; longer for costly layers."""

    def push(self, scene: Scene) -> None:
        """Send the changes."""
