"""The scene, one class per layer. A layer looks at the newest snapshot and sends only what has
changed since the last."""

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
    """What all layers look at."""

    state: State
    """Newest state."""
    picture: TickSnapshot
    """Newest tick's values."""
    zones: tuple[Zone, ...]
    """All stored zones, and where the robot keeps out for a while of its own accord."""
    beware: BewareList
    """The list in force."""
    candidates: Callable[[], Candidates | None] = _nothing
    """Works out what the local planner chooses from; None when nobody wants to see it."""
    strength: Mapping[str, float] = field(default_factory=dict)
    """How strongly a layer is drawn, 0 to 1; one that is not named fully."""

    def faded(self, colour: Rgb, layer: str) -> Rgb:
        """A colour as strong as its layer is drawn."""
        r, g, b = faded(np.array(colour, dtype=np.uint8), self.strength.get(layer, 1.0)).tolist()
        return r, g, b


class Layer(Protocol):
    """A part of the scene below one node, whose name is the layer's."""

    name: str
    period_s: float
    """Shortest time between two looks: what costs much to draw is drawn less often."""

    def push(self, snapshot: Scene) -> None:
        """Send what has changed."""
